"""Where documents lie on disk."""

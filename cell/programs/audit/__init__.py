"""The audit: read a recording, check that it is intact, compute every number again."""

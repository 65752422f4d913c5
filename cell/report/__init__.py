"""Reports that people read: self-contained HTML and pictures."""

"""Recordings: written, read, sealed and shown. The only room that imports rerun."""

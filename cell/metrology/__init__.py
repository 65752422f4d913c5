"""The method, pure: from images and documents to numbers; no clock, chance, files or devices."""

"""The documents: frozen, validated once at the door, right or refused with file, line, key.

Text comes in and a document goes out (`parse`), or the other way (`dump`); where the texts lie on
disk is the business of `cell.archive`.
"""

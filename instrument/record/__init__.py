"""instrument/record."""

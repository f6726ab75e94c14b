"""instrument/text."""

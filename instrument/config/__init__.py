"""instrument/config."""

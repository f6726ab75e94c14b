"""acquisition/commands."""

"""acquisition/terminal."""

"""acquisition/measure."""

"""acquisition/engine."""

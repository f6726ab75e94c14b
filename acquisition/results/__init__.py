"""acquisition/results."""

"""acquisition/plan."""

"""acquisition/benchmark/output."""

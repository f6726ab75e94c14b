"""acquisition/benchmark/maps."""

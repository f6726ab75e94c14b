"""acquisition/benchmark/studies."""

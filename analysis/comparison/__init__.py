"""Comparison of several runs: whether they agree, and how far they repeat."""

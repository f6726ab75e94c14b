"""Simulated cells and samples, for tests of maps."""

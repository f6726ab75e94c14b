"""Adaptive scans for tests: lists of candidates, and a bench that measures them at once."""

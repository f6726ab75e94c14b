"""Helpers for the tests of the analysis: seeded scans, tables as text, report data."""

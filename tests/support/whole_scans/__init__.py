"""Whole scans for tests: faulty ones, stopped ones, many draws of one, and their points."""

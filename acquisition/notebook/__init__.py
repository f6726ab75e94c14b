"""Python interface for notebooks: runs, tables, fits and scans as objects; start with `runs`.

The module `gonio` at the top is what a user imports.
"""

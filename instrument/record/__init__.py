"""Run record: its rows, its SQLite schema and file, and the checks of a record from elsewhere.

Open `record` first; `reading` holds the rows, `schema` the tables and the allowed values.
"""

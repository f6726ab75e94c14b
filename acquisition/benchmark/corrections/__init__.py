"""Worth of each correction of a scan on a bench with real defects: open `worth`."""

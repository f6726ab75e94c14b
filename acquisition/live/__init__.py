"""Live page: a scan, watched in a browser by a process of its own that reads the record."""

"""Live page: a scan, watched in a browser by a process of its own that reads the record.

Start with `channel`, where the two sides meet: `publisher` is the scan's, `live_page` the page's.
"""

"""Calibrations as data that a scan may read: response curve of a camera, table of a white tile.

Open `response_curve` or `tile_table` first. Procedures that measure a calibration, and fits, stand
elsewhere.
"""

"""Calibrations as data that a scan may read: of a camera, and the table of a white tile.

Open `camera_calibration` or `tile_table` first. Procedures that measure a calibration, and fits,
stand elsewhere.
"""

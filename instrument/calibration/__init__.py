"""Calibrations as data that a scan may read: the response curve of a camera.

Open `response_curve` first. Procedures that measure a calibration, and fits, stand elsewhere.
"""

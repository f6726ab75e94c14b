"""Measurements, their covariance, and readers of data files. Open `measurements.py` first."""

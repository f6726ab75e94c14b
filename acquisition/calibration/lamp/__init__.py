"""Calibration of a lamp: warm-up and drift, flicker, and uniformity over the sample.

Open `watch` first. Nothing here moves an axis.
"""

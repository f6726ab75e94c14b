"""Fit of one reflectance model to measurements, with uncertainties. Open `fit.py` first."""

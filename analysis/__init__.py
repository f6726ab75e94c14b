"""Reflectance models, fit, choice, uncertainty, charts and reports. Knows only `instrument`."""

"""Exposures of a scan: searched, checked by light, taken with their darks."""

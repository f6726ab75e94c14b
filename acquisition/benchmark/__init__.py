"""Benchmark of speed against accuracy, `gonio bench`, on the machine that it runs on.

Open `command` first: it measures the `studies`, draws the `maps` and writes the `output`. A study
compares methods in scenes; each trial sets a method's cost against its error to an independent
truth. `demo_scan` derives the simulated scans from the shipped demonstration.
"""

"""Studies of the benchmark: reflectance, measuring window, fit, scan and camera.

Open `all_studies` first for the list; `method` is what a study compares. The `..._truth` modules
hold the independent reference values.
"""

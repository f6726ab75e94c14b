"""Accuracy and cost of the ways to compute a model, and which parameters a sweep determines.

Open `cheapest` first: it finds the cheapest method that keeps a tolerance. `method` defines a
method and a family of them, `rough_surface` the family in use. `render_brdf` applies `cheapest` to
the simulated camera's pictures; `identifiability` judges a planned sweep.
"""

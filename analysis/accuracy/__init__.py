"""Accuracy and cost of the ways to compute a model, and which parameters a sweep determines.

Open `cheapest` first: it finds the cheapest method that keeps a tolerance. `method` says what a
method is; `rough_surface`, `smooth_dielectric` and `beckmann_lobe` hold them. `render_brdf` applies
`cheapest` to the simulated camera's pictures; `identifiability` judges a planned sweep.
"""

"""Reflectance models, fits, choice of a model, and reports; imports only `instrument`.

Open `fit/fit.py` first, and `models/base.py` to add a model.
"""

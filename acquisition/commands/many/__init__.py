"""Commands on all sources of a folder; open `fit_all.py` first."""

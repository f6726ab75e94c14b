"""Search for the deepest minimum of chi2 of one problem. Open `problem.py` first."""

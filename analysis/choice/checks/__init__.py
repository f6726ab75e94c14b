"""Checks of the data themselves, told as notes; none changes data. Open `all_checks.py` first."""

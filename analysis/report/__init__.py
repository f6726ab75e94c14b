"""HTML report of a run, made from plain data. Open `page.py` first."""

"""Sections of a report in HTML: the models, the pictures. Open `models_html.py` first."""

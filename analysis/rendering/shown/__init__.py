"""A material shown: its pictures, curves and numbers beside Lambert's, and their page.

Open `shown` first.
"""

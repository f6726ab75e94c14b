"""Scans whose geometries are chosen for what they teach: forecast, candidates, choice, file.

Open `optimal_plan.py` first; `forecast.py` says which u any plan will give.
"""

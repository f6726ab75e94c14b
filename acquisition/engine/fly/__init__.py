"""Scan in which theta_r turns while the camera exposes; start with `flights`."""

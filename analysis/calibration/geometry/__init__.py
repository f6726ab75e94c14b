"""Geometry of a rig from pictures of a board: projection of its corners, and the fit."""

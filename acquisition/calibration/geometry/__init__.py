"""Geometry of a rig: the page with the board, pictures of it at many view angles, and the file."""

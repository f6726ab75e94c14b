"""Real devices: motor stages, V4L2 cameras, and what an operator does by hand.

Start with `factory`, which opens what a rig file names. `lines` carry bytes, `stages` turn them
into degrees, `v4l2` is the camera. This package imports only `instrument`.
"""

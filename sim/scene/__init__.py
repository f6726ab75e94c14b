"""The simulated scene and the devices that act on it: stage, camera, lamp, operator.

Open `scene` first (the state), then `render` (radiance to electrons) and `sensor` (electrons to
counts).
"""

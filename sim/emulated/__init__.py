"""Emulated stage controllers and camera: the real drivers talk to them where there is no rig.

Open `bench` first: it connects all of them to one simulated scene.
"""

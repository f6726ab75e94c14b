"""Simulation of a whole rig: `scene.scene` holds its state; start there.

`scene` simulates the devices with the `defects` that the rig file gives them, `faults` makes them
fail on request, `emulated` puts byte-level controllers and a V4L2 camera before the scene for the
real drivers.
"""

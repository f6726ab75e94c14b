"""Defects of real devices that a simulated scene can show; `camera` has those of the camera."""

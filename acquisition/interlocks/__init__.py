"""Interlocks: faults that no device reports, seen in the light, the frames and the controls.

Each module holds one physical promise and what contradicts it: a flag on every point that it
touches, or an `Interlock` that ends the scan like a stalled axis.
"""

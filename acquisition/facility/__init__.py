"""A rig in the hands of another program: bluesky's run engine, its documents, a Tiled server.

Read `devices/rig_devices.py` first, then `plans.py`. bluesky is imported by `plans` and
`documents` alone, and there only where it is used.
"""

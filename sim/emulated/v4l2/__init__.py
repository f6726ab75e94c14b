"""An emulated V4L2 camera that OpenCV opens like a real one.

Open `device` first (formats, controls, faults), then `sensor` and `stream` (exposures and buffers),
`server` (requests over a socket) and `shim.c` (the library preloaded into the process that opens
the camera).
"""

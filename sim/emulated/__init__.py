"""Emulated stage controllers and camera: the real drivers talk to them where there is no rig.

Open `bench` first: it connects all of them to one simulated scene. Each controller says of which
real device its answers are a transcript, and what could not be verified. `v4l2` and `usb` hold the
camera on two sides of the kernel: before OpenCV, and before the kernel's own drivers.
"""

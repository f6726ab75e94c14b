"""sim/emulated/v4l2."""

"""sim/emulated."""

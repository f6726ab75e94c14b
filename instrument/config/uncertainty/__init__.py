"""Uncertainty of a rig that no command measures, as its file states it; open `rig_lines`."""

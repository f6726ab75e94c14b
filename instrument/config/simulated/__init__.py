"""Defects of a simulated rig, as its file gives them; open `defects` first."""

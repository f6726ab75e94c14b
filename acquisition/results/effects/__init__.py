"""Effects of bench and lamp on the values of a run: open `rig_effects`."""

"""Effects that a rig file states and no command measures: open `rig_effects`."""

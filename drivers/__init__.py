"""Real devices: framing, port, stage in degrees; the hand-set axis. Knows only `instrument`."""

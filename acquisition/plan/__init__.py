"""Planning a scan before anything moves: steps, moves, exposures; start with `plan`."""

"""Speed-up of many fits by more processes, and what limits it: open `speed_up`."""

"""Device faults in a simulated scan, planned in words: `GONIO_FAULTS`. Open `faults` first."""

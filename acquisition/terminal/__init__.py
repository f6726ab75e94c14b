"""Terminal input and output: consoles, progress bar, the operator; start with `console`."""

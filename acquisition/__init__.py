"""Acquisition: protocol, plan, scan, results and the command line. Start with `cli`."""

"""Results of a run: reduced values, fit, table and report. Start with `finish.finish`."""

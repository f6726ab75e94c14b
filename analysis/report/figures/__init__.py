"""Figures of a report: charts of the sweeps, around the sample, and of the uncertainty."""

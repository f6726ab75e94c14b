"""Sensors of a few lines, for tests of calibrations; they share nothing with the simulation."""

"""Fits of calibrations: pure functions on arrays of means and variances; no device, no file.

Open `photon_transfer` first. Names and definitions of the camera's are those of EMVA 1288, release
4.0 Linear (2021): K, sigma_d, mu_I, mu_e.sat, LE, PRNU1288, DSNU1288.
"""

"""Scan engine: runs a plan on the devices and records the readings; start with `engine`."""

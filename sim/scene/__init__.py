"""sim/scene."""

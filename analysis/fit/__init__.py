"""analysis/fit."""

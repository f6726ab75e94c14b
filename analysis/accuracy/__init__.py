"""analysis/accuracy."""

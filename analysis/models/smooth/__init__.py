"""analysis/models/smooth."""

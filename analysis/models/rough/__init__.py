"""analysis/models/rough."""

"""analysis/choice."""

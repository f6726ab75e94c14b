"""drivers/lines."""

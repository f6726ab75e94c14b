"""drivers/v4l2."""

"""drivers/stages."""

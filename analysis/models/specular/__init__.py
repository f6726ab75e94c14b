"""analysis/models/specular."""

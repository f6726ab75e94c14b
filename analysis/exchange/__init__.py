"""Exchange with other programs: file formats of BRDF data and of reflectance models."""

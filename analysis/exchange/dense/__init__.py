"""Binary and dense formats of BRDF data."""

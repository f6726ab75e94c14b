"""Interlocks on the whole picture: the outline of the surface, and whether it was swapped."""

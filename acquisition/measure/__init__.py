"""Measuring: frames to a window mean with its uncertainty, and lamp drift; start with `window`."""

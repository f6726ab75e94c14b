"""Frames rectified to the sample's plane: the light of each cell; start with `rectified`."""

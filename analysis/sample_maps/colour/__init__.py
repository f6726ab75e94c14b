"""Maps of a colour camera: one sigma and an albedo for each channel; start with `channel_fit`."""

"""Maps of a sample: albedo and roughness fitted in each cell; start with `cell_fit`."""

"""Materials of renderers: the model that was fitted, or a table of it."""

"""Maps of a run's sample, from its kept frames; start with `sample_map`."""

"""Place of the plate that carries the sample, from markers beside it in the scan's own frames."""

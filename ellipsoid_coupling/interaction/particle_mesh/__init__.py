"""The interaction of samples with their own density: deposit on nodes, convolve, interpolate."""

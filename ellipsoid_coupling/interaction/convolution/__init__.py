"""The interaction integral as a convolution: angular series, spectra of kernels, transforms."""

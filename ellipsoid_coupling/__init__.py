"""Ellipsoidal particles in an OpenFOAM flow: from particles to mean-field equations."""
__version__ = "0.1.0"

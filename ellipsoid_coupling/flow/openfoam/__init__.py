"""OpenFOAM: read a solved case, check a foreign one, and have a case solved."""

"""How fluxes and time are stepped: particle steppers, grids, fluxes, sweeps, sources, noise."""

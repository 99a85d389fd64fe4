"""Cells: grids, fluxes, sweeps, sources, and how they follow one another within a step."""

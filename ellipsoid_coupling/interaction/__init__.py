"""Interaction of particles: the integral on r-grids, walls and the pair sum over particles."""

from ellipsoid_coupling.geometry.reflection import reflect
from ellipsoid_coupling.interaction.curved_walls import CurvedWalls
from ellipsoid_coupling.interaction.direct import DirectInteraction
from ellipsoid_coupling.interaction.grid_forces import Forces, GridInteraction
from ellipsoid_coupling.interaction.rho_grid import HarmonicInteraction
from ellipsoid_coupling.interaction.select import choose_interaction
from ellipsoid_coupling.interaction.wall_table import WALL_FRAMES, WallFrame, WallTable
from ellipsoid_coupling.interaction.walls import GhostCells, GhostParticles, Walls

__all__ = [
    "WALL_FRAMES",
    "CurvedWalls",
    "DirectInteraction",
    "Forces",
    "GhostCells",
    "GhostParticles",
    "GridInteraction",
    "HarmonicInteraction",
    "WallFrame",
    "WallTable",
    "Walls",
    "choose_interaction",
    "reflect",
]

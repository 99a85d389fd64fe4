"""Walls: fixed ghosts that push particles and densities away, `model.md` "Scenes" and "Errata".

One object yields both kinds. For particles, ghost particles sit on the wall (g), spaced L = l/2 and
centred on it; for densities, ghost cells (+) lie beyond it, as deep as the potential reaches:

        . | .   .   .   .   .   .
        . | .   .   .   .   .   .     .  cells of the domain
        --g-----g-----g-----g----     -  wall at y_low, main axes of all ghosts along it
        + | +   +   +   +   +   +
        + | +   +   +   +   +   +     +  ghost cells; `depth` of them, one below the other

Each wall is taken as endless, so that a ghost cell beyond a corner belongs to both of the walls
that meet there, and a cell's distance to a wall is all that its force depends on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.interaction.wall_table import WALL_FRAMES, WallTable, tabulate_wall
from ellipsoid_coupling.physics.potential import PotentialShape
from ellipsoid_coupling.scenes.sides import SideName

Interval = tuple[float, float]


class GhostParticles(NamedTuple):
    """Particles that sit on the walls: positions and angles, (n,) float64 each."""

    x: Array
    y: Array
    angle: Array


class GhostCells(NamedTuple):
    """Cells beyond the walls: centres, angle and density, (n,) float64 each."""

    x: Array
    y: Array
    angle: Array
    density: Array


@dataclass(frozen=True)
class Walls:
    """The walls of a rectangle.

    Parameters
    ----------
    domain : ((x_low, x_high), (y_low, y_high))
    sides : tuple of "left", "right", "bottom", "top"
        Those that are walls.
    length : float
        L of the particles.
    shape : PotentialShape
    strength : float
        eps0 among particles.
    particles : int
        N: ghosts act with 1/N like particles do.
    strength_factor : float
        By how much ghosts are stronger than particles.
    ghost_density : "matched" or "paper"
        Ghost cells carry the ghost particles' mass per wall length, or 1/h^2.

    Raises
    ------
    InputError
        No or unknown sides, an empty domain, a number that is not positive, an unknown density.
    """

    domain: tuple[Interval, Interval]
    sides: tuple[SideName, ...]
    length: float
    shape: PotentialShape
    strength: float
    particles: int
    strength_factor: float = 10.0
    ghost_density: Literal["matched", "paper"] = "matched"

    def __post_init__(self) -> None:
        unknown = set(self.sides) - set(WALL_FRAMES)
        if unknown or not self.sides or len(set(self.sides)) < len(self.sides):
            known = ", ".join(WALL_FRAMES)
            raise InputError("walls", f"some of {known}", f"{self.sides}", "Name each side once.")
        # `not <` and `not >` refuse NaN as well.
        if any(not low < high for low, high in self.domain):
            raise InputError("walls", "low < high", f"{self.domain}", "Give the domain's bounds.")
        if not min(self.length, self.particles, self.strength_factor) > 0:
            found = f"{self.length}, {self.particles}, {self.strength_factor}"
            raise InputError(
                "walls", "length, particles, strength_factor > 0", found, "Give positive numbers."
            )
        if self.ghost_density not in ("matched", "paper"):
            raise InputError(
                "walls.ghost_density", "matched or paper", repr(self.ghost_density), "Name one."
            )

    def ghost_particles(self) -> GhostParticles:
        """Particles at distances L along each wall, as many as fit best, centred.

        The outer ones are between L/4 and 3 L/4 from the corners, L/2 where the wall is a multiple
        of L long: no two walls share a ghost.
        """
        parts = []
        for side in self.sides:
            low, high = self._extent(side)
            count = max(1, round((high - low) / self.length))
            along: Array = 0.5 * (low + high) + self.length * (
                np.arange(count, dtype=np.float64) - 0.5 * (count - 1)
            )
            # On the wall itself, nothing beyond it.
            parts.append(self._place(side, along, np.zeros(count)))
        return GhostParticles(*np.concatenate(parts, axis=1))

    def depth(self, h: float) -> int:
        """Layers of ghost cells of size `h`: as many as the potential reaches."""
        # Cells further out reach not even the first one of the domain.
        return math.ceil(self.shape.reach / h)

    def density(self, h: float) -> float:
        """Density of the ghost cells; "matched": density * depth * h = 1/(L N)."""
        if self.ghost_density == "paper":
            # As printed; see "Errata" on what comes of it.
            return 1.0 / h**2
        # Ghost particles of 1/N each, L apart, are 1/(L N) per length of the wall.
        return 1.0 / (self.length * self.particles * self.depth(h) * h)

    def ghost_cells(self, h: float) -> GhostCells:
        """The ghost cells that continue a grid of spacing `h` (the domain a multiple of h long).

        Every wall's block goes on beyond its ends by the same depth; so blocks overlap at corners.
        """
        depth = self.depth(h)
        parts = []
        for side in self.sides:
            low, high = self._extent(side)
            along: Array = low + h * (
                np.arange(-depth, round((high - low) / h) + depth, dtype=np.float64) + 0.5
            )
            beyond = h * (np.arange(depth) + 0.5)
            grid_along, grid_beyond = np.meshgrid(along, beyond)
            parts.append(self._place(side, grid_along.ravel(), grid_beyond.ravel()))
        x, y, angle = np.concatenate(parts, axis=1)
        return GhostCells(x, y, angle, np.full(x.shape, self.density(h)))

    def table(self, h: float) -> WallTable:
        """Force and torque of the ghost cells on a cell of a grid of spacing `h`."""
        # eps0 rho h^2 of one ghost cell.
        scale = self.strength_factor * self.strength * self.density(h) * h * h
        return tabulate_wall(self.sides, h, half_widths(self.shape, h), self.shape, scale)

    def _extent(self, side: SideName) -> Interval:
        return self.domain[1] if side in ("left", "right") else self.domain[0]

    def _place(self, side: SideName, along: Array, beyond: Array) -> Array:
        """(3, n) of x, y, angle for points `along` a wall and `beyond` it."""
        (left, right), (bottom, top) = self.domain
        angle = np.full(along.shape, 0.5 * np.pi if side in ("left", "right") else 0.0)
        places = {
            "left": (left - beyond, along),
            "right": (right + beyond, along),
            "bottom": (along, bottom - beyond),
            "top": (along, top + beyond),
        }
        return np.stack([*places[side], angle])

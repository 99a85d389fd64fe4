"""Interaction and walls at the present fields of a cell equation: by cell and angle, or by mean angle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.interaction import CurvedWalls, GridInteraction, WallTable
from ellipsoid_coupling.interaction.convolution.spectra import Real
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.interaction.q_grid import AngleForces, AngleGridInteraction

if TYPE_CHECKING:
    from ellipsoid_coupling.finite_volume.cells import CellFields

Floats = NDArray[np.float64]


@dataclass
class AngleGridForces:
    """Of all angles of a cell.

    Attributes
    ----------
    interaction : AngleGridInteraction or None
        Of the quantity that the stepper asks for.
    walls : AngleForces or None
        Of the walls on every cell; it does not change.
    """

    interaction: AngleGridInteraction | None
    walls: AngleForces | None
    _workspace: BufferPool = field(init=False, default_factory=BufferPool)

    def __call__(self, cells: CellFields) -> AngleForces | None:
        """At the present density; None without either. The next call overwrites them."""
        if self.interaction is None:
            return self.walls
        # Where mass is, the cells know already: no look for it.
        forces = self.interaction.forces(cells.inside[0], cells.extents)
        if self.walls is None:
            return forces
        parts = enumerate(zip(forces, self.walls, strict=True))
        return AngleForces(*(self._sum(f"force {k}", *both) for k, both in parts))

    def _sum(self, name: str, force: Real | None, wall: Real | None) -> Any:
        """Both, in the force's precision; None where there is no force."""
        if force is None or wall is None:
            return force
        out = self._workspace.array(name, force.shape, force.dtype)
        # Walls are in double precision, forces perhaps in single.
        return np.add(force, wall, out=out, casting="same_kind")


@dataclass
class MeanAngleForces:
    """Of a cell's mean angle, which is carried, or that of the start where nothing turns.

    Attributes
    ----------
    interaction : GridInteraction or None
    walls : WallTable, CurvedWalls or None
        None without interaction, too.
    start_angle : (ny, nx) float64
    """

    interaction: GridInteraction | None
    walls: WallTable | CurvedWalls | None
    start_angle: Floats

    def __call__(self, cells: CellFields) -> Forces | None:
        """At the present density and angle; None without interaction."""
        if self.interaction is None:
            return None
        # Loops over rows want them contiguous; the inside of padded fields is not.
        density = np.ascontiguousarray(cells.inside[0, 0])
        angle = self.mean_angle(cells)
        forces = self.interaction(density, angle)
        if self.walls is not None:
            self.walls.add_to(forces, density, angle)
        return forces

    def mean_angle(self, cells: CellFields) -> Floats:
        """Phi of every cell, (ny, nx); 0 in vacuum where it is carried."""
        carried = cells.system.carried_angle
        if not carried:
            return self.start_angle.copy()
        rho, content = cells.inside[0, 0], cells.inside[carried[0], 0]
        # Only where there is mass: 0/0 would be NaN, and so would be 0 times that.
        return np.asarray(np.divide(content, rho, out=np.zeros_like(rho), where=rho > 0.0))

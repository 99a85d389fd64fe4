"""One step of a q-equation: how transport, interaction and sources follow one another.

A stepper owns the order in which things happen; the fields stand in a `QSystem`. `largest_step`
counts the acceleration within the step in, so that no step turns out too long afterwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import KeptArrays
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.fluxes import AnyFlux, Ballistic, Force
from ellipsoid_coupling.finite_volume.fluxes.ballistic import bends_of_step, smooth_part
from ellipsoid_coupling.finite_volume.fluxes.contract import VACUUM
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move
from ellipsoid_coupling.finite_volume.q_grid import (
    QOMEGA,
    Extents,
    Q,
    QGrid,
    inside,
    occupied_extents,
)
from ellipsoid_coupling.finite_volume.q_sources import (
    Limits,
    Steps,
    kick_exactly,
    largest_step,
    shorter,
    step_implicitly,
)
from ellipsoid_coupling.finite_volume.q_transport import transport, transport_in_plane
from ellipsoid_coupling.geometry.ghost_table import GhostTable
from ellipsoid_coupling.interaction.convolution.kernel_spectra import Real
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import Quantity
from ellipsoid_coupling.interaction.q_grid import AngleForces, AngleGridInteraction
from ellipsoid_coupling.stepping.step_control import looking_ahead

Floats = NDArray[np.float64]


@dataclass
class QSystem:
    """The fields of a q-equation and everything that moves them.

    Attributes
    ----------
    grid : QGrid
    fields : (4 or 3, na + 4, ny + 4, nx + 4) float64
        q, q v_x, q v_y and, where something turns, q omega.
    terms : CellTerms
    axes : tuple of int
        The directions of transport: -1 (x), -2 (y) and, unless the angle is not resolved, -3.
    pressure : float
        1 for the Maxwellian closure, 0 for the mono-kinetic one.
    ghosts : GhostTable
        What happens at the ends of x and y.
    cfl : float
        The part of a cell that mass may cross in a step.
    interaction : AngleGridInteraction or None
        Of the quantity that the stepper asks for.
    walls : AngleForces or None
        Of the walls on every cell; it does not change.
    extents : (na, ny, 2) int64
        Outside them, all is vacuum.
    vacuum : float
        The density up to which a cell counts as empty.
    left : (1,) float64
        What has left through open boundaries, in units of a cell's density.
    time : float
        At the start of the step.
    room : KeptArrays
        Memory for forces with walls.
    """

    grid: QGrid
    fields: Floats
    terms: CellTerms
    axes: tuple[int, ...]
    pressure: float
    ghosts: GhostTable
    cfl: float
    interaction: AngleGridInteraction | None
    walls: AngleForces | None
    extents: Extents = field(init=False)
    vacuum: float = field(init=False)
    left: Floats = field(init=False)
    time: float = field(init=False, default=0.0)
    room: KeptArrays = field(init=False, default_factory=KeptArrays)

    def __post_init__(self) -> None:
        # The density that mass 1 has all over the grid, a small part of it.
        self.left = np.zeros(1)
        self.vacuum = VACUUM / (math.prod(self.grid.shape) * self.grid.volume)
        self.look_for_mass()

    def look_for_mass(self) -> None:
        """Set the extents to what holds mass now, wherever it is."""
        self.extents = occupied_extents(self.fields)

    def narrow_extents(self) -> None:
        """Set the extents to what holds mass now, all of which lies within them."""
        self.extents = occupied_extents(self.fields, self.extents)

    def transport(self, flux: AnyFlux, axis: int, dt: float) -> None:
        """Move all fields along an axis for dt; the extents grow with them."""
        ratio = dt / self.grid.width(axis)
        thin = flux._replace(vacuum=self.vacuum)
        here = self.fields, axis, ratio, self.extents, self.ghosts, self.time
        self.extents = transport(thin, *here, self.left)

    def transport_all(
        self, flux: AnyFlux, axes: tuple[int, ...], dt: float, turning: AnyFlux | None = None
    ) -> None:
        """Move all fields for dt along all `axes`, in this order; x and y stand side by side in it.

        turning : along the angle, where that is another flux
        """
        move = Move(axes.index(-1) < axes.index(-2), dt / self.grid.plane.cell, self.time)
        if axes[0] == -3:
            self.transport(turning or flux, -3, dt)
        thin = flux._replace(vacuum=self.vacuum)
        here = self.fields, move, self.extents, self.ghosts
        self.extents = transport_in_plane(thin, *here, self.left)
        if axes[-1] == -3:
            self.transport(turning or flux, -3, dt)

    def fly(self, axes: tuple[int, ...], dt: float) -> None:
        """`transport_all` without pressure: what is carried is v_x, v_y and, where it turns, omega."""
        v = bends_of_step(self.smooth_part(-1), self.grid.plane.cell, dt)
        if self.fields.shape[0] <= QOMEGA:
            self.transport_all(Ballistic((v.density, v.speed, v.speed)), axes, dt)
            return
        w = bends_of_step(self.smooth_part(-3), self.grid.angle_width, dt)
        plane = Ballistic((v.density, v.speed, v.speed, w.speed))
        turning = Ballistic((w.density, w.speed, v.speed, v.speed))
        self.transport_all(plane, axes, dt, turning)

    def smooth_part(self, axis: int) -> float:
        """What is a small part along an axis, by its resolution; see `fluxes.ballistic`."""
        return smooth_part(self.grid.angles if axis == -3 else max(self.grid.plane.shape))

    def forces(self) -> AngleForces | None:
        """Interaction and walls at the present density; None without either.

        The next call overwrites them.
        """
        if self.interaction is None:
            return self.walls
        forces = self.interaction.forces(inside(self.fields)[Q], self.extents)
        if self.walls is None:
            return forces
        parts = enumerate(zip(forces, self.walls, strict=True))
        return AngleForces(*(self._sum(f"force {k}", *both) for k, both in parts))

    def _sum(self, name: str, force: Real | None, wall: Real | None) -> Any:
        """Both, in the force's precision; None where there is no force."""
        if force is None or wall is None:
            return force
        out = self.room.array(name, force.shape, force.dtype)
        return np.add(force, wall, out=out, casting="same_kind")

    def limits(self) -> Limits:
        """For `largest_step`: a part `cfl` of a cell in each direction of transport."""
        widths = [self.cfl * self.grid.width(axis) for axis in self.axes]
        return Limits(np.array(widths), float(np.sqrt(self.pressure)))


class QStepper(Protocol):
    """One way to step a `QSystem`.

    `memory` is what a restart needs besides the fields, `forces` those of interaction and walls at
    the present density, where the stepper keeps them.
    """

    order: ClassVar[int]
    quantity: ClassVar[Quantity]
    memory: Floats
    forces: AngleForces | None

    def __init__(self, system: QSystem) -> None:
        """For this system, whose interaction is of `quantity`."""
        ...

    def prepare(self) -> None:
        """Set whatever follows from the fields; they are at the start or have been restored."""
        ...

    @property
    def largest_step(self) -> tuple[float, int]:
        """The step that the CFL number allows now, and its reason; 0 if not finite any more."""
        ...

    def step(self, dt: float, count: int) -> bool:
        """Step number `count` by dt, in place; False, with all as before, if it was too long."""
        ...


class _Forced:
    """What steppers share that keep the forces of the present density."""

    order: ClassVar[int]
    quantity: ClassVar[Quantity] = "forces"

    def __init__(self, system: QSystem) -> None:
        self._system = system
        self.forces: AngleForces | None = None
        self._allowed: Steps = (0.0, 0.0)
        self.memory = np.zeros(0)

    def prepare(self) -> None:
        """The forces of the present density, and the step that they allow."""
        system = self._system
        self.forces = system.forces()
        self._allowed = largest_step(
            system.fields, system.extents, system.terms, self.forces, self._limits
        )

    @property
    def _limits(self) -> Limits:
        """A second-order scheme looks ahead, see `step_control.looking_ahead`."""
        system, limits = self._system, self._system.limits()
        if self.order < 2:
            return limits
        grid, shape = system.grid, system.grid.shape
        far = [
            looking_ahead(grid.width(k), shape[k] if k == -3 else max(shape[-2:]))
            for k in system.axes
        ]
        return limits._replace(ahead=np.maximum(limits.distances, far))

    @property
    def largest_step(self) -> tuple[float, int]:
        """From the fastest cell, accelerated by half a step."""
        return shorter(self._allowed)


class Godunov(_Forced):
    """Scheme `paper`: FORCE in x, y and angle, implicit Euler for the sources; first order."""

    order: ClassVar[int] = 1

    def step(self, dt: float, count: int) -> bool:
        """Transport, then sources at the new density; never refused."""
        del count
        system = self._system
        system.transport_all(Force(system.pressure), system.axes, dt)
        system.narrow_extents()
        self.forces = system.forces()
        here = system.fields, system.extents, system.terms, self.forces
        self._allowed = step_implicitly(*here, dt, self._limits)
        return True


class KickDriftKick(_Forced):
    """Scheme `accurate`, mono-kinetic: exact kicks of half a step about a ballistic flight.

    Velocities change while mass stands still and the other way round, so that one evaluation of the
    interaction a step suffices, at the end of the flight. Second order.
    """

    order: ClassVar[int] = 2

    def step(self, dt: float, count: int) -> bool:
        """Directions change order from step to step (`count`), so that none is preferred.

        Never refused: the allowed step counts the acceleration in, and flights empty no cell.
        """
        system = self._system
        kick_exactly(system.fields, system.extents, system.terms, self.forces, 0.5 * dt)
        axes = system.axes if count % 2 == 0 else system.axes[::-1]
        system.fly(axes, dt)
        system.narrow_extents()
        self.forces = system.forces()
        here = system.fields, system.extents, system.terms, self.forces
        self._allowed = kick_exactly(*here, 0.5 * dt, self._limits)
        return True

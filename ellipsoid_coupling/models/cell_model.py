"""What every equation on cells shares: time, steps, failure, checkpoints, mass, what is told of a run.

A model derives from `CellModel`, names itself, makes its `CellFields` and says what its snapshot, its worst
cell and its warnings are. Which stepper steps it follows from what its `System` declares.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.crossing import CrossingDetector
from ellipsoid_coupling.finite_volume.diagnostics import survey_cells
from ellipsoid_coupling.finite_volume.fluxes import FluxMaker, flux_named
from ellipsoid_coupling.finite_volume.q_grid import QGrid
from ellipsoid_coupling.finite_volume.splitting import (
    Godunov,
    KickDriftKick,
    OverdampedEuler,
    OverdampedHeun,
    Stepper,
)
from ellipsoid_coupling.finite_volume.system import DENSITY, System
from ellipsoid_coupling.finite_volume.well_balanced import WellBalancedHeun
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup, listed
from ellipsoid_coupling.models.failure_site import FailureSite
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.models.run_warnings import as_counts, of_crossing, of_start, of_tilted_walls
from ellipsoid_coupling.models.schemes import SchemeName
from ellipsoid_coupling.stepping.status import MEANING, RUNNING
from ellipsoid_coupling.stepping.step_control import (
    CFL_LIMIT,
    STEPS,
    TIME,
    Aside,
    advance_by_limits,
    new_clock,
    step_log,
)

Floats = NDArray[np.float64]

# Of each scheme's, at most one fits a system; see `Stepper.fits`.
STEPPERS: dict[SchemeName, tuple[type[Stepper], ...]] = {
    "paper": (Godunov, OverdampedEuler),
    "accurate": (KickDriftKick, WellBalancedHeun, OverdampedHeun),
}


def stepper_of(system: System, setup: Setup, angle_resolved: bool) -> type[Stepper]:
    """What steps a system in a scheme, on a grid whose angle is an axis or carried.

    Raises
    ------
    InputError
        If the scheme has nothing for such a system.
    """
    fit = {
        scheme: stepper
        for scheme, steppers in STEPPERS.items()
        for stepper in steppers
        if stepper.fits(system, angle_resolved)
    }
    if setup.scheme not in fit:
        raise InputError(
            f"scene {setup.scene.name}, --scheme",
            f"one that steps this model's equations: {', '.join(fit) or 'there is none'}",
            repr(setup.scheme),
            "Choose another scheme." if fit else "Choose another model.",
        )
    return fit[setup.scheme]


def flux_of(system: System, setup: Setup, angle_resolved: bool) -> FluxMaker:
    """The flux that the scene names, or the scheme's own.

    Raises
    ------
    InputError
        For a scheme that does not fit, or a flux that does not exist or does not fit.
    """
    stepper = stepper_of(system, setup, angle_resolved)
    chosen = setup.scene.numerics.flux
    where = f"scene {setup.scene.name}, key numerics.flux"
    return flux_named(chosen or stepper.flux, system.pressure, stepper.balances, where)


class CellModel(ABC):
    """A `Model` but for its names, its system, and what it shows.

    Attributes
    ----------
    cells : CellFields
    stepper : Stepper
    clock : (1, CLOCK_COLUMNS) float64
        See `stepping.step_control`.
    """

    kinds: ClassVar[tuple[ModelKind, ...]]
    steps_per_call: int = 16

    def __init__(self, name: str, setup: Setup, cells: CellFields) -> None:
        self.name = name
        self._setup = setup
        self.cells = cells
        how = cells.system, setup, cells.grid.angle_resolved
        self.stepper = stepper_of(*how)(cells, flux_of(*how))
        self.stepper.start()
        self.clock = new_clock(1, np.inf, CFL_LIMIT)
        self.aside = Aside()
        single = cells.system.single_stream
        self._crossing = CrossingDetector(cells.terms.damping) if single else None
        self._mass_start = cells.mass

    @classmethod
    def start_values(cls, setup: Setup, density: Floats) -> Mapping[str, Floats]:
        """Further components of the system at the start, per mass, by name; what is not named is 0.

        density : (na, ny, nx) float64, at the start; 0 in vacuum. Values have this shape or spread to it.
        """
        del setup, density
        return {}

    def per_mass(self, name: str) -> Floats:
        """A component of the system, other than the density, over the density; 0 in vacuum.

        Of the shape of a snapshot: (na, ny, nx) of a q-equation, (ny, nx) of a rho-equation.
        """
        return self._advected(self.cells.system.place(name))

    @abstractmethod
    def _advected(self, component: int) -> Floats:
        """A component over the density, of the shape of a snapshot."""

    @property
    def grid(self) -> QGrid:
        """Of the cells."""
        return self.cells.grid

    @property
    def time(self) -> float:
        """The time reached."""
        return float(self.clock[0, TIME])

    @property
    def end(self) -> float:
        """The last save time, or an earlier one at which the flow is given: steps end there."""
        flow, last = self._setup.flow, float(self._setup.scene.times[-1])
        return last if flow is None else min(last, flow.until)

    def advance(self, until: float) -> None:
        """Some steps, as long as the CFL number allows; one that turns out too long is repeated."""
        status = advance_by_limits(self, until, self.steps_per_call)
        if status != RUNNING:
            raise self._failure(status)

    def allowed_step(self) -> tuple[float, int]:
        """What the CFL number, the force and the torque allow."""
        cells = self.cells
        inflow = cells.ghosts.kinds.inflow_step(cells.cfl * cells.grid.plane.cell)
        allowed = min(self.stepper.largest_step, (inflow, CFL_LIMIT))
        return allowed if cells.lines is None else min(allowed, (cells.fluid_step, CFL_LIMIT))

    def try_step(self, dt: float, after: float) -> bool:
        """Step by dt to `after`; False, with all as before, if the stepper finds that it was too long."""
        self.cells.begin_step(self.time, after)
        if not self.stepper.step(dt, int(self.clock[0, STEPS])):
            return False
        if self._crossing is not None:
            cells, now = self.cells, after
            planes = cells.fields if cells.grid.angle_resolved else cells.fields[:, 0]
            self._crossing.look(planes, cells.grid.plane.cell, now, cells.extents)
        return True

    def _failure(self, status: int) -> RunError:
        what, remedy = MEANING[status]
        return RunError(
            f"{self._setup.scene.name}, {self.name}, t = {self.time:.6g}, "
            f"step {int(self.clock[0, STEPS])}: {what}. {self.failure_site()} {remedy}"
        )

    @abstractmethod
    def failure_site(self) -> FailureSite:
        """Where something is strongest, and by which term."""

    def state(self) -> Arrays:
        """What `live` has, of what the run goes on from; see `Aside`."""
        return self.live() if self.aside.arrays is None else self.aside.arrays

    def live(self) -> Arrays:
        """Fields, clock, outflow, and what stepper and detector remember, as they are now."""
        arrays: dict[str, NDArray[Any]] = {
            "fields": self.cells.fields,
            "clock": self.clock,
            "outflow": self.cells.outflow,
            "memory": self.stepper.memory,
        }
        if self.cells.keeps_drift:
            arrays["drift"] = self.cells.drift
        if self._crossing is not None:
            arrays["crossing"] = self._crossing.memory
        return arrays

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        self.aside = Aside()
        current = self.live()
        for name, array in state.items():
            current[name][...] = array
        self.cells.look_for_mass()
        self.cells.begin_step(self.time, self.time)
        self.stepper.restore()

    def health(self) -> Health:
        """Mass, least density, speeds, and bounds of the forces."""
        cells = self.cells
        planes = cells.fields if cells.grid.angle_resolved else cells.fields[:, 0]
        mass, least, speeds = survey_cells(planes)
        # Pressure drives as well.
        known = cells.system.pressure == 0.0
        bounds = self._force_bounds() if known else (math.inf, math.inf)
        return Health(mass * cells.grid.volume, least, speeds, bounds, left=cells.mass_left)

    @abstractmethod
    def _force_bounds(self) -> tuple[float, float]:
        """Of the drift, per mass and per inertia, where there is no pressure."""

    def counts(self) -> Counts:
        """The steps, the mass balance, by patch where there are any, crossed characteristics, warnings."""
        crossing = {} if self._crossing is None else self._crossing.counts()
        mass = {
            "mass_start": self._mass_start,
            "mass_end": self.cells.mass,
            "mass_left": self.cells.mass_left,
        }
        left = self.cells.left_by_boundary
        by_patch = {"mass_left_by_patch": listed(left)} if left else {}
        return step_log(self.clock) | crossing | mass | by_patch | as_counts(self.warnings())

    def warnings(self) -> list[str]:
        """Sentences for `Result.warnings`."""
        crossing = [] if self._crossing is None else of_crossing(self._crossing.time)
        lines = self.cells.lines
        if lines is None or lines.walls is None:
            return of_start(self._setup.scene) + crossing
        density = self.cells.fields[self.cells.system.place(DENSITY)]
        crowd = lines.walls.crowd(density, lines.inside)
        return of_start(self._setup.scene) + crossing + of_tilted_walls(*crowd, lines.slides)

"""How transport, interaction and sources follow one another within a step of a cell equation.

A stepper owns the order in which things happen; fields and operations are those of `CellFields`. What it
transports with is an argument, so that any flux of the fitting kind will do. Where velocities are
unknowns:

    Godunov          transport, then an implicit Euler step of the sources        first order
    KickDriftKick    half a kick, flight, interaction, half a kick                second order

Where they are slaved to the drift (the diffusive limit `eq:difflimit`), drag and drift balance at every
moment, v = F/Gamma and omega = F_bar/Gamma_bar:

    OverdampedEuler  transport at the drift velocity, implicit Euler for the angle   first order
    OverdampedHeun   Heun's rule along the particles' ways                           second order

The scheme of second order for closures with pressure is `well_balanced.py`.
"""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import scale
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.fluxes import FluxMaker
from ellipsoid_coupling.finite_volume.implicit_turn import turn_implicitly
from ellipsoid_coupling.finite_volume.kick import Kick, drift_velocity, exact_kick, implicit_kick
from ellipsoid_coupling.finite_volume.step_limits import Allowed, extremes_of
from ellipsoid_coupling.finite_volume.system import System
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import Quantity
from ellipsoid_coupling.stepping.step_control import CFL_LIMIT

Floats = NDArray[np.float64]

# Heun's corrector may move mass by this part of a cell and turn it by this part of a radian; more
# means that the drift changes within a step by as much as it is.
_LARGEST_CORRECTION = 0.25


class Stepper(Protocol):
    """One way to step `CellFields`.

    order : of the scheme; quantity : of the interaction that it asks for; flux : the name of its own
    flux, where a scene names none; balances : whether it gives the forces' work to its flux;
    memory : what a restart needs besides fields and drift.
    """

    order: ClassVar[int]
    quantity: ClassVar[Quantity]
    flux: ClassVar[str]
    balances: ClassVar[bool]
    memory: Floats

    @staticmethod
    def fits(system: System, angle_resolved: bool) -> bool:
        """Whether it steps such a system, whose angle is an axis or is carried."""
        ...

    def __init__(self, cells: CellFields, make_flux: FluxMaker) -> None:
        """For these cells, whose interaction is of `quantity`."""
        ...

    def start(self) -> None:
        """Set whatever follows from the fields; they are at the start."""
        ...

    def restore(self) -> None:
        """Set whatever follows from fields, drift and memory, which have been restored."""
        ...

    @property
    def largest_step(self) -> Allowed:
        """The step that the CFL number allows now, and its reason; 0 if not finite any more."""
        ...

    def step(self, dt: float, count: int) -> bool:
        """Step number `count` by dt, in place; False, with all as before, if it was too long."""
        ...


class _Split:
    """What these steppers share: forces at the present density, and the step that they allow."""

    order: ClassVar[int]
    quantity: ClassVar[Quantity] = "forces"
    balances: ClassVar[bool] = False

    def __init__(self, cells: CellFields, make_flux: FluxMaker) -> None:
        self._cells, self._make_flux = cells, make_flux
        self._velocities = len(cells.system.velocities)
        self._limit = cells.limit(self.order)
        self._allowed: Allowed = (0.0, CFL_LIMIT)
        # Fields and drift are all that a restart needs here.
        self.memory = np.zeros(0)

    def start(self) -> None:
        """The forces of the present density, the drift, and the step that they allow."""
        self._cells.update_forces()
        self._meet_forces(None)

    def restore(self) -> None:
        """The step that the velocities allow, in the drift as it was kept or else in new forces."""
        if self._cells.keeps_drift:
            self._allowed = self._cells.allowed(self._limit)
        else:
            self.start()

    @property
    def largest_step(self) -> Allowed:
        """From the fastest cell, its acceleration counted in."""
        return self._allowed

    def _meet_forces(self, change: Kick | None) -> Floats:
        """Evaluate the drift at new forces, kick, and find what step the new velocities allow."""
        peaks = self._cells.treat(self._limit, change, fresh=True, limits=True)
        self._allowed = self._limit.allowed(peaks)
        return peaks


class Godunov(_Split):
    """Scheme `paper`: FORCE in x, y and angle, implicit Euler for the sources; first order."""

    order: ClassVar[int] = 1
    flux: ClassVar[str] = "force"

    @staticmethod
    def fits(system: System, angle_resolved: bool) -> bool:
        """For any pressure."""
        del angle_resolved
        return not system.slaved

    def step(self, dt: float, count: int) -> bool:
        """Transport, then sources at the new density; never refused."""
        del count
        cells = self._cells
        cells.transport_all(self._make_flux, cells.axes, dt)
        cells.narrow_extents()
        cells.update_forces()
        # Before the next step is chosen: the speed of sound may have changed.
        cells.react(dt)
        # The torque counts at the old angle here; the implicit turn adds its change.
        change = implicit_kick(cells.terms, dt, self._velocities)
        self._meet_forces(change)
        if cells.system.carried_angle:
            turn_implicitly(cells.cells, cells.terms, change.gain[-1], dt)
        return True


class KickDriftKick(_Split):
    """Scheme `accurate` without pressure: exact kicks of half a step about a ballistic flight.

    Velocities change while place and angle stand still and the other way round, so that one evaluation
    of the interaction a step suffices, at the end of the flight. Second order.
    """

    order: ClassVar[int] = 2
    flux: ClassVar[str] = "ballistic"

    @staticmethod
    def fits(system: System, angle_resolved: bool) -> bool:
        """Where flights are straight: no pressure bends them."""
        del angle_resolved
        return system.single_stream

    def restore(self) -> None:
        """As at the start: velocities change after the drift is evaluated, place and angle do not."""
        self.start()

    def step(self, dt: float, count: int) -> bool:
        """Directions change order from step to step (`count`), so that none is preferred.

        Never refused: the allowed step counts the acceleration in, and flights empty no cell.
        """
        cells, half = self._cells, 0.5 * dt
        change = exact_kick(cells.terms, half, self._velocities)
        axes = cells.axes if count % 2 == 0 else cells.axes[::-1]
        # Half a kick and half a turn in one pass over memory.
        cells.treat(self._limit, change, half)
        cells.react(half)
        cells.transport_all(self._make_flux, axes, dt)
        # The other half of the turn, so that the interaction finds place and angle of the step's end.
        cells.turn(self._limit, half)
        cells.react(half)
        # Mass is where the flight has ended: the interaction need not look elsewhere.
        cells.narrow_extents()
        cells.update_forces()
        self._meet_forces(change)
        return True


class _Overdamped(_Split):
    """What both schemes share whose velocities follow from the drift at once."""

    @staticmethod
    def fits(system: System, angle_resolved: bool) -> bool:
        """The drift velocity is all that moves mass, so there is no pressure."""
        del angle_resolved
        return system.slaved and system.pressure == 0.0

    def __init__(self, cells: CellFields, make_flux: FluxMaker) -> None:
        super().__init__(cells, make_flux)
        # Drag is constant: one kick for all steps.
        self._settled = drift_velocity(cells.terms, self._velocities)

    def start(self) -> None:
        """The drift, and the velocity that follows from it."""
        self._cells.update_forces()
        self._meet_forces(self._settled)


class OverdampedEuler(_Overdamped):
    """Scheme `paper`: FORCE in x, FORCE in y, implicit Euler for the angle; first order."""

    order: ClassVar[int] = 1
    flux: ClassVar[str] = "force"

    def step(self, dt: float, count: int) -> bool:
        """Always accepted: transport uses the velocities that the step was chosen for."""
        del count
        cells = self._cells
        cells.transport_all(self._make_flux, cells.axes, dt)
        cells.update_forces()
        self._meet_forces(self._settled)
        if cells.system.carried_angle:
            turn_implicitly(cells.cells, cells.terms, self._settled.gain[-1], dt)
            # The implicit turn has left its own rate; velocities are those of the drift.
            cells.treat(self._limit, self._settled)
        return True


class OverdampedHeun(_Overdamped):
    """Scheme `accurate`: Heun's rule along the particles' ways; second order.

    A flight at the starting drift velocity, carried along with the mass, is followed by a short one
    that makes up for its change on the way,

        r_{n+1} = r_n + dt v_n + dt/2 (v* - v_n),        v* = F/Gamma at the first flight's end

    and the same for the angle. Both are ballistic, hence exact for the piecewise linear state. Between
    directions the mass keeps the velocity that it started with, so that a flight along x and then y is
    the same straight way as both at once. On a staircase it takes that of the new place instead, x and y
    changing order: then v* - v_n is the change by the forces alone.
    """

    order: ClassVar[int] = 2
    flux: ClassVar[str] = "ballistic"

    def __init__(self, cells: CellFields, make_flux: FluxMaker) -> None:
        super().__init__(cells, make_flux)
        # A kick that makes (v* - v_n)/2 of v_n, with v* = gain F.
        self._correction = Kick(
            tuple(-0.5 for _ in self._settled.gain), scale(0.5, self._settled.gain)
        )
        # What a refused step gives back; new arrays in every step would cost as much as a sweep.
        self._before = [np.empty_like(array) for array in self._stepped]

    @property
    def _stepped(self) -> tuple[Floats, ...]:
        return self._cells.fields, self._cells.drift, self._cells.outflow

    def step(self, dt: float, count: int) -> bool:
        """Refused if the correction is not small. Directions take turns (`count`)."""
        cells = self._cells
        for kept, array in zip(self._before, self._stepped, strict=True):
            np.copyto(kept, array)
        axes = cells.axes if count % 2 == 0 else cells.axes[::-1]
        self._fly(dt, axes)
        cells.update_forces()
        # v* is of the forces where the first flight has led.
        correction = extremes_of(
            cells.treat(self._limit, self._correction, fresh=True, limits=True)
        )
        # `not <=`: a correction that is no number is refused as well.
        if not max(correction.speed / cells.grid.plane.cell, correction.spin) * dt <= (
            _LARGEST_CORRECTION
        ):
            for kept, array in zip(self._before, self._stepped, strict=True):
                np.copyto(array, kept)
            return False
        # The short flight carries nothing in: what comes in has come with the first one.
        self._fly(dt, axes[::-1], drifts=False)
        cells.update_forces()
        self._meet_forces(self._settled)
        return True

    def _fly(self, dt: float, axes: tuple[int, ...], drifts: bool = True) -> None:
        """Turn and fly; on a staircase not on at the velocity of the start, see `CellFields`."""
        cells = self._cells
        cells.turn(self._limit, dt)
        cells.transport_all(self._make_flux, axes, dt, drifts)
        if cells.lines is not None and drifts:
            # What makes up for the change on the way, and in the fluid, has been flown; that of the forces
            # is left.
            cells.set_terms(cells.after)
            cells.treat(self._limit, cells.drift_in_plane(), fresh=True)

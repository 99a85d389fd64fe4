"""Scheme `accurate` for the Maxwellian closure: balanced, positive, second order.

One direction at a time, with its flux, its force and the damping of its own momentum m,

    d_t q + d_x m = 0,   d_t m + d_x(m v + q) = q F - Gamma m,   d_t(q a) + d_x(m a) = 0

Equilibria are kept exactly. The force acts through the work g that it does from cell centre to cell
centre; at rest q_{i+1} = q_i e^g. The kinetic flux (fluxes/kinetic.py) then has the pressure
q_i e^{g/2} at a face, and the source takes the difference of the two faces' pressures,

    dt S = dt/h q_i (e^{g_up/2} - e^{-g_down/2}) c(s)/c(g)

c makes it the force on the cell's mean density, sinh(s/2)/(s/2) q_i, where the profile's
logarithmic slope s is not the equilibrium's: by Simpson's rule, c = 2 + (both faces' q)/(2 q_i).

The work of a potential is its difference: that of -(V1 + V2 + U * q) between the centres, so that
the state at rest is q = exp(-V1 - V2 - U * q)/Z on the very cells.

In time, Heun's method, with the damping integrated exactly (Cox and Matthews' ETD2RK for m), which
keeps the drift m = R/Gamma of strong damping. The potential U * q is that of the density half a
step ahead, q - dt/2 div m; a flow that changes has that of the step's start and of its end, one a stage.
Directions change order from step to step. The source and both stages of a
step are kernels of `well_balanced_stages.py`.
"""

from __future__ import annotations

import math
from typing import ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.finite_volume.balanced_lines import (
    Balance,
    LineForces,
    balance_lines,
    lose_ahead,
    no_line_work,
    set_line_work,
)
from ellipsoid_coupling.finite_volume.boundary import fill_ghosts, fill_periodic
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.cell_forces import AngleGridForces
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.fluxes import FluxMaker
from ellipsoid_coupling.finite_volume.fluxes.contract import Flux, in_order
from ellipsoid_coupling.finite_volume.fluxes.kinetic import SIGNAL, Limits
from ellipsoid_coupling.finite_volume.hydrostatic_reconstruction import (
    PASSES,
    STOPS,
    WORK_AT,
    WRAPS,
    set_ahead,
    set_work,
)
from ellipsoid_coupling.finite_volume.kick import dampings, exact_kick
from ellipsoid_coupling.finite_volume.line_sweep import LineFields, line_fields
from ellipsoid_coupling.finite_volume.q_grid import NORMAL, Q
from ellipsoid_coupling.finite_volume.sources import Work, acceleration, treat
from ellipsoid_coupling.finite_volume.step_limits import CellwiseLimit, shorter
from ellipsoid_coupling.finite_volume.system import System
from ellipsoid_coupling.finite_volume.well_balanced_stages import (
    Stage,
    combine,
    exponential_weights,
    push,
)
from ellipsoid_coupling.geometry.boundaries import at_side
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import Quantity
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.angular import angular_energy
from ellipsoid_coupling.scenes.kinds import Record
from ellipsoid_coupling.stepping.step_control import CFL_LIMIT

Floats = NDArray[np.float64]

# A step was too long if the state after it allows less than this part of it.
_SHORTEST_NEXT = 0.25


class WellBalancedHeun:
    """Steps `CellFields` with pressure 1 and forces by angle, as above."""

    order: ClassVar[int] = 2
    quantity: ClassVar[Quantity] = "potential"
    flux: ClassVar[str] = "kinetic"
    balances: ClassVar[bool] = True

    @staticmethod
    def fits(system: System, angle_resolved: bool) -> bool:
        """For the unit Gaussian that the kinetic flux knows, and forces by angle."""
        return system.pressure == 1.0 and angle_resolved and not system.slaved

    def __init__(self, system: CellFields, make_flux: FluxMaker) -> None:
        self._system, self._make_flux = system, make_flux
        # Pressure is a q-equation's, whose forces these are.
        self._forces = cast(AngleGridForces, system.find_forces)
        # SIGNAL stands for the speed of sound, so that the pressure adds none of its own.
        self._limit = system.cellwise_limit(1)._replace(sound=SIGNAL, damped=True, pressure=0.0)
        # By time: of a flow that changes, those of a step's start and end.
        self._steady = {system.time: self._steady_forces()}
        # The strongest pull of the interaction in each direction, as of the last step.
        self.memory = np.zeros(3)
        self._allowed = (0.0, CFL_LIMIT)
        # Fields before a step and before a direction; density and momentum after its first stage.
        self._start, self._before = np.empty((2, *system.fields.shape))
        self._middle = np.empty((2, *system.fields.shape[1:]))
        # Tilt and rest along each axis, where there is no work 1 and 0.
        self._works = {axis: self._no_work(axis) for axis in system.axes}
        # On a staircase in a flow that changes, also those of the step's end.
        moves = system.moving_lines is not None
        self._works_after = (
            {axis: self._no_work(axis) for axis in (-1, -2)} if moves else self._works
        )

    def _no_work(self, axis: int) -> Floats:
        """Of the fields' cells, or of those of the lines along an axis of a staircase."""
        if self._system.lines is not None and axis != -3:
            return no_line_work(self._lines_along(axis))
        cells = self._system.fields[Q].size
        return np.array([np.ones(cells), np.zeros(cells)])

    def start(self) -> None:
        """The pull of the interaction at the present density, where no step has told it yet."""
        # A pull is a magnitude, whatever a checkpoint from elsewhere says.
        np.abs(self.memory, out=self.memory)
        if not self.memory.any():
            self._note_pull(self._potential(0.0))
        self._allowed = self._find_largest_step()

    def restore(self) -> None:
        """As at the start, but for the pull, which has been restored."""
        self.start()

    @property
    def largest_step(self) -> tuple[float, int]:
        """From the fastest signal, the forces within the step included."""
        return self._allowed

    def _find_largest_step(self) -> tuple[float, int]:
        system = self._system
        # Without the interaction, whose pull `memory` has.
        force = acceleration(system.terms, self._forces.walls)
        look = _look(system.terms, len(system.system.velocities), limits=True)
        peaks = treat(system.cells, force, look, self._limit)
        shortest = self._limit.steps(peaks)
        # x and y have one step, the angle has its own.
        steps = [shortest[0], shortest[0], shortest[1]]
        rates = dampings(system.terms, 3)
        for d, distance in enumerate(self._limit.distances[: len(system.axes)]):
            # dt (distance/step + pull dt/2) = distance, which no cell exceeds; or, where damping
            # holds velocities, dt (distance/step + pull/Gamma) = distance.
            speed = distance / steps[d] if steps[d] > 0.0 else np.inf
            pull, damping = float(self.memory[d]), rates[d]
            root = speed + math.hypot(speed, math.sqrt(2.0 * pull * distance))
            held = speed + (pull / damping if damping > 0.0 else np.inf)
            shortened = 2.0 * distance / root if root > 0.0 else np.inf
            # Either bound suffices, so that the longer step is allowed.
            steps[d] = max(shortened, distance / held) if held > 0.0 else shortened
        return shorter((min(steps[:2]), steps[2]))

    def _steady_forces(self) -> Floats:
        return _steady_forces(self._system, self._forces.walls, self._limit)

    def _steady_of_step(self) -> tuple[Floats, Floats]:
        """The forces without interaction at the start of a step and at its end; `terms` are left there."""
        system = self._system
        if system.tables is None:
            (steady,) = self._steady.values()
            return steady, steady
        known, self._steady = self._steady, {}
        for t in (system.time, system.after):
            system.set_terms(t)
            # Most often the start of a step is the end of the one before.
            self._steady[t] = known[t] if t in known else self._steady_forces()
        return self._steady[system.time], self._steady[system.after]

    def step(self, dt: float, count: int) -> bool:
        """See the module; the step is refused if the new state allows less than a quarter of it.

        This happens when the first stage nearly empties a cell whose momentum the second stage uses.
        """
        system = self._system
        # Extents are replaced by each sweep and not written to: no copy of them.
        kept = system.outflow.copy(), self.memory.copy(), system.extents
        potential, steady = self._potential(0.5 * dt), self._steady_of_step()
        self._note_pull(potential)
        axes = system.axes
        # Reversed order every second step: the splitting is second order over two steps.
        order = axes if count % 2 == 0 else axes[::-1]
        for axis in order:
            if system.lines is not None and axis != -3:
                if axis == order[0]:
                    _copy(system.fields, self._start)
                self._step_lines(axis, steady, potential, dt)
                continue
            self._fill(axis)
            # Before the first direction both are the same: one copy does.
            before = self._start if axis == order[0] else self._before
            _copy(system.fields, before)
            self._step_along(axis, steady, potential, before, dt)
        system.narrow_extents()
        allowed = self._find_largest_step()
        if allowed[0] >= _SHORTEST_NEXT * dt:
            self._allowed = allowed
            return True
        _copy(self._start, system.fields)
        system.outflow[:], self.memory[:], system.extents = kept
        return False

    def _potential(self, ahead: float) -> Floats | None:
        """U * q, (n, ny, nx), of the density `ahead` of now; None without interaction."""
        system = self._system
        if self._forces.interaction is None:
            return None
        density = system.inside[Q]
        if ahead:
            # Solids, and what bounds them, are seen by lines alone.
            flat = [axis for axis in system.axes if system.lines is None or axis == -3]
            for axis in flat:
                self._fill(axis)
            # Central differences reach over two cells, hence one half.
            factors = {axis: 0.5 * ahead / system.grid.width(axis) for axis in system.axes}
            density = np.empty(system.grid.shape)
            np.copyto(density, system.inside[Q])
            # These overwrite the density, lines then subtract from it.
            if flat:
                numbers = tuple(factors[axis] for axis in flat)
                set_ahead(system.fields, tuple(flat), numbers, density)
            for axis in set(system.axes) - set(flat):
                lose_ahead(self._lines_along(axis), factors[axis], density)
        return np.asarray(self._forces.interaction.potential(density), np.float64)

    def _fill(self, axis: int) -> None:
        system = self._system
        if axis == -3:
            fill_periodic(system.fields, 1)
        else:
            fill_ghosts(system.fields, axis, system.ghosts, system.time)

    def _ends(self, axis: int) -> tuple[int, int]:
        """What the ends of an axis do with the work, see `set_work`."""
        if axis == -3:
            return WRAPS, WRAPS
        low, high = (WORK_AT[at_side(kind)] for kind in self._system.ghosts.kinds.ends(axis))
        if not self._system.terms.in_fluid:
            low, high = (STOPS if end == PASSES else end for end in (low, high))
        return low, high

    def _weight(self, axis: int) -> float:
        terms = self._system.terms
        return terms.inverse_inertia if axis == -3 else terms.inverse_mass

    def _note_pull(self, potential: Floats | None) -> None:
        if potential is None:
            return
        for d, axis in enumerate(self._system.axes):
            # From the last cell to the first one only where the axis is periodic.
            closed = potential
            if self._ends(axis)[0] == WRAPS:
                first = np.take(potential, [0], axis)
                closed = np.concatenate((potential, first), axis)
            # The force between two cells is the potential's difference over their distance.
            rise = np.abs(np.diff(closed, axis=axis)).max(initial=0.0)
            self.memory[d] = self._weight(axis) * rise / self._system.grid.width(axis)

    def _step_lines(
        self, axis: int, steady: tuple[Floats, Floats], potential: Floats | None, dt: float
    ) -> None:
        """Both stages along x or y of a staircase."""
        system, lines = self._system, self._system.lines
        assert lines is not None
        whole = self._lines_along(axis)
        planes, ny, nx = system.grid.shape
        kinds = np.array([at_side(kind) == "reflect" for kind in lines.kinds])
        distinct, there = (1, ()) if potential is None else (potential.shape[0], (0,))
        # Twice the same array, unless the flow changes.
        works = self._works[axis], self._works_after[axis]
        fluxes: list[Flux] = []
        for force, work in zip(steady, works, strict=True):
            forces = LineForces(
                force[-1 - axis], potential, (planes, distinct), there, whole.lines.rows,
                (ny * nx, nx, 1) if axis == -1 else (ny * nx, 1, nx), kinds[whole.lines.kind],
                (0.5 * system.grid.width(axis), self._weight(axis)),
            )  # fmt: skip
            # In a steady flow both stages have one array, which is set once.
            if not fluxes or work is not works[0]:
                set_line_work(forces, whole, work)
            fluxes.append(self._make_flux(system.transported(axis, dt)._replace(tilt=work[0])))
        limits = Limits(system.smooth_part(axis), system.vacuum)
        balance = Balance(works, limits, self._stage(axis, dt))
        system.outflow += balance_lines((fluxes[0], fluxes[1]), whole, balance, system.outflow.size)
        system.extents = system.swept_extents(axis)

    def _lines_along(self, axis: int) -> LineFields:
        system = self._system
        assert system.lines is not None
        width = system.grid.angle_width
        return line_fields(system.fields, axis, system.lines, width, system.time, by_plane=True)

    def _stage(self, axis: int, dt: float) -> Stage:
        terms = self._system.terms
        rate = terms.angular_damping if axis == -3 else terms.damping
        return Stage(dt / self._system.grid.width(axis), *exponential_weights(rate, dt))

    def _step_along(
        self,
        axis: int,
        steady: tuple[Floats, Floats],
        potential: Floats | None,
        before: Floats,
        dt: float,
    ) -> None:
        """Both stages along an axis, from the fields as they are, of which `before` is a copy."""
        system, work, middle = self._system, self._works[axis], self._middle
        weights = 0.5 * system.grid.width(axis), self._weight(axis)
        shared = potential, axis, self._ends(axis), weights, work
        set_work(steady[0][-1 - axis], *shared)
        flux = self._make_flux(system.transported(axis, dt)._replace(tilt=work[0]))
        stage = self._stage(axis, dt)
        normal = NORMAL[axis]
        stride = math.prod(system.grid.padded[3 + axis + 1 :])
        # Of this direction alone: others have been counted in full.
        before_stages = system.outflow.copy()
        system.transport(flux, axis, dt)
        source = work, Limits(system.smooth_part(axis), system.vacuum)
        push(system.fields, before, system.extents, *source, (normal, stride), stage)
        self._fill(axis)
        # The second stage's source needs density and momentum as the first stage has left them,
        # ghosts included.
        _copy(system.fields, middle, (Q, normal))
        # In a flow that changes the second stage has the forces of the step's end.
        if steady[1] is not steady[0]:
            set_work(steady[1][-1 - axis], *shared)
        system.transport(flux, axis, dt)
        # Both stages' transports count half, here as in `combine`.
        system.outflow[:] = 0.5 * (before_stages + system.outflow)
        components = in_order(system.fields.shape[0], normal)
        states = system.fields, before, middle
        combine(states, system.extents, *source, components, stride, stage)


def _copy(source: Floats, target: Floats, which: tuple[int, ...] | None = None) -> None:
    """All components or some, one at a time, by all threads: memory is faster than one of them."""
    parts = range(source.shape[0]) if which is None else which
    for_each(len(parts), lambda k: np.copyto(target[k], source[parts[k]]))


def _steady_forces(system: CellFields, walls: AngleForces | None, limit: CellwiseLimit) -> Floats:
    """F_x, F_y, F_bar of all cells without interaction, (2 or 3, na, ny, nx).

    Their work is taken by the trapezoidal rule: exact for a quadratic V1, and with `balanced_torque`
    for V2.
    """
    terms = system.terms
    steady = np.zeros((len(system.system.velocities), *system.grid.shape))
    cells = system.cells._replace(extents=system.grid.everywhere, drift=steady)
    # Vacuum too has the forces that mass will meet there.
    force = acceleration(terms._replace(angular=None), walls, vacuum=-math.inf)
    treat(cells, force, _look(terms, steady.shape[0], limits=False), limit)
    if terms.angular is not None:
        steady[2] += balanced_torque(terms.angular, system.grid.angle)[:, None, None]
    return steady


def _look(terms: CellTerms, velocities: int, limits: bool) -> Work:
    """A pass that changes nothing."""
    return Work(exact_kick(terms, 0.0, velocities), False, 0.0, limits)


def balanced_torque(angular: Record, angles: Floats) -> Floats:
    """-dV2/dtheta (na,) at evenly spaced angles, so that the trapezoidal rule gives V2 itself.

        k/2 (T_a + T_{a+1}) = V2_a - V2_{a+1},    T^_m = -i (2/k) tan(m k/2) V2^_m

    for each harmonic m below the highest, which an even number of angles leaves without a torque.
    """
    number = angles.size
    energy = np.array([angular_energy(angular, float(angle)) for angle in angles])
    halves = np.pi / number * np.arange(number // 2 + 1)
    # The highest harmonic of an even number of angles would be multiplied by tan(pi/2).
    raised = np.tan(halves) * (2 * np.arange(halves.size) < number)
    torque = np.fft.irfft(-1j * number / np.pi * raised * np.fft.rfft(energy), number)
    return np.asarray(torque, np.float64)

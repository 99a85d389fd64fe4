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
step ahead, q - dt/2 div m. Directions change order from step to step.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple, cast

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, add, scale, select
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import over_row
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.finite_volume.boundary import fill_ghosts, fill_periodic
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.cell_forces import AngleGridForces
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.fluxes import FluxMaker
from ellipsoid_coupling.finite_volume.fluxes.contract import ALONG, DENSITY, in_order
from ellipsoid_coupling.finite_volume.fluxes.kinetic import SIGNAL, Limits, face_factor
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.hydrostatic_reconstruction import (
    WORK_AT,
    WRAPS,
    set_ahead,
    set_work,
)
from ellipsoid_coupling.finite_volume.q_grid import NORMAL, Extents, Q
from ellipsoid_coupling.finite_volume.sources import (
    Work,
    acceleration,
    dampings,
    exact_gain,
    exact_kick,
    treat,
)
from ellipsoid_coupling.finite_volume.step_limits import CellwiseLimit, shorter
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

    def __init__(self, system: CellFields, make_flux: FluxMaker) -> None:
        self._system, self._make_flux = system, make_flux
        # Pressure is a q-equation's, whose forces these are.
        self._forces = cast(AngleGridForces, system.find_forces)
        self._limit = system.cellwise_limit(1)._replace(sound=SIGNAL, damped=True)
        self._steady = _steady_forces(system, self._forces.walls, self._limit)
        # The strongest pull of the interaction in each direction, as of the last step.
        self.memory = np.zeros(3)
        self._allowed = (0.0, CFL_LIMIT)
        # Fields before a step and before a direction; density and momentum after its first stage.
        self._start, self._before = np.empty((2, *system.fields.shape))
        self._middle = np.empty((2, *system.fields.shape[1:]))
        # Tilt and rest along each axis, where there is no work 1 and 0.
        self._works = {axis: _no_work(system.fields[Q].size) for axis in system.axes}

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
        force = acceleration(system.terms, self._forces.walls)
        look = _look(system.terms, len(system.system.velocities), limits=True)
        peaks = treat(system.cells, force, look, self._limit)
        shortest = self._limit.steps(peaks)
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
            steps[d] = max(shortened, distance / held) if held > 0.0 else shortened
        return shorter((min(steps[:2]), steps[2]))

    def step(self, dt: float, count: int) -> bool:
        """See the module; the step is refused if the new state allows less than a quarter of it.

        This happens when the first stage nearly empties a cell whose momentum the second stage uses.
        """
        system = self._system
        kept = system.outflow.copy(), self.memory.copy(), system.extents
        potential = self._potential(0.5 * dt)
        self._note_pull(potential)
        axes = system.axes
        # Reversed order every second step: the splitting is second order over two steps.
        order = axes if count % 2 == 0 else axes[::-1]
        for axis in order:
            self._fill(axis)
            before = self._start if axis == order[0] else self._before
            _copy(system.fields, before)
            self._step_along(axis, potential, before, dt)
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
            for axis in system.axes:
                self._fill(axis)
            factors = tuple(0.5 * ahead / system.grid.width(axis) for axis in system.axes)
            density = np.empty(system.grid.shape)
            set_ahead(system.fields, system.axes, factors, density)
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
        low, high = self._system.ghosts.kinds.ends(axis)
        return WORK_AT[at_side(low)], WORK_AT[at_side(high)]

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
            rise = np.abs(np.diff(closed, axis=axis)).max(initial=0.0)
            self.memory[d] = self._weight(axis) * rise / self._system.grid.width(axis)

    def _step_along(self, axis: int, potential: Floats | None, before: Floats, dt: float) -> None:
        """Both stages along an axis, from the fields as they are, of which `before` is a copy."""
        system, work, middle = self._system, self._works[axis], self._middle
        weights = 0.5 * system.grid.width(axis), self._weight(axis)
        set_work(self._steady[-1 - axis], potential, axis, self._ends(axis), weights, work)
        flux = self._make_flux(system.transported(axis, dt)._replace(tilt=work[0]))
        rate = system.terms.angular_damping if axis == -3 else system.terms.damping
        stage = _Stage(dt / system.grid.width(axis), *_exponential_weights(rate, dt))
        normal = NORMAL[axis]
        stride = math.prod(system.grid.padded[3 + axis + 1 :])
        before_stages = system.outflow.copy()
        system.transport(flux, axis, dt)
        source = work, Limits(system.smooth_part(axis), system.vacuum)
        _push(system.fields, before, system.extents, *source, (normal, stride), stage)
        self._fill(axis)
        # The second stage's source needs density and momentum as the first stage has left them,
        # ghosts included.
        _copy(system.fields, middle, (Q, normal))
        system.transport(flux, axis, dt)
        # Both stages' transports count half, here as in `_combine`.
        system.outflow[:] = 0.5 * (before_stages + system.outflow)
        components = in_order(system.fields.shape[0], normal)
        states = system.fields, before, middle
        _combine(states, system.extents, *source, components, stride, stage)


def _copy(source: Floats, target: Floats, which: tuple[int, ...] | None = None) -> None:
    """All components or some, one at a time, by all threads: memory is faster than one of them."""
    parts = range(source.shape[0]) if which is None else which
    for_each(len(parts), lambda k: np.copyto(target[k], source[parts[k]]))


def _no_work(cells: int) -> Floats:
    return np.array([np.ones(cells), np.zeros(cells)])


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
    raised = np.tan(halves) * (2 * np.arange(halves.size) < number)
    torque = np.fft.irfft(-1j * number / np.pi * raised * np.fft.rfft(energy), number)
    return np.asarray(torque, np.float64)


def _exponential_weights(rate: float, dt: float) -> tuple[float, float, float]:
    """exp(-z), phi_1 and phi_2 at z = rate dt; 1, 1 and 1/2 at 0."""
    z = rate * dt
    first = exact_gain(rate, dt) / dt
    # The quotient loses digits for small z, where two terms of the series are exact to 1e-9.
    second = (1.0 - first) / z if z > 1e-4 else 0.5 - z / 6.0
    return math.exp(-z), first, second


@inline_kernel
def _source(density: Values, up: Values, down: Values, limits: Limits) -> float:
    """H S of a cell.

    density : of its lower neighbour, its own, its upper neighbour's; up, down : tilt and rest of the
    work to the upper one and from the lower one.
    """
    # Ratios of the equilibrium's densities: upper face to centre, lower face to centre.
    rise, fall = up[0], 1.0 / down[0]
    factor = face_factor(density[0], density[1], density[2], rise, fall, limits)
    # Simpson's rule for the mean density of the profile over that of the equilibrium: c(s)/c(g).
    mean = (2.0 + 0.5 * (factor * rise + fall / factor)) / (2.0 + 0.5 * (rise + fall))
    # Both faces' pressures, and the rest of the work, which acts as a plain force.
    push = mean * (rise - fall) + 0.5 * (up[1] + down[1])
    return push * density[1]


class _Forced(NamedTuple):
    """What the source of a run of cells follows from, rows; see `_source`."""

    density: Rows
    up: Rows
    down: Rows
    limits: Limits


@inline_kernel
def _forced(q: Floats, work: Floats, start: int, stride: int, limits: Limits) -> _Forced:
    """Of the cells from `start` on of a flat density (1, cells), and the work (2, cells)."""
    own = rows_at(q, (0,), start)
    around = rows_at(q, (0,), start - stride) + own + rows_at(q, (0,), start + stride)
    return _Forced(
        around, rows_at(work, (0, 1), start), rows_at(work, (0, 1), start - stride), limits
    )


@inline_kernel
def _source_at(forced: _Forced, i: int) -> float:
    return _source(load(forced.density, i), load(forced.up, i), load(forced.down, i), forced.limits)


class _Stage(NamedTuple):
    """What both stages of a step share: dt/h, and exp(-z), phi_1, phi_2 of `_exponential_weights`."""

    ratio: float
    decay: float
    first: float
    second: float


@inline_kernel
def _push_cell(i: int, forced: _Forced, before: Rows, moved: Rows, stage: _Stage) -> None:
    m, now = load(before, i)[0], load(moved, i)[0]
    push = now - m + stage.ratio * _source_at(forced, i)
    store(moved, i, (stage.decay * m + stage.first * push,))


@kernel(noalias=True)
def _push_row(forced: _Forced, before: Rows, moved: Rows, width: int, stage: _Stage) -> None:
    over_row(width, _push_cell, (forced, before, moved, stage))


@inline_kernel
def _run(extents: Extents, task: int, padded: tuple[int, int]) -> tuple[int, int]:
    """Where the run of a row, counted through all angles, begins in flat fields, and its width."""
    rows = extents.shape[1]
    a, j = task // rows, task % rows
    row = ((a + GHOSTS) * padded[0] + j + GHOSTS) * padded[1] + GHOSTS
    return row + extents[a, j, 0], max(extents[a, j, 1] - extents[a, j, 0], 0)


@parallel_kernel
def _push(
    fields: Floats,
    before: Floats,
    extents: Extents,
    work: Floats,
    limits: Limits,
    line: tuple[int, int],
    stage: _Stage,
) -> None:
    """The first stage's momentum, m1 = e^-z m + phi_1 dt R, from what transport made of m.

    line : the component of the momentum, and the distance of neighbours in flat fields.
    """
    normal, stride = line
    padded = fields.shape[2], fields.shape[3]
    old, new = before.reshape(fields.shape[0], -1), fields.reshape(fields.shape[0], -1)
    for task in numba.prange(extents.shape[0] * extents.shape[1]):
        start, width = _run(extents, task, padded)
        forced = _forced(old, work, start, stride, limits)
        m, moved = rows_at(old, (normal,), start), rows_at(new, (normal,), start)
        _push_row(forced, m, moved, width, stage)


@inline_kernel
def _combine_cell(
    i: int, forced: _Forced, first_stage: Rows, old: Rows, new: Rows, stage: _Stage
) -> None:
    before, after, m1 = load(old, i), load(new, i), load(first_stage, i)[0]
    # dt (R1 - R0): R1 from the second transport, R0 from what the first stage made of it.
    change = after[ALONG] - m1 + stage.ratio * _source_at(forced, i)
    change -= (m1 - stage.decay * before[ALONG]) / stage.first
    means = scale(0.5, add(before, after))
    # A mean of mass and vacuum never gets to 0 by itself, and its velocity is made of rounding.
    empty = means[DENSITY] <= forced.limits.vacuum
    new_cell = (means[DENSITY], m1 + stage.second * change, *means[2:])
    store(new, i, select(empty, 0.0, new_cell))


@kernel(noalias=True)
def _combine_row(
    forced: _Forced, first_stage: Rows, old: Rows, new: Rows, width: int, stage: _Stage
) -> None:
    over_row(width, _combine_cell, (forced, first_stage, old, new, stage))


@parallel_kernel
def _combine(
    states: tuple[Floats, Floats, Floats],
    extents: Extents,
    work: Floats,
    limits: Limits,
    components: tuple[int, ...],
    stride: int,
    stage: _Stage,
) -> None:
    """The second stage: the mean of old and twice stepped, and m = m1 + phi_2 dt (R1 - R0).

    states : the fields, which are overwritten; those before the step; density and momentum after the
    first stage.
    components : density, momentum along the direction, and the others.
    """
    fields, before, middle = states
    padded = fields.shape[2], fields.shape[3]
    old, new = before.reshape(fields.shape[0], -1), fields.reshape(fields.shape[0], -1)
    half = middle.reshape(2, -1)
    for task in numba.prange(extents.shape[0] * extents.shape[1]):
        start, width = _run(extents, task, padded)
        forced = _forced(half, work, start, stride, limits)
        m1 = rows_at(half, (1,), start)
        olds, news = rows_at(old, components, start), rows_at(new, components, start)
        _combine_row(forced, m1, olds, news, width, stage)

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
from typing import ClassVar, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.angle_grid import AngleForces
from ellipsoid_coupling.interaction.angle_spectra import Quantity
from ellipsoid_coupling.kernels import for_each, inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.schemes.boundary import fill_ghosts, fill_periodic
from ellipsoid_coupling.schemes.fluxes.kinetic import SIGNAL, Kinetic, face_factor
from ellipsoid_coupling.schemes.grid import GHOSTS
from ellipsoid_coupling.schemes.q_grid import NORMAL, QVX, Extents, Q, inside
from ellipsoid_coupling.schemes.q_sources import accelerations, largest_step, shorter
from ellipsoid_coupling.schemes.q_splitting import QSystem
from ellipsoid_coupling.schemes.sources import exact_gain
from ellipsoid_coupling.schemes.step_control import CFL
from ellipsoid_coupling.schemes.work import set_ahead, set_work
from ellipsoid_coupling.tuples import run_of

Floats = NDArray[np.float64]

# A step whose outcome allows less than this part of it was itself too long.
_SHORTEST_NEXT = 0.25


class BalancedHeun:
    """Steps a `QSystem` with pressure 1 as above."""

    order: ClassVar[int] = 2
    quantity: ClassVar[Quantity] = "potential"

    def __init__(self, system: QSystem) -> None:
        self._system = system
        self._steady = _steady_forces(system)
        # The strongest pull of the interaction in each direction, as of the last step.
        self.memory = np.zeros(3)
        self.forces: AngleForces | None = None
        self._allowed = (0.0, CFL)
        # Fields before a step, before a direction and after its first stage.
        self._start, self._before, self._middle = np.empty((3, *system.fields.shape))
        # Tilt and rest along each axis, where there is no work 1 and 0.
        self._works = {axis: _no_work(system.fields[Q].size) for axis in system.axes}

    def prepare(self) -> None:
        """The pull of the interaction at the present density, where no step has told it yet."""
        # A pull is a magnitude, whatever a checkpoint from elsewhere says.
        np.abs(self.memory, out=self.memory)
        if not self.memory.any():
            self._note_pull(self._potential(0.0))
        self._allowed = self._find_largest_step()

    @property
    def largest_step(self) -> tuple[float, int]:
        """From the fastest signal, the forces within the step included."""
        return self._allowed

    def _find_largest_step(self) -> tuple[float, int]:
        system = self._system
        limits = system.limits()._replace(sound=SIGNAL, damped=True)
        shortest = largest_step(system.fields, system.extents, system.terms, system.walls, limits)
        steps = [shortest[0], shortest[0], shortest[1]]
        rates = [system.terms.damping, system.terms.damping, system.terms.angular_damping]
        for d, distance in enumerate(limits.distances):
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
        """See the module; refused if what it leads to allows only a far shorter one.

        A cell that the first stage all but empties keeps a momentum for the second.
        """
        system = self._system
        _copy(system.fields, self._start)
        before = system.left.copy(), self.memory.copy(), system.extents
        potential = self._potential(0.5 * dt)
        self._note_pull(potential)
        axes = system.axes
        for axis in axes if count % 2 == 0 else axes[::-1]:
            self._step_along(axis, potential, dt)
        system.narrow_extents()
        allowed = self._find_largest_step()
        if allowed[0] >= _SHORTEST_NEXT * dt:
            self._allowed = allowed
            return True
        _copy(self._start, system.fields)
        system.left[:], self.memory[:], system.extents = before
        return False

    def _potential(self, ahead: float) -> Floats | None:
        """U * q, (n, ny, nx), of the density `ahead` of now; None without interaction."""
        system = self._system
        if system.interaction is None:
            return None
        density = inside(system.fields)[Q]
        if ahead:
            for axis in system.axes:
                self._fill(axis)
            factors = tuple(0.5 * ahead / system.grid.width(axis) for axis in system.axes)
            density = np.empty(system.grid.shape)
            set_ahead(system.fields, system.axes, factors, density)
        return np.asarray(system.interaction.potential(density), np.float64)

    def _fill(self, axis: int) -> None:
        system = self._system
        if axis == -3:
            fill_periodic(system.fields, 1)
        else:
            fill_ghosts(system.fields, axis + 4, system.reflecting, NORMAL[axis])

    def _weight(self, axis: int) -> float:
        terms = self._system.terms
        return terms.inverse_inertia if axis == -3 else terms.inverse_mass

    def _note_pull(self, potential: Floats | None) -> None:
        if potential is None:
            return
        for d, axis in enumerate(self._system.axes):
            # Differences over the periodic end of x and y never occur: nothing reaches that far.
            rise = np.abs(np.diff(potential, axis=axis)).max(initial=0.0)
            self.memory[d] = self._weight(axis) * rise / self._system.grid.width(axis)

    def _step_along(self, axis: int, potential: Floats | None, dt: float) -> None:
        system, work = self._system, self._works[axis]
        weights = 0.5 * system.grid.width(axis), self._weight(axis)
        set_work(self._steady[-1 - axis], potential, axis, system.reflecting, weights, work)
        field = _Field(work[0], work[1], axis, system.vacuum)
        flux = Kinetic(work[0])
        rate = system.terms.angular_damping if axis == -3 else system.terms.damping
        exponential = _exponential_weights(rate, dt)
        ratio = dt / system.grid.width(axis)
        self._fill(axis)
        _copy(system.fields, self._before)
        left = system.left.copy()
        system.transport(flux, axis, dt)
        _push(system.fields, self._before, system.extents, field, ratio, exponential)
        self._fill(axis)
        _copy(system.fields, self._middle)
        system.transport(flux, axis, dt)
        # Both stages' transports count half, here as in `_combine`.
        system.left[:] = 0.5 * (left + system.left)
        states = system.fields, self._before, self._middle
        _combine(*states, system.extents, field, ratio, exponential)


def _copy(source: Floats, target: Floats) -> None:
    """A component at a time, by all threads: memory is faster than one of them."""
    for_each(source.shape[0], lambda k: np.copyto(target[k], source[k]))


def _no_work(cells: int) -> Floats:
    return np.array([np.ones(cells), np.zeros(cells)])


def _steady_forces(system: QSystem) -> Floats:
    """F_x, F_y, F_bar of all cells without interaction, (2 or 3, na, ny, nx).

    Their work is taken by the trapezoidal rule: exact for V1. With the amplitude of V2 raised by
    tan(k/2)/(k/2) it is exact for V2 as well.
    """
    terms = system.terms
    half = 0.5 * system.grid.angle_width
    if terms.amplitude is not None:
        terms = terms._replace(amplitude=terms.amplitude * math.tan(half) / half)
    steady = np.zeros((system.fields.shape[0] - 1, *system.grid.shape))
    accelerations(terms, system.walls, steady)
    return steady


def _exponential_weights(rate: float, dt: float) -> tuple[float, float, float]:
    """exp(-z), phi_1 and phi_2 at z = rate dt; 1, 1 and 1/2 at 0."""
    z = rate * dt
    first = exact_gain(rate, dt) / dt
    # The quotient loses digits for small z, where two terms of the series are exact to 1e-9.
    second = (1.0 - first) / z if z > 1e-4 else 0.5 - z / 6.0
    return math.exp(-z), first, second


class _Field(NamedTuple):
    """The force along one axis, flat like the fields.

    Attributes
    ----------
    tilt : (cells,) float64
        See `Kinetic`.
    rest : (cells,)
        Work from centre to centre beyond what `tilt` holds.
    axis : int
        -1, -2 or -3.
    vacuum : float
    """

    tilt: Floats
    rest: Floats
    axis: int
    vacuum: float


@kernel
def _sources(q: Floats, first: int, stride: int, field: _Field, out: Floats) -> None:
    """The sources h S of a run of cells of a flat density, from the cell `first` on: out (width,)."""
    tilt, rest, _, vacuum = field
    width = out.size
    before, after = first - stride, first + stride
    # Runs are cut out before the loop, which then reads them in line.
    q_before, q_here, q_after = (
        q[before : before + width],
        q[first : first + width],
        q[after : after + width],
    )
    tilt_up, tilt_down = tilt[first : first + width], tilt[before : before + width]
    rest_up, rest_down = rest[first : first + width], rest[before : before + width]
    for i in range(width):
        rise, fall = tilt_up[i], 1.0 / tilt_down[i]
        factor = face_factor(q_before[i], q_here[i], q_after[i], rise, fall, vacuum)
        mean = (2.0 + 0.5 * (factor * rise + fall / factor)) / (2.0 + 0.5 * (rise + fall))
        push = mean * (rise - fall) + 0.5 * (rest_up[i] + rest_down[i])
        out[i] = push * q_here[i]


@inline_kernel
def _stride(fields: Floats, axis: int) -> int:
    """The distance of neighbours along an axis in the flat fields."""
    row = fields.shape[3]
    return 1 if axis == -1 else row if axis == -2 else row * fields.shape[2]


@parallel_kernel
def _push(
    fields: Floats,
    before: Floats,
    extents: Extents,
    field: _Field,
    ratio: float,
    weights: tuple[float, float, float],
) -> None:
    """The first stage's momentum, m1 = e^-z m + phi_1 dt R, from what transport made of m."""
    tilt, rest, axis, vacuum = field
    decay, first, _ = weights
    rows = extents.shape[1]
    stride, normal = _stride(fields, axis), QVX - 1 - axis
    old = before.reshape(fields.shape[0], -1)
    new = fields.reshape(fields.shape[0], -1)
    for task in numba.prange(extents.shape[0] * rows):
        a, j = task // rows, task % rows
        row = ((a + GHOSTS) * fields.shape[2] + j + GHOSTS) * fields.shape[3] + GHOSTS
        start, width = row + extents[a, j, 0], max(extents[a, j, 1] - extents[a, j, 0], 0)
        source = np.empty(width)
        _sources(old[Q], start, stride, _Field(tilt, rest, axis, vacuum), source)
        m, moved = run_of(old, normal, start, width), run_of(new, normal, start, width)
        for i in range(width):
            moved[i] = decay * m[i] + first * (moved[i] - m[i] + ratio * source[i])


@parallel_kernel
def _combine(
    fields: Floats,
    before: Floats,
    middle: Floats,
    extents: Extents,
    field: _Field,
    ratio: float,
    weights: tuple[float, float, float],
) -> None:
    """The second stage: the mean of old and twice stepped, and m = m1 + phi_2 dt (R1 - R0)."""
    tilt, rest, axis, vacuum = field
    decay, first, second = weights
    rows = extents.shape[1]
    stride, normal = _stride(fields, axis), QVX - 1 - axis
    old = before.reshape(fields.shape[0], -1)
    half = middle.reshape(fields.shape[0], -1)
    new = fields.reshape(fields.shape[0], -1)
    for task in numba.prange(extents.shape[0] * rows):
        a, j = task // rows, task % rows
        row = ((a + GHOSTS) * fields.shape[2] + j + GHOSTS) * fields.shape[3] + GHOSTS
        start, width = row + extents[a, j, 0], max(extents[a, j, 1] - extents[a, j, 0], 0)
        momentum = np.empty(width)
        _sources(half[Q], start, stride, _Field(tilt, rest, axis, vacuum), momentum)
        m0, m1 = run_of(old, normal, start, width), run_of(half, normal, start, width)
        moved = run_of(new, normal, start, width)
        for i in range(width):
            change = moved[i] - m1[i] + ratio * momentum[i]
            change -= (m1[i] - decay * m0[i]) / first
            momentum[i] = m1[i] + second * change
        q0, q2 = run_of(old, Q, start, width), run_of(new, Q, start, width)
        # The density last, since it tells which cells are to be emptied: a mean of mass and vacuum
        # never gets there by itself, and its velocity is any.
        for k in range(fields.shape[0] - 1, -1, -1):
            u0, u2 = run_of(old, k, start, width), run_of(new, k, start, width)
            for i in range(width):
                mean = momentum[i] if k == normal else 0.5 * (u0[i] + u2[i])
                u2[i] = 0.0 if 0.5 * (q0[i] + q2[i]) <= vacuum else mean

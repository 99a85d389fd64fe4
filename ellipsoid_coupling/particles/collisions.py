"""The longest step in which no particle passes through a neighbour unnoticed.

A force that is 0 at both ends of a step does not show what lies between. So the particles of a pair that
may meet must not move, against one another, by more than a part of the thickness of their potential:

    dt |v_i - v_j| <= c b,    b = sqrt(2) d the potential's reach on the short side, d = 2 D,
                              c = (2/ln(1/tolerance))^{1/2}

A chord of the potential that is shorter than c b lies where exp(-s/(1-s)) is below tolerance^2.

A comparison of all pairs would cost as much as their forces. Instead the displacements d_i of a step are
compared with a motion r -> A r + b that is fitted to some of them, of strain S (the symmetric part of A)
and rotation W. In the frame that turns with W, particles delta apart move by S delta + e_i - e_j, where
e_i is the residual of the fit. Those that come within `reach` therefore move by less than

    (S reach + e)/(1 - S),    e = 2 max |e_i| + lever max |dtheta_i - W|.

Flows are smooth, so e is small where particles are many. A neighbour that is too weak to move a particle
by the tolerance in a step may be passed (`pull`). Where only all neighbours together are strong enough,
the root mean square of e_i counts instead of the largest.

Across a periodic side delta is the distance of the nearest images. A particle's images all move alike, and
so must the fit: A does not depend on a periodic coordinate.

With noise, a step that ends inside a neighbour is not repeated. Then c^2 is half of that, and the width at
most the length in which the potential drops, U/|dU/dr| = b (1-s)^2/(2 sqrt(s)), where its height is the
energy with which the pair meets, of heat and of the visible motion. The bound does not depend on the noise
to come, so no outcome is preferred.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.edge_grid import EdgeGrid, clearance_at
from ellipsoid_coupling.particles.extremes import sum_and_largest
from ellipsoid_coupling.particles.fates import Fates, part_inside
from ellipsoid_coupling.particles.linear import linear_step
from ellipsoid_coupling.particles.state import Contact, Limits, Rates
from ellipsoid_coupling.physics.potential import PotentialShape

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

# Rows of `Contact.pull`.
PAIR, CROWD, WALL = range(3)

# The largest of sqrt(s) exp(-s/(1-s))/(1-s)^2, at s = 0.577.
_STEEPEST = 1.0852
# The motion is fitted to so many particles at most: six unknowns need no more, and all would cost a pass.
# They are told by multiples of the golden ratio: every so-manieth of samples that stand in rows and columns
# could stand in one column, which would leave the motion across it open.
_FITTED, _GOLDEN = 128, 0.6180339887498949
_MOST_TRIALS = 40
# How many ghost particles act on a particle; they stand half a length apart.
GHOSTS_IN_REACH = 6.0


def contact_of(
    shape: PotentialShape,
    tolerance: float,
    pull: Floats,
    ghosts: bool,
    energies: tuple[float, float, float],
) -> Contact:
    """The properties of the particles that `collision_step` needs.

    Parameters
    ----------
    shape : PotentialShape
    tolerance : float
    pull : (3, D) float64
        The largest acceleration by one neighbour, by all of them and by the walls' ghosts, in scales
        of the tolerance: see `steepest`.
    ghosts : bool
        Whether walls have ghost particles.
    energies : (float, float, float)
        The height of a neighbour's potential (0 without noise), the thermal energy, and the mass.
    """
    # (1 - lambda)/(1 + lambda) = (d/l)^2; `bluntness` is 1 - lambda to all digits, for needles.
    thickness = shape.reach * math.sqrt(shape.bluntness / (1.0 + shape.shape_factor))
    noisy = energies[0] > 0.0
    # At tolerances above e^-2 the bound 2 keeps c from growing: a pair never moves by more than b.
    part = math.sqrt((1.0 if noisy else 2.0) / max(math.log(1.0 / tolerance), 2.0))
    lever, ghost_reach = shape.reach - thickness, shape.reach * ghosts
    return Contact(shape.reach, thickness, part, lever, pull, ghost_reach, *energies)


def highest(shape: PotentialShape) -> float:
    """U/eps0 of particles at one position: sqrt(kappa) of parallel ones."""
    # kappa = 1/(1 - lambda^2), as a product for needles.
    return 1.0 / math.sqrt(shape.bluntness * (1.0 + shape.shape_factor))


def steepest(shape: PotentialShape) -> tuple[float, float]:
    """Bounds of |grad_r U| and |dU/dtheta| over eps0, the latter by how far an angle moves U's rim."""
    long_axis = shape.reach / math.sqrt(2.0)
    short_axis = long_axis * math.sqrt(shape.bluntness / (1.0 + shape.shape_factor))
    height = highest(shape)
    # Across parallel particles s = (r/b)^2, so |dU/dr| = U (2 sqrt(s)/b)/(1-s)^2 with b = sqrt(2) d.
    slope = _STEEPEST * math.sqrt(2.0) * height / short_axis
    return slope, slope * math.sqrt(2.0) * (long_axis - short_axis)


class Cloud(NamedTuple):
    """Particles in K blocks: position, velocity, force (K, D, B); frozen and fates as in their state."""

    position: Floats
    velocity: Floats
    force: Floats
    frozen: Flags | None = None
    fates: Fates | None = None


class _Moves(NamedTuple):
    """Displacements d = velocity v + force F of x, y and the angle in a step; noise is its spread."""

    velocity: tuple[float, float]
    force: tuple[float, float]
    noise: float


@kernel
def _moves(rates: Rates, dt: float) -> _Moves:
    first = linear_step(rates.damping[0], rates.amplitude[0], dt)
    # Noise does not enter the two coefficients that are asked for.
    last = linear_step(rates.damping[-1], 0.0, dt)
    return _Moves(
        (first.position_velocity, last.position_velocity),
        (first.position_force, last.position_force),
        first.position_noise,
    )


@kernel
def _matters(pull: Floats, rates: Rates, tolerance: float, dt: float) -> bool:
    """Whether a push that a step misses moves a particle by more than the tolerance."""
    for d in range(pull.size):
        if linear_step(rates.damping[d], 0.0, dt).position_missed * pull[d] > tolerance:
            return True
    return False


@kernel
def _meets(frozen: Flags | None, k: int, i: int) -> bool:
    """Whether particle i of block k can meet others: frozen ones act on none."""
    return frozen is None or frozen[k, i] == 0


@kernel
def _fitted_axes(periods: Floats | None) -> tuple[float, float]:
    """1 for x and for y where the fitted motion may depend on it, 0 where images must move alike."""
    if periods is None:
        return 1.0, 1.0
    x, y = math.isinf(periods[0, 1]), math.isinf(periods[1, 1])
    return 1.0 if x else 0.0, 1.0 if y else 0.0


@kernel
def _fitted(number: int, total: int) -> int:
    """The particle of that number in a fit: always the same one, whatever chance or threads do."""
    return number if total <= _FITTED else int(total * ((number + 0.5) * _GOLDEN % 1.0))


@kernel
def _fit(cloud: Cloud, moves: _Moves, axes: tuple[float, float]) -> tuple[float, ...]:
    """The motion (x0, y0, dx0, dy0, a_xx, a_xy, a_yx, a_yy) of some particles, by least squares."""
    position, velocity, force, frozen, _ = cloud
    blocks, _, size = position.shape
    total = blocks * size
    means = np.zeros(4)
    count = 0
    for number in range(min(total, _FITTED)):
        j = _fitted(number, total)
        k, i = j // size, j % size
        if _meets(frozen, k, i):
            count += 1
            for d in range(2):
                means[d] += position[k, d, i]
                move = moves.velocity[0] * velocity[k, d, i] + moves.force[0] * force[k, d, i]
                means[2 + d] += move
    # Centred first: squares of positions far from the origin would cancel in the determinant.
    means /= max(count, 1)
    squares, products = np.zeros(3), np.zeros((2, 2))
    for number in range(min(total, _FITTED)):
        j = _fitted(number, total)
        k, i = j // size, j % size
        if not _meets(frozen, k, i):
            continue
        x, y = axes[0] * (position[k, 0, i] - means[0]), axes[1] * (position[k, 1, i] - means[1])
        squares[0] += x * x
        squares[1] += x * y
        squares[2] += y * y
        for d in range(2):
            move = moves.velocity[0] * velocity[k, d, i] + moves.force[0] * force[k, d, i]
            products[d, 0] += (move - means[2 + d]) * x
            products[d, 1] += (move - means[2 + d]) * y
    # Particles on a line leave the motion across it open: this chooses the least.
    squares[0] += 1e-10 * (squares[0] + squares[2])
    squares[2] += 1e-10 * (squares[0] + squares[2])
    det = squares[0] * squares[2] - squares[1] * squares[1]
    # All in one place, or a single one: no strain, and residuals about the mean motion.
    share = 1.0 / det if det > 0.0 else 0.0
    return (
        means[0],
        means[1],
        means[2],
        means[3],
        share * (products[0, 0] * squares[2] - products[0, 1] * squares[1]),
        share * (products[0, 1] * squares[0] - products[0, 0] * squares[1]),
        share * (products[1, 0] * squares[2] - products[1, 1] * squares[1]),
        share * (products[1, 1] * squares[0] - products[1, 0] * squares[1]),
    )


@kernel(noalias=True)
def _square_residuals(
    position: Floats,
    velocity: Floats,
    force: Floats,
    moves: _Moves,
    motion: tuple[float, ...],
    residuals: Floats,
) -> None:
    """|e_i|^2 and (dtheta_i - W)^2 of one block: residuals (2, B)."""
    x0, y0, dx0, dy0, xx, xy, yx, yy = motion
    v, f = moves.velocity[0], moves.force[0]
    for i in range(residuals.shape[1]):
        x, y = position[0, i] - x0, position[1, i] - y0
        ex = v * velocity[0, i] + f * force[0, i] - dx0 - xx * x - xy * y
        ey = v * velocity[1, i] + f * force[1, i] - dy0 - yx * x - yy * y
        residuals[0, i] = ex * ex + ey * ey
    if position.shape[0] == 3:
        v, f = moves.velocity[1], moves.force[1]
        for i in range(residuals.shape[1]):
            # W is the antisymmetric part of A.
            turn = v * velocity[2, i] + f * force[2, i] - 0.5 * (yx - xy)
            residuals[1, i] = turn * turn


@kernel
def _leave_out(frozen: Flags | None, k: int, residuals: Floats) -> None:
    if frozen is not None:
        for i in range(residuals.shape[1]):
            if frozen[k, i] != 0:
                # A 0 changes neither a sum nor the largest of squares.
                residuals[:, i] = 0.0


@kernel
def _residuals(
    cloud: Cloud, moves: _Moves, motion: tuple[float, ...], crowd: bool
) -> tuple[float, float]:
    """The largest |e_i| and |dtheta_i - W|, or in a `crowd` their root mean squares."""
    position, velocity, force, frozen, _ = cloud
    blocks, _, size = position.shape
    residuals = np.zeros((2, size))
    found = np.zeros(2)
    for k in range(blocks):
        _square_residuals(position[k], velocity[k], force[k], moves, motion, residuals)
        _leave_out(frozen, k, residuals)
        for kind in range(2):
            total, largest = sum_and_largest(residuals[kind])
            found[kind] = found[kind] + total if crowd else max(found[kind], largest)
    if crowd:
        # Those that have ended added 0; the mean is that of the others.
        found /= blocks * size * part_inside(cloud.fates)
    return math.sqrt(found[0]), math.sqrt(found[1])


@kernel
def allowed_width(contact: Contact, speed: float) -> float:
    """How far a pair that meets with so much relative speed may move against one another in a step."""
    width = contact.part
    # The reduced mass of two like particles is m/2.
    energy = contact.heat + 0.25 * contact.mass * speed * speed
    if contact.height > energy:
        steep = math.log(contact.height / energy) if energy > 0.0 else np.inf
        gap = 1.0 / (1.0 + steep)  # 1 - s, where exp(-s/(1-s)) is the energy over the height
        width = min(width, 0.5 * gap * gap / math.sqrt(1.0 - gap))
    return contact.thickness * width


@kernel
def _part_for_pairs(
    contact: Contact,
    cloud: Cloud,
    moves: _Moves,
    axes: tuple[float, float],
    crowd: bool,
    dt: float,
) -> float:
    """The part of a step in which no particle passes another one; see the module."""
    motion = _fit(cloud, moves, axes)
    residual, turn = _residuals(cloud, moves, motion, crowd)
    xx, xy, yx, yy = motion[4:]
    # The eigenvalue of the symmetric part of A that is larger in size.
    strain = 0.5 * abs(xx + yy) + math.hypot(0.5 * (xx - yy), 0.5 * (xy + yx))
    # Of the noise two standard deviations, of each of both particles.
    apart = 2.0 * residual + contact.lever * turn + 4.0 * moves.noise
    meeting = strain * contact.reach + apart
    width = allowed_width(contact, meeting / dt)
    # The part p of the step for which p meeting/(1 - p strain) = width, as in the module.
    return width / (meeting + strain * width)


@kernel
def _part_at_walls(
    contact: Contact, box: Floats | None, cloud: Cloud, moves: _Moves, dt: float
) -> float:
    """The part of a step in which no particle that bounces passes a neighbour or a wall's ghost."""
    if box is None:
        return np.inf
    position, velocity, force, _, _ = cloud
    most = 0.0
    v, f = moves.velocity[0], moves.force[0]
    for k in range(position.shape[0]):
        for d in range(2):
            # A bounce turns a velocity round, which no smooth motion does: here each one's own move counts.
            low, high = box[d, 0] + contact.ghost_reach, box[d, 1] - contact.ghost_reach
            here, speed, push = position[k, d], velocity[k, d], force[k, d]
            for i in range(here.size):
                move = v * speed[i] + f * push[i]
                near = not low <= here[i] + move <= high
                most = max(most, abs(move) if near else 0.0)
    most += 2.0 * moves.noise
    return allowed_width(contact, most / dt) / most if most > 0.0 else np.inf


@kernel
def _part_at_edges(
    contact: Contact, edges: EdgeGrid | None, cloud: Cloud, moves: _Moves, dt: float
) -> float:
    """`_part_at_walls` where edges bound the fluid."""
    if edges is None:
        return np.inf
    most, (v, f) = 0.0, (moves.velocity[0], moves.force[0])
    for k in range(cloud.position.shape[0]):
        position, velocity, force = cloud.position[k], cloud.velocity[k], cloud.force[k]
        for i in range(position.shape[1]):
            if not _meets(cloud.frozen, k, i):
                continue
            x, y = v * velocity[0, i] + f * force[0, i], v * velocity[1, i] + f * force[1, i]
            clear = clearance_at(edges, position[0, i], position[1, i]) - contact.ghost_reach
            # A bound of the move's length that takes no root.
            if abs(x) + abs(y) > clear:
                most = max(most, abs(x), abs(y))
    most += 2.0 * moves.noise
    return allowed_width(contact, most / dt) / most if most > 0.0 else np.inf


@kernel
def _part(contact: Contact, cloud: Cloud, rates: Rates, limits: Limits, dt: float) -> float:
    """The part of a step of dt that may be taken."""
    # The cheapest question first: most steps of many weak particles end here, without a pass over them.
    part = np.inf
    pair = _matters(contact.pull[PAIR], rates, limits.tolerance, dt)
    crowd = _matters(contact.pull[CROWD], rates, limits.tolerance, dt)
    moves = _moves(rates, dt)
    if pair or crowd:
        axes = _fitted_axes(limits.periods)
        part = _part_for_pairs(contact, cloud, moves, axes, not pair, dt)
    if pair or _matters(contact.pull[WALL], rates, limits.tolerance, dt):
        part = min(part, _part_at_walls(contact, limits.box, cloud, moves, dt))
        part = min(part, _part_at_edges(contact, limits.edges, cloud, moves, dt))
    return part


@kernel
def _shortened(
    contact: Contact | None, cloud: Cloud, rates: Rates, limits: Limits, dt: float
) -> float:
    # A function of its own: numba leaves out what stands behind `is not None` for arguments only.
    if contact is not None:
        for _ in range(_MOST_TRIALS):
            part = _part(contact, cloud, rates, limits, dt)
            if not part < 1.0:
                break
            # The part depends on dt, so that it is looked at again; 0.95 makes that end soon.
            dt *= max(0.1, 0.95 * part)
    return dt


@kernel
def collision_step(cloud: Cloud, rates: Rates, limits: Limits, dt: float) -> float:
    """The longest step, up to dt, in which no particle passes a neighbour or a ghost unnoticed."""
    return _shortened(limits.contact, cloud, rates, limits, dt)

"""The error estimate of the scheme `accurate`: how far the correction of a step would move a particle.

Both the root mean square over all particles and the largest one are measured: a mean alone would let a
single particle err without bound among many that move smoothly.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.particles.extremes import sum_and_largest
from ellipsoid_coupling.particles.linear import linear_step
from ellipsoid_coupling.particles.state import ANGLE, Limits, ParticleState, Rates, Trial
from ellipsoid_coupling.stepping.step_control import ANGLE_ERROR, POSITION_ERROR

Floats = NDArray[np.float64]

# How far beyond the tolerance the worst particle's error may be, among many that move smoothly. At 1 a
# single particle in a million would set the step of all.
WORST = 10.0
# How far the drift's change may move a velocity in a step, in thermal velocities: the variance of the
# equilibrium is then off by less than 1 %.
_THERMAL_PART = 0.05
# Squared errors of a degree of freedom: their mean over the particles, and the largest.
MEAN, LARGEST = range(2)


@kernel(noalias=True)
def _square_changes(force: Floats, later: Floats, squares: Floats) -> None:
    for i in range(squares.size):
        change = later[i] - force[i]
        squares[i] = change * change


@kernel
def squared_errors(
    state: ParticleState,
    k: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
    out: Floats,
) -> None:
    """The squares of the correction over the scale, mean and largest: out (2, D).

    With noise, the velocity's change by the drift over the thermal velocity A/sqrt(2 Gamma) as well.
    """
    squares = np.empty(state.position.shape[2])
    for d in range(out.shape[1]):
        damping, amplitude = rates.damping[d], rates.amplitude[d]
        # Of the whole correction, also where the scheme takes only a part c of it.
        linear = linear_step(damping, 0.0, dt)
        _square_changes(state.force[k, d], trial.force[d], squares)
        total, largest = sum_and_largest(squares)
        per_tolerance = (linear.position_missed / limits.scale[d]) ** 2
        out[LARGEST, d] = largest * per_tolerance
        if amplitude > 0.0:
            thermal = linear.velocity_change / (_THERMAL_PART * amplitude) * limits.tolerance
            per_tolerance = max(per_tolerance, 2.0 * damping * thermal * thermal)
        out[MEAN, d] = total / squares.size * per_tolerance


@kernel
def largest_error(squares: Floats, tolerance: float, part: float) -> tuple[float, int]:
    """The error of all blocks over the tolerance, of the worst degree of freedom, and which kind it is.

    squares : (K, 2, D), as of `squared_errors` for each block.
    part : of the particles that take part; the zeros of the others must not make the mean smaller.
    """
    blocks, _, degrees = squares.shape
    worst, kind = 0.0, POSITION_ERROR
    for d in range(degrees):
        # In the order of the blocks, whoever measured them: the same bits for any number of threads.
        mean, largest = squares[0, MEAN, d], squares[0, LARGEST, d]
        for k in range(1, blocks):
            mean += squares[k, MEAN, d]
            largest = max(largest, squares[k, LARGEST, d])
        # Not by `max` or `>`: a mean that is not a number must win.
        square = largest / (WORST * WORST)
        if not mean / (blocks * part) <= square:
            square = mean / (blocks * part)
        if not square <= worst:
            worst, kind = square, ANGLE_ERROR if d == ANGLE else POSITION_ERROR
    return math.sqrt(worst) / tolerance, kind

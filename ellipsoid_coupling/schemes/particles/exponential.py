"""Scheme `accurate`: second order, the linear part (drag, damping, noise) integrated exactly.

With z = Gamma dt and the drift F (per mass) taken linear in time over the step, the exact solution
of r' = v, v' = F - Gamma v + A dW/dt is

    r_{n+1} = r_n + dt phi1 v_n + dt^2 [ phi2 F_n + phi3 (F_{n+1} - F_n) ] + R_n
    v_{n+1} = e^{-z} v_n + dt [ phi1 F_n + phi2 (F_{n+1} - F_n) ] + W_n

    phi1 = (1 - e^{-z})/z      phi2 = (z - 1 + e^{-z})/z^2      phi3 = (z^2/2 - z + 1 - e^{-z})/z^3

with (R_n, W_n) Gaussian of the exact covariance. F_{n+1} is evaluated once, where the formula without
phi3 leads (predict - evaluate - correct); the correction dt^2 phi3 (F_{n+1} - F_n) is the error
estimate that sets the step. For Gamma = 0 this is velocity Verlet with a corrected position, for
Gamma -> infinity Heun's rule for r' = F/Gamma: stiff drag costs nothing.

With noise no step is repeated, since repeating depends on the noise and would bias it; the step size
still follows the estimate. The position's correction takes energy out, dt^3/12 of it a step, as much
as weak damping puts in (at A = 0.1 and dt = 0.2 a variance of 0.88 instead of 1): with noise it is
weighted by 1 - e^{-z}, and what is left, a variance off by dt^2/11 of the curvature of the potential,
is kept below 1 % by a second bound on the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.drift import Drift, particle_forces
from ellipsoid_coupling.interaction.reflection import reflect
from ellipsoid_coupling.kernels import for_each, inline_kernel, kernel
from ellipsoid_coupling.schemes.particles.frozen import freeze, frozen_row, places_before
from ellipsoid_coupling.schemes.particles.state import (
    ANGLE,
    Limits,
    ParticleState,
    Rates,
    all_finite,
    bounce,
    noise_rows,
)
from ellipsoid_coupling.schemes.status import NOT_FINITE, RUNNING
from ellipsoid_coupling.schemes.step_control import (
    ANGLE_ERROR,
    NEXT_STEP,
    OUTSIDE,
    POSITION_ERROR,
    STATUS,
    STEPS,
    TIME,
    accept,
    equal_steps,
    reject,
)

Floats = NDArray[np.float64]

ORDER = 2
NOISE_PER_STEP = 2

# How far the drift's change may move a velocity in a step, in thermal velocities.
_THERMAL_PART = 0.05

# Below this z the closed forms lose digits to cancellation; the series does not.
_SERIES_BELOW = 0.5


class LinearStep(NamedTuple):
    """The exact step's coefficients for one dt; `*_noise` multiply standard normal numbers.

    R_n = place_noise xi1, W_n = shared_noise xi1 + own_noise xi2.
    """

    decay: float
    place_velocity: float
    place_force: float
    place_change: float
    velocity_force: float
    velocity_change: float
    place_noise: float
    shared_noise: float
    own_noise: float


@kernel
def phi_functions(z: float) -> tuple[float, float, float]:
    """phi1, phi2, phi3 of z >= 0, to rounding (phi_k = 1/k! - z phi_{k+1})."""
    if z > _SERIES_BELOW:
        phi1 = -math.expm1(-z) / z
        phi2 = (1.0 - phi1) / z
        return phi1, phi2, (0.5 - phi2) / z
    phi3 = 0.0
    for k in range(16, 2, -1):  # sum over k of (-z)^(k-3) / k!, by Horner's rule
        phi3 = 1.0 - z / (k + 1.0) * phi3  # quotients do not wait for one another
    phi3 /= 6.0
    phi2 = 0.5 - z * phi3
    return 1.0 - z * phi2, phi2, phi3


@kernel
def place_variance(z: float) -> float:
    """Var(R_n)/(A^2 dt^3) = (z - 2 (1 - e^{-z}) + (1 - e^{-2z})/2)/z^3, 1/3 at z = 0."""
    if z > _SERIES_BELOW:
        return (z + 2.0 * math.expm1(-z) - 0.5 * math.expm1(-2.0 * z)) / (z * z * z)
    # The coefficient of z^(k-3) is (-1)^k (2 - 2^(k-1))/k!, from the two exponential series.
    total = 0.0
    power = 1.0
    factorial = 2.0
    for k in range(3, 24):
        factorial *= k
        total += -power * (2.0 - 2.0 ** (k - 1)) / factorial
        power *= -z
    return total


@kernel
def linear_step(damping: float, noise: float, dt: float) -> LinearStep:
    """Coefficients of the exact linear step of length dt; see the module for phi3 with noise."""
    z = damping * dt
    phi1, phi2, phi3 = phi_functions(z)
    spread, shared, own = 0.0, 0.0, 0.0
    if noise > 0.0:
        phi3 *= z * phi1
        velocity_variance = noise * noise * dt * phi_functions(2.0 * z)[0]
        covariance = 0.5 * (noise * dt * phi1) ** 2
        spread = noise * math.sqrt(dt**3 * place_variance(z))
        shared = covariance / spread if spread > 0.0 else 0.0
        own = math.sqrt(max(velocity_variance - shared * shared, 0.0))
    return LinearStep(
        math.exp(-z),
        dt * phi1,
        dt * dt * phi2,
        dt * dt * phi3,
        dt * phi1,
        dt * phi2,
        spread,
        shared,
        own,
    )


class Trial(NamedTuple):
    """Work arrays of one realisation, (D, N) each: what a step would lead to.

    `place` is unfolded (as if there were no walls), `sign` is -1 where folding it back at a wall
    turns the velocity round, `force` is the drift at the folded position.
    """

    place: Floats
    folded: Floats
    sign: Floats
    force: Floats


@kernel
def _noise_of(
    noise: Floats | None, linear: LinearStep, component: int, i: int
) -> tuple[float, float]:
    """R_n and W_n of one degree of freedom; without noise no memory is touched."""
    if noise is None:
        return 0.0, 0.0
    first = noise[2 * component, i]
    second = noise[2 * component + 1, i]
    return linear.place_noise * first, linear.shared_noise * first + linear.own_noise * second


@kernel
def _predict(state: ParticleState, k: int, d: int, linear: LinearStep, trial: Trial) -> None:
    """The position at the step's end for a constant drift, before noise."""
    place, velocity, force = state.place[k, d], state.velocity[k, d], state.force[k, d]
    for i in range(place.size):
        trial.place[d, i] = (
            place[i] + linear.place_velocity * velocity[i] + linear.place_force * force[i]
        )


@kernel
def _add_place_noise(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, place: Floats
) -> None:
    if noise is not None and rates.first_noisy <= d < rates.last_noisy:
        for i in range(place.size):
            place[i] += _noise_of(noise, linear, d - rates.first_noisy, i)[0]


@kernel
def _add_velocity_noise(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, velocity: Floats
) -> None:
    if noise is not None and rates.first_noisy <= d < rates.last_noisy:
        for i in range(velocity.size):
            velocity[i] += _noise_of(noise, linear, d - rates.first_noisy, i)[1]


@kernel
def _fold(box: Floats | None, trial: Trial) -> None:
    """Where the walls throw a position back to, and the sign that its velocity takes."""
    trial.folded[:] = trial.place
    if box is not None:
        for d in range(2):
            for i in range(trial.place.shape[1]):
                trial.folded[d, i], trial.sign[d, i] = reflect(
                    trial.place[d, i], box[d, 0], box[d, 1]
                )


@inline_kernel
def _square_change(force: Floats, trial: Trial, d: int, i: int) -> float:
    change: float = trial.sign[d, i] * trial.force[d, i] - force[i]
    return change * change


@kernel
def _mean_square_change(force: Floats, trial: Trial, d: int) -> float:
    # Four running sums, which do not wait for one another; their order is fixed.
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = force.size - force.size % 4
    for i in range(0, whole, 4):
        s0 += _square_change(force, trial, d, i)
        s1 += _square_change(force, trial, d, i + 1)
        s2 += _square_change(force, trial, d, i + 2)
        s3 += _square_change(force, trial, d, i + 3)
    for i in range(whole, force.size):
        s0 += _square_change(force, trial, d, i)
    return ((s0 + s2) + (s1 + s3)) / force.size


@kernel
def _correct(state: ParticleState, k: int, d: int, linear: LinearStep, trial: Trial) -> None:
    """Finish the step of one degree of freedom, in the plane unfolded at the walls."""
    place, velocity, force = state.place[k, d], state.velocity[k, d], state.force[k, d]
    for i in range(place.size):
        change = trial.sign[d, i] * trial.force[d, i] - force[i]
        place[i] = trial.place[d, i] + linear.place_change * change
        velocity[i] = (
            linear.decay * velocity[i]
            + linear.velocity_force * force[i]
            + linear.velocity_change * change
        )
        force[i] = trial.force[d, i]


@kernel
def predict_step(
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    """Where a step of realisation k leads for a constant drift: `trial` but for its force."""
    for d in range(state.place.shape[1]):
        linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
        _predict(state, k, d, linear, trial)
        _add_place_noise(noise, d, rates, linear, trial.place[d])
    _fold(limits.box, trial)


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
    """The mean square of the correction over the scale, one number a degree of freedom (D,).

    With noise, the velocity's change by the drift over the thermal velocity A/sqrt(2 Gamma) as well.
    """
    for d in range(out.size):
        damping, amplitude = rates.damping[d], rates.amplitude[d]
        linear = linear_step(damping, 0.0, dt)
        square = _mean_square_change(state.force[k, d], trial, d)
        per_tolerance = (linear.place_change / limits.scale[d]) ** 2
        if amplitude > 0.0:
            thermal = linear.velocity_change / (_THERMAL_PART * amplitude) * limits.tolerance
            per_tolerance = max(per_tolerance, 2.0 * damping * thermal * thermal)
        out[d] = square * per_tolerance


@kernel
def largest_error(squares: Floats, tolerance: float) -> tuple[float, int]:
    """The error over the tolerance of the worst degree of freedom, and which kind it is.

    squares : (D,) mean squares, as of `squared_errors`.
    """
    worst, kind = 0.0, POSITION_ERROR
    for d in range(squares.size):
        if not squares[d] <= worst:
            worst, kind = squares[d], ANGLE_ERROR if d == ANGLE else POSITION_ERROR
    return math.sqrt(worst) / tolerance, kind


@kernel
def _try_step(
    state: ParticleState,
    k: int,
    noise: Floats | None,
    drift: Drift,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> tuple[float, int]:
    """Predict and evaluate; returns the error estimate over the tolerance, and its kind."""
    predict_step(state, k, noise, rates, limits, trial, dt)
    frozen = frozen_row(state.frozen, k)
    state.clock[k, OUTSIDE] = particle_forces(drift, trial.folded, trial.force, frozen)
    squares = np.empty(state.place.shape[1])
    squared_errors(state, k, rates, limits, trial, dt, squares)
    return largest_error(squares, limits.tolerance)


@kernel
def accept_step(
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    """Finish the step of realisation k that `trial` predicts, in place."""
    before = places_before(limits.mesh, state.place[k])
    for d in range(state.place.shape[1]):
        linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
        _correct(state, k, d, linear, trial)
        _add_velocity_noise(noise, d, rates, linear, state.velocity[k, d])
    bounce(limits.box, state.place[k], state.velocity[k])
    freeze(state, k, limits, before)


@kernel
def _may_repeat(noise: Floats | None) -> bool:
    """Repeating a noisy step would select the noise by its outcome."""
    return noise is None


@kernel
def step_factor(error: float) -> float:
    """How much longer the next step may be: the estimate is of third order in dt, 0.9 aims below."""
    if not math.isfinite(error):
        return 0.1
    return min(2.0, max(0.3, float(0.9 * (error + 1e-6) ** (-1.0 / 3.0))))


@kernel
def _advance_one(
    state: ParticleState,
    k: int,
    drift: Drift,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    clock = state.clock[k]
    shape = state.place[k].shape
    trial = Trial(np.empty(shape), np.empty(shape), np.ones(shape), np.empty(shape))
    if clock[STEPS] == 0.0:
        frozen = frozen_row(state.frozen, k)
        clock[OUTSIDE] = particle_forces(drift, state.place[k], state.force[k], frozen)
    for step in range(steps):
        remaining = until - clock[TIME]
        if remaining <= 0.0 or clock[STATUS] != RUNNING:
            return
        dt = equal_steps(remaining, clock[NEXT_STEP])
        noise = noise_rows(state.noise, k, step)
        error, kind = _try_step(state, k, noise, drift, rates, limits, trial, dt)
        planned = dt * step_factor(error)
        if not error <= 1.0 and _may_repeat(state.noise):
            reject(clock, until, planned, kind)
            continue
        accept_step(state, k, noise, rates, limits, trial, dt)
        accept(clock, until, dt, planned, kind)
        if not all_finite(state.velocity[k]):
            clock[STATUS] = NOT_FINITE


def advance(
    state: ParticleState, drift: Drift, rates: Rates, limits: Limits, until: float, steps: int
) -> None:
    """Move every realisation by at most `steps` trial steps, in place and never beyond `until`."""
    for_each(
        state.place.shape[0],
        lambda k: _advance_one(state, k, drift, rates, limits, until, steps),
    )

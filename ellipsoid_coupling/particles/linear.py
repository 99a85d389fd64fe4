"""The linear part of a particle's step, integrated exactly: drag, damping and noise.

With z = Gamma dt and a force that is linear in time, the exact solution of v' = F - Gamma v + A dW/dt
has the coefficients

    phi1 = (1 - e^{-z})/z      phi2 = (z - 1 + e^{-z})/z^2      phi3 = (z^2/2 - z + 1 - e^{-z})/z^3
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.particles.state import Rates

Floats = NDArray[np.float64]

# Below this z the closed forms lose digits to cancellation; the series does not. From 0.5 on they keep
# 14 digits, and 14 terms of the series reach rounding.
_SERIES_BELOW = 0.5
# Drag that damps less than this a step takes less energy than the position's correction would, see
# `exponential`: there the correction is left out, as without drag.
HARDLY_DAMPED = 3e-4


class LinearStep(NamedTuple):
    """The exact step's coefficients for one dt; `*_noise` multiply standard normal numbers.

    R_n = position_noise xi1, W_n = shared_noise xi1 + own_noise xi2. The error of a step without
    correction is position_missed times the force's change, of which position_change is corrected.
    """

    decay: float  # e^{-z}
    position_velocity: float  # dt phi1
    position_force: float  # dt^2 phi2
    position_change: float  # c dt^2 phi3, c of `exponential`
    position_missed: float  # dt^2 phi3
    velocity_force: float  # dt phi1
    velocity_change: float  # dt phi2
    position_noise: float  # Var(R_n)^(1/2)
    shared_noise: float  # Cov(R_n, W_n)/Var(R_n)^(1/2)
    own_noise: float  # what is left of Var(W_n)


@kernel
def phi_functions(z: float) -> tuple[float, float, float]:
    """phi1, phi2, phi3 of z >= 0, to rounding (phi_k = 1/k! - z phi_{k+1})."""
    if z == 0.0:  # straight ways and parabolas, of which walls are asked often
        return 1.0, 0.5, 1.0 / 6.0
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
def position_variance(z: float) -> float:
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
    """Coefficients of the exact linear step of length dt; see `exponential` for the correction's part."""
    z = damping * dt
    phi1, phi2, phi3 = phi_functions(z)
    spread, shared, own = 0.0, 0.0, 0.0
    # The correction's damping of the energy is that of the scheme; see `exponential` on c = 1 - e^{-z}.
    corrected = z * phi1 if noise > 0.0 or z < HARDLY_DAMPED else 1.0
    if noise > 0.0:
        # Var(W_n) = A^2 (1 - e^{-2z})/(2 Gamma), Cov(R_n, W_n) = A^2 (1 - e^{-z})^2/(2 Gamma^2).
        velocity_variance = noise * noise * dt * phi_functions(2.0 * z)[0]
        covariance = 0.5 * (noise * dt * phi1) ** 2
        spread = noise * math.sqrt(dt**3 * position_variance(z))
        shared = covariance / spread if spread > 0.0 else 0.0
        own = math.sqrt(max(velocity_variance - shared * shared, 0.0))
    return LinearStep(
        math.exp(-z),
        dt * phi1,
        dt * dt * phi2,
        dt * dt * phi3 * corrected,
        dt * dt * phi3,
        dt * phi1,
        dt * phi2,
        spread,
        shared,
        own,
    )


@kernel
def noise_of(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, i: int
) -> tuple[float, float]:
    """R_n and W_n of one degree of freedom; without noise no memory is touched."""
    if noise is None or not rates.first_noisy <= d < rates.last_noisy:
        return 0.0, 0.0
    # Two rows of normal numbers for each noisy degree of freedom.
    component = d - rates.first_noisy
    first = noise[2 * component, i]
    second = noise[2 * component + 1, i]
    return linear.position_noise * first, linear.shared_noise * first + linear.own_noise * second

"""How velocities change under a constant drift and linear damping: exactly, implicitly, or at once.

v' = F - Gamma v,        Gamma = gamma + A^2/2, and Gamma_bar of omega
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values, fill
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms


class Kick(NamedTuple):
    """V becomes decay v + gain F, each component with its own numbers, (2 or 3,)."""

    decay: Values
    gain: Values


def exact_kick(terms: CellTerms, dt: float, velocities: int) -> Kick:
    """The exact solution of v' = F - Gamma v over dt."""
    rates = dampings(terms, velocities)
    return Kick(
        tuple(math.exp(-rate * dt) for rate in rates), tuple(exact_gain(rate, dt) for rate in rates)
    )


def implicit_kick(terms: CellTerms, dt: float, velocities: int) -> Kick:
    """An implicit Euler step of it, v1 = (v + dt F)/(1 + dt Gamma); the paper's treatment."""
    # v1 (1 + dt Gamma) = v + dt F.
    decay = tuple(1.0 / (1.0 + dt * rate) for rate in dampings(terms, velocities))
    return Kick(decay, tuple(dt * one for one in decay))


def drift_velocity(terms: CellTerms, velocities: int) -> Kick:
    """V = F/Gamma, whatever it was; 0 of what nothing damps, which then has no such limit."""
    rates = dampings(terms, velocities)
    return Kick(fill(0.0, rates), tuple(1.0 / rate if rate > 0.0 else 0.0 for rate in rates))


def dampings(terms: CellTerms, velocities: int) -> Values:
    """Gamma, Gamma and, of three velocities, Gamma_bar."""
    return (terms.damping, terms.damping, terms.angular_damping)[:velocities]


def exact_gain(rate: float, dt: float) -> float:
    """The integral of exp(-rate s) over a step."""
    # 1 - e^{-z} would lose its digits where damping is weak.
    return -math.expm1(-rate * dt) / rate if rate else dt

"""Newton's descent of the free energy to a density that is in equilibrium with itself.

    F[q] = int q (log q + V + K q/2),      q > 0,  int q = 1,      K symmetric

is least, at least near by, where q = exp(-V - K q)/Z. The unknown is the potential psi of
q = exp(-V - psi)/Z, so that q stays positive. With means <a> = int q a, a change of log q by u (of
mean 0) has the slope <g u> and the curvature <u H u>:

    g = K q - psi - <K q - psi>,           H u = u + K(q u) - <K(q u)>

H is the identity without K, whatever q is, so that conjugate gradients need few steps; where they
meet a direction without curvature (a strong K has many equilibria) they stop there and go downhill.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_MOST_DIRECTIONS = 200
# A step may raise log q by so much at most where there is mass; lowering it is harmless.
_MOST_RISE, _MOST_FALL = 3.0, 200.0
_SUFFICIENT, _SHORTEST = 1e-4, 1e-6
# Rounding of F relative to itself.
_ROUNDING = 1e-13


class Problem(NamedTuple):
    """The equilibrium that is looked for.

    Attributes
    ----------
    boltzmann : callable
        psi -> (exp(-V - psi)/Z, log Z).
    image : callable
        q -> K q.
    volume : float
        Of a cell: integrals are sums times this.
    """

    boltzmann: Callable[[Floats], tuple[Floats, float]]
    image: Callable[[Floats], Floats]
    volume: float


class Point(NamedTuple):
    """A potential psi, its density q, K q, and F."""

    potential: Floats
    density: Floats
    image: Floats
    energy: float


def point_at(problem: Problem, potential: Floats) -> Point:
    """Everything that a step from `potential` needs."""
    density, log_constant = problem.boltzmann(potential)
    image = problem.image(density)
    # log q + V = -psi - log Z
    share = density * (0.5 * image - potential - log_constant)
    return Point(potential, density, image, float(share.sum()) * problem.volume)


def miss(problem: Problem, point: Point) -> float:
    """Int |exp(-V - K q)/Z - q|: 0 in equilibrium."""
    image, _ = problem.boltzmann(point.image)
    return float(np.abs(image - point.density).sum()) * problem.volume


def descend(problem: Problem, start: Point) -> Point:
    """One step of Newton's method, shortened until F falls as it should."""
    q, volume = start.density, problem.volume

    def dot(a: Floats, b: Floats) -> float:
        return float((q * a * b).sum()) * volume

    def centred(a: Floats) -> Floats:
        # Mass stays 1: a constant added to log q changes nothing.
        return np.asarray(a - float((q * a).sum()) * volume)

    gradient = centred(start.image - start.potential)
    newton = _newton(gradient, lambda u: centred(u + problem.image(q * u)), dot)
    # An all but empty cell may rise to a twentieth of the fullest at once.
    emptiness = np.log(q.max()) - np.log(np.maximum(q, np.finfo(np.float64).tiny))
    most = np.maximum(_MOST_RISE, emptiness - _MOST_RISE)
    found = start
    # Downhill where Newton's direction fails, as it may far from a minimum.
    for direction in (newton, -gradient):
        step = np.clip(direction, -_MOST_FALL, most)
        slope, length = dot(gradient, step), 1.0
        while length >= _SHORTEST:
            # psi falls where log q is to rise.
            found = point_at(problem, start.potential - length * step)
            # Near the minimum F falls by less than its own rounding, which must not refuse the last steps.
            enough = start.energy + _SUFFICIENT * length * slope + _ROUNDING * abs(start.energy)
            if found.energy <= enough:
                return found
            length *= 0.5
    return found


def _newton(
    gradient: Floats,
    curvature: Callable[[Floats], Floats],
    dot: Callable[[Floats, Floats], float],
) -> Floats:
    """-H^-1 g by conjugate gradients: roughly far away, exactly near by."""
    step, left = np.zeros_like(gradient), -gradient
    along, square = left, dot(left, left)
    # The smaller the gradient, the more exactly: a fixed part would make Newton's convergence linear.
    wanted = min(0.25, math.sqrt(square)) * square
    for _ in range(_MOST_DIRECTIONS):
        bent = curvature(along)
        curved = dot(along, bent)
        # `not >`: without curvature, with a negative one, or with none that is a number.
        if not curved > 1e-14 * dot(along, along):
            break
        step = step + square / curved * along
        left = left - square / curved * bent
        before, square = square, dot(left, left)
        if square <= wanted:
            break
        along = left + square / before * along
    # The first direction may have no curvature already.
    return step if step.any() else -gradient

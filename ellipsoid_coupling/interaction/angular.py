"""The pair potential and its gradients as Fourier series in both angles, as long as is asked for.

In the frame of the line that joins two particles, at a distance r apart,

    K(r, theta, thetabar) = sum_pq A_pq(r) b_p(theta) b_q(thetabar)
    b = 1, cos 2 theta, sin 2 theta, ..., cos 2M theta, sin 2M theta

for K = radial slope, tangential slope and dU/dtheta, and U itself. Turning the line by alpha turns
both angles: U(R delta, theta + alpha, thetabar + alpha) = U(delta, theta, thetabar), so one distance
serves all offsets of the grid that are as far.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.kernels import kernel, parallel_kernel
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

# Angles sampled per harmonic kept: three per wave of the highest harmonic kept, in each angle.
OVERSAMPLING = 6
LEAST_ANGLES = 64
# The search looks at some of the distances only; what it finds is checked on all of them.
SEARCH_DISTANCES = 32
# Distances sampled at once, times the square of the angles: bounds the memory to some 50 MB.
CHUNK = 500_000


class AngularSeries(NamedTuple):
    """The series of one particle shape on one grid spacing.

    Attributes
    ----------
    shape : PotentialShape
    h, tolerance : float
        The spacing and the tolerance that it was made for.
    harmonics : int
        M; there are 2M + 1 basis functions per angle.
    squares : (distances,) int64
        Squared distances in cells, ascending.
    coefficients : (distances, components, 2M + 1, 2M + 1) float64
        A_pq of the radial and tangential slope of U/eps0 and - unless circles - of dU/dtheta.
    norms, errors : (1 or 2,) float64
        For the force and - unless circles - the torque: the sum over all offsets of the kernel's
        largest absolute value over all angles, and the same of what the series leaves out.
    """

    shape: PotentialShape
    h: float
    tolerance: float
    harmonics: int
    squares: NDArray[np.int64]
    coefficients: Array
    norms: Array
    errors: Array


def angular_series(
    shape: PotentialShape, h: float, tolerance: float, most: int
) -> AngularSeries | None:
    """The shortest series whose error is within `tolerance`; None if that takes more than `most`.

    The error is that of `AngularSeries.errors`: with K_M the series cut after M harmonics,

        sum_offsets max_angles |K - K_M|  <=  tolerance * sum_offsets max_angles |K|

    for force and torque each. Hence the integral of `GridInteraction` is off by at most
    tolerance * max(density) * eps0 h^2 * norm anywhere, for any field of angles.
    """
    squares, offsets = _distances(shape, h)
    few = slice(None, None, max(1, squares.size // SEARCH_DISTANCES))

    def reaches(harmonics: int) -> bool:
        part = _expand(shape, h * np.sqrt(squares[few]), harmonics)
        errors, norms = offsets[few] @ part.misses, offsets[few] @ part.peaks
        return bool(np.all(errors <= tolerance * norms))

    harmonics = _first(reaches, most)
    while harmonics <= most:
        whole = _expand(shape, h * np.sqrt(squares), harmonics)
        norms, errors = offsets @ whole.peaks, offsets @ whole.misses
        if np.all(errors <= tolerance * norms):
            return AngularSeries(
                shape, h, tolerance, harmonics, squares, whole.coefficients, norms, errors
            )
        harmonics += 1
    return None


def _first(holds: Callable[[int], bool], most: int) -> int:
    """The least m in 0 .. most for which `holds`, most + 1 if none; it keeps holding beyond it."""
    low, high = -1, 0
    while not holds(high):
        if high == most:
            return most + 1
        low, high = high, min(2 * high + 2, most)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _distances(shape: PotentialShape, h: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Squared distances in cells that offsets within reach have, and how many offsets have each."""
    widths = half_widths(shape, h)
    reach = np.arange(1 - widths.size, widths.size)
    squares = reach[:, None] ** 2 + reach**2
    inside = np.abs(reach) <= widths[np.abs(reach)][:, None]
    distances, offsets = np.unique(squares[inside], return_counts=True)
    return distances, offsets


class _Expansion(NamedTuple):
    """Per distance: coefficients as in `AngularSeries`; largest force and torque, and errors."""

    coefficients: Array
    peaks: Array
    misses: Array


def potential_coefficients(series: AngularSeries) -> Array:
    """A_pq of U/eps0 itself up to the same harmonic: (distances, 1, 2M + 1, 2M + 1).

    The series of its gradients is the gradient of its series, so the error of that stays the same.
    """
    lattice, _, dual = _lattice(series.harmonics)
    coefficients = np.empty((series.squares.size, 1, len(dual), len(dual)))
    step = max(1, CHUNK // lattice.size**2)
    for first in range(0, series.squares.size, step):
        part = slice(first, min(first + step, series.squares.size))
        values = np.empty((part.stop - first, 1, lattice.size, lattice.size))
        _sample(series.h * np.sqrt(series.squares[part]), lattice, tuple(series.shape), 0, values)
        coefficients[part] = _on_both_sides(dual, values)
    return coefficients


def _lattice(harmonics: int) -> tuple[Array, Array, Array]:
    """Angles to sample, b_p there, and what gives coefficients: (n,), (2M + 1, n), (2M + 1, n)."""
    angles = max(LEAST_ANGLES, OVERSAMPLING * harmonics)
    lattice = np.pi * np.arange(angles) / angles
    basis = np.empty((2 * harmonics + 1, 1, angles))
    angular_basis(lattice[None, :], basis)
    basis = basis[:, 0]
    dual = basis * (2.0 / angles)
    dual[0] *= 0.5
    return lattice, basis, dual


def _expand(shape: PotentialShape, distances: Array, harmonics: int) -> _Expansion:
    lattice, basis, dual = _lattice(harmonics)
    angles = lattice.size
    components = 2 if shape.shape_factor == 0.0 else 3
    functions = 2 * harmonics + 1
    coefficients = np.empty((distances.size, components, functions, functions))
    peaks, misses = np.empty((2, distances.size, components - 1))
    step = max(1, CHUNK // angles**2)
    block = np.empty((min(step, distances.size), components, angles, angles))
    for first in range(0, distances.size, step):
        part = slice(first, min(first + step, distances.size))
        values = block[: part.stop - first]
        _sample(distances[part], lattice, tuple(shape), 1, values)
        coefficients[part] = _on_both_sides(dual, values)
        _largest(values, peaks[part])
        values -= _on_both_sides(basis.T, coefficients[part])
        _largest(values, misses[part])
    return _Expansion(coefficients, peaks, misses)


def _on_both_sides(matrix: Array, blocks: Array) -> Array:
    """For every block, matrix @ block @ matrix.T: two large products, not thousands of small."""
    half = blocks.reshape(-1, blocks.shape[-1]) @ matrix.T
    half = half.reshape(*blocks.shape[:-1], -1).swapaxes(-1, -2)
    whole = half.reshape(-1, blocks.shape[-1]) @ matrix.T
    return whole.reshape(*half.shape[:-1], -1).swapaxes(-1, -2)


@parallel_kernel
def _largest(block: Array, out: Array) -> None:
    """Largest length of the force and largest torque over all angles: (distances, 1 or 2)."""
    for k in numba.prange(block.shape[0]):
        force, torque = 0.0, 0.0
        for i in range(block.shape[2]):
            for j in range(block.shape[3]):
                force = max(force, block[k, 0, i, j] ** 2 + block[k, 1, i, j] ** 2)
                if out.shape[1] == 2:
                    torque = max(torque, abs(block[k, 2, i, j]))
        out[k, 0] = np.sqrt(force)
        if out.shape[1] == 2:
            out[k, 1] = torque


@parallel_kernel
def _sample(
    distances: Array, lattice: Array, shape: tuple[float, ...], first: int, out: Array
) -> None:
    """Entries of `pair_potential`, from `first` on, at (distance, theta, thetabar) of the lattice.

    The other particle lies in the x direction. out : (distances, entries, angles, angles)
    """
    shape_factor, size, reach, bluntness = shape
    cosines, sines = np.cos(2.0 * lattice), np.sin(2.0 * lattice)
    for k in numba.prange(distances.size):
        constants = PotentialShape(shape_factor, size, reach, bluntness)
        for i in range(lattice.size):
            target = cosines[i], sines[i]
            _sample_row(distances[k], target, (cosines, sines), constants, first, out[k, :, i])


@kernel
def _sample_row(
    distance: float,
    target: tuple[float, float],
    bar: tuple[Array, Array],
    shape: PotentialShape,
    first: int,
    out: Array,
) -> None:
    c2, s2 = target
    c2_bar, s2_bar = bar
    for j in range(c2_bar.size):
        values = pair_potential(distance, 0.0, c2, s2, c2_bar[j], s2_bar[j], shape)
        for c in range(out.shape[0]):
            out[c, j] = values[first + c]


@kernel
def angular_basis(angle: Array, out: NDArray[np.floating]) -> None:
    """b_p(angle) of every cell: `angle` (ny, nx) to `out` (2M + 1, ny, nx), single or double.

    The multiples follow by turning on, cos 2(k+1)a = cos 2ka cos 2a - sin 2ka sin 2a, in double.
    """
    for i in range(angle.shape[0]):
        row = angle[i]
        c2, s2 = np.empty(row.size), np.empty(row.size)
        for j in range(row.size):
            c2[j], s2[j] = cos_sin(2.0 * row[j])
        cosine, sine = c2.copy(), s2.copy()
        out[0, i] = 1.0
        for k in range(1, out.shape[0] // 2 + 1):
            even, uneven = out[2 * k - 1, i], out[2 * k, i]
            for j in range(c2.size):
                even[j], uneven[j] = cosine[j], sine[j]
                c, s = cosine[j], sine[j]
                cosine[j], sine[j] = c * c2[j] - s * s2[j], s * c2[j] + c * s2[j]

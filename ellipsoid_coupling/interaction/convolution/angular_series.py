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

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.simd_sums import sum_rows
from ellipsoid_coupling.compiled.threads import chunk_ranges, for_each
from ellipsoid_coupling.compiled.tuning import SERIES_TASKS
from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

# Angles sampled per harmonic of the series: three per wave of its highest harmonic, in each angle.
OVERSAMPLING = 6
LEAST_ANGLES = 64
# The search for the length of the series looks at some distances; its result is checked on all of them.
SEARCH_DISTANCES = 32
# From this error on it falls by ever less a harmonic (measured at aspects up to 20).
SLOWING = 0.5


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
    # Some distances, evenly spaced: the search evaluates many lengths.
    few = slice(None, None, max(1, squares.size // SEARCH_DISTANCES))
    # Both slopes of the potential and, unless circles, dU/dtheta.
    entries = (1, 2) if shape.shape_factor == 0.0 else (1, 2, 3)

    def error(harmonics: int) -> float:
        part = _expand(shape, h * np.sqrt(squares[few]), harmonics, entries, True)
        # Each distance as often as the disc of offsets has it.
        norms, errors = offsets[few] @ part.peaks, offsets[few] @ part.misses
        # Where no cell but a particle's own is within reach, there is nothing to miss.
        return float(np.max(errors / np.where(norms > 0.0, norms, 1.0)))

    harmonics = _first_within(error, tolerance, most)
    # A distance between those of the search may need one harmonic more.
    while harmonics <= most:
        whole = _expand(shape, h * np.sqrt(squares), harmonics, entries, True)
        norms, errors = offsets @ whole.peaks, offsets @ whole.misses
        if np.all(errors <= tolerance * norms):
            return AngularSeries(
                shape, h, tolerance, harmonics, squares, whole.coefficients, norms, errors
            )
        harmonics += 1
    return None


def _first_within(error: Callable[[int], float], tolerance: float, most: int) -> int:
    """The least m in 0 .. most whose error is within the tolerance, most + 1 if there is none.

    The error falls with m; below half it falls ever more slowly, down to rounding. Where even twice
    the pace of the last doubling would not do, longer series are not tried: they take minutes.
    """
    low, high, before = -1, 0, np.inf
    while (now := error(high)) > tolerance:
        if now < SLOWING and before < np.inf:
            # Decay of the logarithm of the error, a harmonic; it only slows down.
            pace = max(np.log(before / now), 0.0) / (high - low)
            if np.log(now / tolerance) > 2.0 * pace * (most - high):
                return most + 1
        if high == most:
            return most + 1
        # By doubling, and then by halving between the last two lengths.
        low, high, before = high, min(2 * high + 2, most), now
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if error(middle) <= tolerance else (middle, high)
    return high


def _distances(shape: PotentialShape, h: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Squared distances in cells that offsets within reach have, and how many offsets have each."""
    widths = half_widths(shape, h)
    # All offsets of the disc, sorted by distance: one expansion serves all of one distance.
    reach = np.arange(1 - widths.size, widths.size)
    squares = reach[:, None] ** 2 + reach**2
    inside = np.abs(reach) <= widths[np.abs(reach)][:, None]
    distances, offsets = np.unique(squares[inside], return_counts=True)
    return distances, offsets


class _Expansion(NamedTuple):
    """At each distance coefficients as in `AngularSeries`; largest force and torque, and errors."""

    coefficients: Array
    peaks: Array
    misses: Array


def potential_coefficients(series: AngularSeries) -> Array:
    """A_pq of U/eps0 itself up to the same harmonic: (distances, 1, 2M + 1, 2M + 1).

    The series of its gradients is the gradient of its series, so the error of that stays the same.
    """
    distances = series.h * np.sqrt(series.squares)
    return _expand(series.shape, distances, series.harmonics, (0,), False).coefficients


class _Lattice(NamedTuple):
    """Angles to sample both particles at, and the basis functions there.

    angles : (n,)
    dual : (F, n), coefficient p of values at the angles is dual[p] @ values; F = 2M + 1
    dual_columns : (n, F or more), its transpose and zeros
    basis_columns : (n, F), b_p at the angles
    basis : (F or more, n), its transpose and zeros
    """

    angles: Array
    dual: Array
    dual_columns: Array
    basis_columns: Array
    basis: Array


def _lattice(harmonics: int) -> _Lattice:
    functions = 2 * harmonics + 1
    angles = round_up_to_vectors(max(LEAST_ANGLES, OVERSAMPLING * harmonics))
    # The potential is pi-periodic in each angle, so half a turn is sampled.
    lattice = np.pi * np.arange(angles) / angles
    # Zeros to the end of a vector, which sums in registers read.
    basis = np.zeros((round_up_to_vectors(functions), angles))
    angular_basis(lattice[None, :], basis[:functions, None])
    dual = basis * (2.0 / angles)
    # Discrete orthogonality: the mean of 1 is twice that of cos^2 and sin^2.
    dual[0] *= 0.5
    columns = np.ascontiguousarray(basis[:functions].T)
    return _Lattice(lattice, dual[:functions].copy(), np.ascontiguousarray(dual.T), columns, basis)


def _expand(
    shape: PotentialShape,
    distances: Array,
    harmonics: int,
    entries: tuple[int, ...],
    measured: bool,
) -> _Expansion:
    """Of these entries of `pair_potential`; with `measured`, peaks and misses as well."""
    # Both slopes are one force: one measure less than there are entries.
    functions, measures = 2 * harmonics + 1, len(entries) - 1 if measured else 0
    coefficients = np.empty((distances.size, len(entries), functions, functions))
    peaks, misses = np.empty((2, distances.size, measures))
    parts = [slice(*part) for part in chunk_ranges(distances.size, SERIES_TASKS)]
    lattice, first = _lattice(harmonics), entries[0]

    def some(k: int) -> None:
        out = coefficients[parts[k]], peaks[parts[k]], misses[parts[k]]
        _expand_some(distances[parts[k]], lattice, shape, first, out)

    for_each(len(parts), some)
    return _Expansion(coefficients, peaks, misses)


@kernel
def _expand_some(
    distances: Array,
    lattice: _Lattice,
    shape: PotentialShape,
    first: int,
    out: tuple[Array, Array, Array],
) -> None:
    """See `_Expansion`, for entries of `pair_potential` from `first` on; no peaks where they are empty."""
    coefficients, peaks, misses = out
    components, functions = coefficients.shape[1:3]
    n, padded = lattice.angles.size, lattice.basis.shape[0]
    cosines, sines = np.empty(n), np.empty(n)
    for i in range(n):
        cosines[i], sines[i] = cos_sin(2.0 * lattice.angles[i])
    # The arrays of one distance stay in cache.
    row, values, again = np.empty((4, n)), np.empty((components, n, n)), np.empty((n, n))
    half, series = np.empty((functions, n)), np.empty((functions, padded))
    other = np.empty((n, padded))
    for k in range(distances.size):
        for i in range(n):
            _sample_row(distances[k], (cosines[i], sines[i]), (cosines, sines), shape, row)
            for c in range(components):
                _copy(row[first + c], values[c, i])
        if peaks.shape[1] > 0:
            _set_largest(values, peaks[k])
        for c in range(components):
            # A_pq = dual values dual^T, a product of small matrices in cache.
            sum_rows(lattice.dual, values[c], half)
            sum_rows(half, lattice.dual_columns, series)
            for p in range(functions):
                _copy(series[p], coefficients[k, c, p])
            if peaks.shape[1] > 0:
                # The series at the lattice; its difference from the samples is the error.
                sum_rows(lattice.basis_columns, series, other)
                sum_rows(other, lattice.basis, again)
                for i in range(n):
                    _subtract(again[i], values[c, i])
        if peaks.shape[1] > 0:
            _set_largest(values, misses[k])


@kernel(noalias=True)
def _copy(row: Array, out: Array) -> None:
    for j in range(out.size):
        out[j] = row[j]


@kernel(noalias=True)
def _subtract(row: Array, out: Array) -> None:
    for j in range(out.size):
        out[j] -= row[j]


@kernel(noalias=True)
def _set_largest(values: Array, out: Array) -> None:
    """Largest length of the force and largest torque over all angles: out (1 or 2,)."""
    force, torque = 0.0, 0.0
    for i in range(values.shape[1]):
        for j in range(values.shape[2]):
            force = max(force, values[0, i, j] ** 2 + values[1, i, j] ** 2)
            if out.size == 2:
                torque = max(torque, abs(values[2, i, j]))
    # Squares up to here: one root for all angles.
    out[0] = np.sqrt(force)
    if out.size == 2:
        out[1] = torque


@kernel(noalias=True)
def _sample_row(
    distance: float,
    target: tuple[float, float],
    bar: tuple[Array, Array],
    shape: PotentialShape,
    out: Array,
) -> None:
    """All entries of `pair_potential` at every thetabar, (4, n); the other particle lies along x."""
    c2, s2 = target
    c2_bar, s2_bar = bar
    potential, slope_x, slope_y, torque = out[0], out[1], out[2], out[3]
    for j in range(c2_bar.size):
        potential[j], slope_x[j], slope_y[j], torque[j] = pair_potential(
            distance, 0.0, c2, s2, c2_bar[j], s2_bar[j], shape
        )


@kernel
def angular_basis(angle: Array, out: NDArray[np.floating]) -> None:
    """b_p(angle) of every cell: `angle` (ny, nx) to `out` (2M + 1, ny, nx), single or double.

    Multiples follow by adding angles, cos 2(k+1)a = cos 2ka cos 2a - sin 2ka sin 2a, in double.
    """
    for i in range(angle.shape[0]):
        row = angle[i]
        c2, s2 = np.empty(row.size), np.empty(row.size)
        for j in range(row.size):
            c2[j], s2[j] = cos_sin(2.0 * row[j])
        cosine, sine = c2.copy(), s2.copy()
        out[0, i] = 1.0
        # Rounding of this recurrence grows like k eps: 1e-14 for the longest series.
        for k in range(1, out.shape[0] // 2 + 1):
            even, uneven = out[2 * k - 1, i], out[2 * k, i]
            for j in range(c2.size):
                even[j], uneven[j] = cosine[j], sine[j]
                c, s = cosine[j], sine[j]
                cosine[j], sine[j] = c * c2[j] - s * s2[j], s * c2[j] + c * s2[j]

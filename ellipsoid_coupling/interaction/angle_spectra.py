"""The kernels on an (angle, y, x) grid, Fourier transformed in space: a dense block per frequency.

K_ab(delta), the potential or one of its derivatives between angle cells a and b, is even
(potential, torque) or odd (force) in delta, so that its transform is real, or i times real,

    sum_delta K_ab e^{i k delta} = sum_delta K_ab cos(k delta)  or  i sum_delta K_ab sin(k delta)

Angle cells are centred on multiples of their width, so that y -> -y maps cell a to cell -a:

    K_ab(k_x, -k_y) = +-K_{-a,-b}(k_x, k_y)

and ky >= 0 is enough. Mass that fills a part of the grid needs shorter transforms only: the sampled
kernels are kept (`AngleKernels`), and their spectra made for one length of a `Ladder` at a time.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.instructions import fused
from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.interaction.ladder import Ladder
from ellipsoid_coupling.interaction.spectra import (
    Indices,
    Precision,
    Real,
    in_lines,
    lines_and_lanes,
)
from ellipsoid_coupling.kernels import kernel, parallel_kernel, view_kernel
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

Quantity = Literal["forces", "potential"]

# Blocks larger than this are not made.
MOST_BYTES = 3e9


class AngleSpectra(NamedTuple):
    """The transformed kernels.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, lines, n, n, lanes) float64 or float32
        Axis order (ky, component, kx, target angle, source angle, kx), see `lines_and_lanes`;
        without the factor i of the force; scaled with the given factor.
    padded : (Py, Px)
        Lengths of the transforms, even.
    """

    blocks: Real
    padded: tuple[int, int]


class _Component(NamedTuple):
    """Which entry of `pair_potential` a component is, and its parities."""

    entry: int
    odd: int
    mirrored: int


_POTENTIAL = (_Component(0, 0, 1),)
_FORCE = (_Component(1, 1, 1), _Component(2, 1, -1))
_TORQUE = (_Component(3, 0, -1),)


def distinct_angles(angles: int, shape: PotentialShape) -> int:
    """How many of `angles` cells in [0, 2 pi) the potential tells apart: half of an even number.

    The potential is pi-periodic; circles have no angle at all.
    """
    if shape.shape_factor == 0.0:
        return 1
    return angles // 2 if angles % 2 == 0 else angles


class AngleKernels:
    """`scale` times the potential's gradient, or the potential, and its spectra.

    Parameters
    ----------
    grid_shape : (angles, ny, nx)
    h : float
        Spacing in x and y.
    shape : PotentialShape
    scale : float
        Factor on everything; -eps0 h^2 k makes forces.
    quantity : "forces" or "potential"
        d/dx, d/dy and - unless circles - d/dtheta; or U.
    precision : np.float32 or np.float64
        What the blocks are kept in; they are computed in double precision.

    Attributes
    ----------
    odd, mirrored : (components,) int64
        1 where the kernel is odd in delta, else 0; its sign, 1 or -1, under y -> -y.

    Raises
    ------
    InputError
        If the blocks of the whole grid take more than 3 GB.
    """

    def __init__(
        self,
        grid_shape: tuple[int, int, int],
        h: float,
        shape: PotentialShape,
        scale: float,
        quantity: Quantity,
        precision: Precision = np.float64,
    ) -> None:
        angles, ny, nx = grid_shape
        widths = half_widths(shape, h)
        self._cells, self._precision = widths.size - 1, precision
        self._ladder = Ladder((ny, nx), self._cells, self._make)
        torque = () if shape.shape_factor == 0.0 else _TORQUE
        self._components = _POTENTIAL if quantity == "potential" else _FORCE + torque
        self.odd, self.mirrored = np.array([[c.odd, c.mirrored] for c in self._components]).T.copy()
        n = distinct_angles(angles, shape)
        _check_memory(self._block_shape(self._ladder.longest, n), grid_shape, precision)
        double = 2.0 * np.pi * np.arange(n) / n * (2 if angles % 2 and n > 1 else 1)
        turned = np.cos(double), np.sin(double)
        offsets = self._cells + 1, 2 * self._cells + 1
        self._samples = np.zeros((len(self._components), n, n, *offsets))
        for component, samples in zip(self._components, self._samples, strict=True):
            _sample(h, widths, tuple(shape), *turned, component.entry, samples)
        self._samples *= scale

    def _block_shape(self, padded: tuple[int, int], n: int) -> tuple[int, ...]:
        lines, lanes = lines_and_lanes(padded[1] // 2 + 1, self._precision)
        return padded[0] // 2 + 1, len(self._components), lines, n, n, lanes

    def spectra(self, rows: int, columns: int) -> AngleSpectra:
        """For so many rows and columns of occupied cells; see `Ladder`."""
        return self._ladder.fitting(rows, columns)

    def _make(self, padded: tuple[int, int]) -> AngleSpectra:
        n = self._samples.shape[1]
        blocks: Real = np.empty(self._block_shape(padded, n), self._precision)
        _transform(self._samples, padded, self.odd, blocks)
        return AngleSpectra(blocks, padded)


def _check_memory(
    size: tuple[int, ...], grid_shape: tuple[int, int, int], precision: Precision
) -> None:
    needed = np.dtype(precision).itemsize * float(np.prod(size, dtype=np.float64))
    if needed > MOST_BYTES:
        raise InputError(
            "interaction on the (angle, y, x) grid",
            f"blocks of at most {MOST_BYTES / 1e9:g} GB",
            f"{needed / 1e9:.1f} GB for a grid of {grid_shape}",
            "Take fewer angle cells or larger cells.",
        )


def _transform(samples: Array, padded: tuple[int, int], odd: Indices, blocks: Real) -> None:
    """The cosine or sine sum of half the offsets, (components, n, n, R + 1, 2 R + 1), to `blocks`.

    Offsets with j < 0 mirror those with j > 0, which therefore count twice.
    """
    cells = samples.shape[3] - 1
    kx, ky = np.arange(blocks.shape[2] * blocks.shape[5]), np.arange(blocks.shape[0])
    along = _waves(np.arange(-cells, cells + 1), kx, padded[1])
    # Frequencies that only fill the last line.
    along[..., padded[1] // 2 + 1 :] = 0.0
    cosine, sine = _waves(np.arange(cells + 1), ky, padded[0])
    # cos(a + b) and sin(a + b) from those of a and b.
    across = np.array([[cosine, -sine], [sine, cosine]])
    across[:, :, 1:] *= 2.0
    _add_rows(samples, np.hstack([*along]), across, odd, blocks)


@parallel_kernel
def _add_rows(samples: Array, along: Array, across: Array, odd: Indices, blocks: Real) -> None:
    """block[ky, c, a] = sum_j across[odd, :, j, ky] . sum_i along[i, kx] samples[c, a, b, j, i].

    along : (2 R + 1, twice kx), cosines and sines; across : (2, 2, R + 1, ky), with the parity first
    """
    components, n, cells = samples.shape[0], samples.shape[1], samples.shape[3]
    lines, lanes = blocks.shape[2], blocks.shape[5]
    for task in numba.prange(components * n):
        c, a = task // n, task % n
        # All that one target angle needs stays in cache while ky runs, in the order of the blocks.
        parts = np.empty((2, cells, lines, n, lanes))
        room = np.empty(along.shape[1])
        for b in range(n):
            _add_columns(samples[c, a, b], along, room, parts[..., b, :])
        rows, total = parts.reshape(2, cells, lines, -1), np.empty(n * lanes)
        for line in range(lines):
            for ky in range(blocks.shape[0]):
                _add_parts(rows, line, across[odd[c], :, :, ky], total)
                blocks[ky, c, line, a].ravel()[:] = total


@view_kernel
def _add_columns(samples: Array, along: Array, room: Array, parts: Array) -> None:
    """parts[:, j] = sum_i along[i, :] samples[j, i], the cosines' sum and the sines'."""
    half = room.size // 2
    for j in range(samples.shape[0]):
        room[:] = 0.0
        for i in range(samples.shape[1]):
            sample, waves = samples[j, i], along[i]
            for k in range(room.size):
                room[k] = fused(sample, waves[k], room[k])
        in_lines(room[:half], parts[0, j])
        in_lines(room[half:], parts[1, j])


@view_kernel
def _add_parts(rows: Array, line: int, weights: Array, total: Array) -> None:
    """Set total to sum_j weights[0, j] rows[0, j, line, :] + weights[1, j] rows[1, j, line, :]."""
    total[:] = 0.0
    for j in range(rows.shape[1]):
        first, second = weights[0, j], weights[1, j]
        even, uneven = rows[0, j, line], rows[1, j, line]
        for k in range(total.size):
            total[k] = fused(first, even[k], fused(second, uneven[k], total[k]))


def _waves(offsets: Indices, frequency: Indices, length: int) -> Array:
    """Cosine and sine of every offset at every frequency, (2, offsets, frequencies)."""
    # Whole turns are taken off in integers, so that nothing is lost to rounding.
    phase = 2.0 * np.pi / length * (offsets[:, None] * frequency % length)
    return np.array([np.cos(phase), np.sin(phase)])


@parallel_kernel
def _sample(
    h: float,
    widths: NDArray[np.int64],
    shape: tuple[float, ...],
    cosines: Array,
    sines: Array,
    entry: int,
    out: Array,
) -> None:
    """One entry of `pair_potential` at the offsets (j, i), j >= 0: out[a, b, j, R + i]."""
    shape_factor, size, reach, bluntness = shape
    n = cosines.size
    for task in numba.prange(out.shape[2] * n):
        j, a = task // n, task % n
        constants = PotentialShape(shape_factor, size, reach, bluntness)
        _sample_offsets((h, j, widths[j], entry), (cosines, sines), a, constants, out[a, :, j])


@kernel
def _sample_offsets(
    row: tuple[float, int, int, int],
    angles: tuple[Array, Array],
    a: int,
    shape: PotentialShape,
    out: Array,
) -> None:
    h, j, width, entry = row
    cosines, sines = angles
    middle = out.shape[1] // 2
    for b in range(cosines.size):
        for i in range(-width, width + 1):
            values = pair_potential(i * h, j * h, cosines[a], sines[a], cosines[b], sines[b], shape)
            out[b, middle + i] = values[entry]

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
from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.interaction.ladder import Ladder
from ellipsoid_coupling.interaction.spectra import (
    Indices,
    Precision,
    Real,
    in_lines,
    lines_and_lanes,
)
from ellipsoid_coupling.kernels import kernel, parallel_kernel
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

Quantity = Literal["forces", "potential"]

# Blocks larger than this are not made.
MOST_BYTES = 3e9


class AngleSpectra(NamedTuple):
    """The transformed kernels.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, n, lines, n, lanes) float64 or float32
        Axis order (ky, component, target angle, kx, source angle, kx), see `lines_and_lanes`;
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
        return padded[0] // 2 + 1, len(self._components), n, lines, n, lanes

    def spectra(self, rows: int, columns: int) -> AngleSpectra:
        """For so many rows and columns of occupied cells; see `Ladder`."""
        return self._ladder.fitting(rows, columns)

    def _make(self, padded: tuple[int, int]) -> AngleSpectra:
        n = self._samples.shape[1]
        blocks: Real = np.empty(self._block_shape(padded, n), self._precision)
        for c, (samples, odd) in enumerate(zip(self._samples, self.odd, strict=True)):
            _transform(samples, padded, odd, blocks, c)
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


def _transform(samples: Array, padded: tuple[int, int], odd: int, blocks: Real, c: int) -> None:
    """The cosine or sine sum of half the offsets, (n, n, R + 1, 2 R + 1): blocks[:, c] overwritten.

    Offsets with j < 0 mirror those with j > 0, which therefore count twice.
    """
    cells = samples.shape[2] - 1
    kx, ky = np.arange(padded[1] // 2 + 1), np.arange(padded[0] // 2 + 1)
    along = _waves(np.arange(-cells, cells + 1), kx, padded[1])
    across = _waves(np.arange(cells + 1), ky, padded[0])
    for waves in across:
        waves[1:] *= 2.0
    rows = samples.reshape(-1, samples.shape[-1])
    cosine, sine = (rows @ waves for waves in along)
    shape = *samples.shape[:3], kx.size
    # cos(a + b) and sin(a + b) from those of a and b.
    pair = (across[1], across[0]) if odd else (across[0], -across[1])
    _add_rows(cosine.reshape(shape), sine.reshape(shape), *pair, blocks, c)


@parallel_kernel
def _add_rows(
    cosine: Array, sine: Array, with_cosine: Array, with_sine: Array, blocks: Real, c: int
) -> None:
    """block[ky, c] = sum_j with_cosine[j, ky] cosine[..., j, :] + with_sine[j, ky] sine[..., j, :]."""
    for ky in numba.prange(blocks.shape[0]):
        n, width = cosine.shape[0], cosine.shape[3]
        padded = np.zeros(blocks.shape[3] * blocks.shape[5])
        total = padded[:width]
        for a in range(n):
            for b in range(n):
                total[:] = 0.0
                for j in range(cosine.shape[2]):
                    first, second = with_cosine[j, ky], with_sine[j, ky]
                    even, uneven = cosine[a, b, j], sine[a, b, j]
                    for k in range(width):
                        total[k] += first * even[k] + second * uneven[k]
                in_lines(padded, blocks[ky, c, a, :, b])


def _waves(offsets: Indices, frequency: Indices, length: int) -> tuple[Array, Array]:
    """Cosine and sine of every offset at every frequency, (offsets, frequencies)."""
    # Whole turns are taken off in integers, so that nothing is lost to rounding.
    phase = 2.0 * np.pi / length * (offsets[:, None] * frequency % length)
    return np.cos(phase), np.sin(phase)


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

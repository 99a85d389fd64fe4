"""The kernels on an (angle, y, x) grid, Fourier transformed in space: a dense block per frequency.

K_ab(delta), the potential or one of its derivatives between angle cells a and b, is even
(potential, torque) or odd (force) in delta, so that its transform is real, or i times real,

    sum_delta K_ab e^{i k delta} = sum_delta K_ab cos(k delta)  or  i sum_delta K_ab sin(k delta)

Angle cells are centred on multiples of their width, so that y -> -y maps cell a to cell -a:

    K_ab(k_x, -k_y) = +-K_{-a,-b}(k_x, k_y)

and ky >= 0 is enough. Mass that fills a part of the grid needs shorter transforms only: the sampled
kernels are kept (`AngleKernels`), and transformed to one length of a `Ladder` at a time.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.simd_sums import sum_rows
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution.fft_lengths import longest_lengths
from ellipsoid_coupling.interaction.convolution.kernel_spectra import (
    Indices,
    Lengths,
    Precision,
    Real,
    deal_out,
    lines_and_lanes,
)
from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

Quantity = Literal["forces", "potential"]

# Blocks larger than this are not made.
MOST_BYTES = 3e9


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
    """`scale` times the potential's gradient, or the potential, to be transformed to any length.

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
    cells : int
        Reach of the potential in cells.
    precision

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
        self.precision, self.cells = precision, widths.size - 1
        torque = () if shape.shape_factor == 0.0 else _TORQUE
        self._components = _POTENTIAL if quantity == "potential" else _FORCE + torque
        self.odd, self.mirrored = np.array([[c.odd, c.mirrored] for c in self._components]).T.copy()
        self._angles = n = distinct_angles(angles, shape)
        longest = longest_lengths((ny, nx), self.cells)
        _check_memory(self.block_shape(longest), grid_shape, precision)
        double = 2.0 * np.pi * np.arange(n) / n * (2 if angles % 2 and n > 1 else 1)
        turned = np.cos(double), np.sin(double)
        offsets = widths.size, 2 * widths.size - 1
        self._samples = np.zeros((len(self._components), n, n, *offsets))
        for component, samples in zip(self._components, self._samples, strict=True):
            _sample(h, widths, tuple(shape), *turned, component.entry, samples)
        self._samples *= scale

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """See `Spectra`."""
        lines, lanes = lines_and_lanes(padded[1] // 2 + 1, self.precision)
        return padded[0] // 2 + 1, len(self._components), lines, self._angles, self._angles, lanes

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """The cosine or sine sum over all offsets, to `blocks` of `block_shape`.

        Offsets with j < 0 mirror those with j > 0, which therefore count twice.
        """
        cells, lanes = self._samples.shape[3] - 1, blocks.shape[5]
        kx, ky = np.arange(blocks.shape[2] * lanes), np.arange(blocks.shape[0])
        along = _waves(np.arange(-cells, cells + 1), kx, padded[1])
        # Frequencies that only fill the last line.
        along[..., padded[1] // 2 + 1 :] = 0.0
        by_turns = along.reshape(2, 2 * cells + 1, -1, lanes).transpose(1, 2, 0, 3)
        cosine, sine = _waves(np.arange(cells + 1), ky, padded[0]).swapaxes(1, 2)
        for wave in (cosine, sine):
            wave[:, 1:] *= 2.0
        # cos(a + b) and sin(a + b) from those of a and b.
        across = np.array([np.hstack([cosine, -sine]), np.hstack([sine, cosine])])
        columns = by_turns.reshape(2 * cells + 1, -1)
        _add_rows(self._samples, columns, across, self.odd, blocks)


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


@parallel_kernel
def _add_rows(samples: Array, along: Array, across: Array, odd: Indices, blocks: Real) -> None:
    """block[ky, c, a] = sum_j across[odd, ky, j] . sum_i along[i, kx] samples[c, a, b, j, i].

    along : (2 R + 1, twice kx), a line of cosines and one of sines by turns; across : (2, ky, twice
    R + 1), the parity first.
    """
    components, n, cells = samples.shape[0], samples.shape[1], samples.shape[3]
    lines, lanes = blocks.shape[2], blocks.shape[5]
    for task in numba.prange(components * n):
        c, a = task // n, task % n
        # All that one target angle needs stays in cache while ky runs, in the order of the blocks.
        parts = np.empty((2 * lines, cells, n, lanes))
        room = np.empty((cells, along.shape[1]))
        for b in range(n):
            sum_rows(samples[c, a, b], along, room)
            deal_out(room, parts[:, :, b])
        sums = np.empty((blocks.shape[0], n * lanes))
        for line in range(lines):
            both = parts[2 * line : 2 * line + 2].reshape(2 * cells, n * lanes)
            sum_rows(across[odd[c]], both, sums)
            for ky in range(blocks.shape[0]):
                blocks[ky, c, line, a].ravel()[:] = sums[ky]


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

"""The kernels on an (angle, y, x) grid, Fourier transformed in space: a dense block per frequency.

K_ab(delta), the potential or one of its derivatives between angle cells a and b, is even
(potential, torque) or odd (force) in delta, so that its transform is real, or i times real,

    sum_delta K_ab e^{i k delta} = sum_delta K_ab cos(k delta)  or  i sum_delta K_ab sin(k delta)

Angle cells are centred on multiples of their width, so that y -> -y maps cell a to cell -a:

    K_ab(k_x, -k_y) = +-K_{-a,-b}(k_x, k_y)

and ky >= 0 is enough (`spectra`). Mass that fills a part of the grid needs shorter transforms only: the
sampled kernels stay in memory, and are transformed to the lengths that `fft_lengths` asks for.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution.fft_lengths import longest_lengths
from ellipsoid_coupling.interaction.convolution.spectra import (
    Lengths,
    Precision,
    Real,
    lines_and_lanes,
    transform_blocks,
    waves,
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


# U is even in everything; each derivative changes the sign under the reflection of its own coordinate,
# and y -> -y turns the angle round as well.
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
        Of the blocks; they are computed in double precision.

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
        # Checked before anything is made: the blocks are the largest arrays of a run.
        longest = longest_lengths((ny, nx), self.cells)
        _check_memory(self.block_shape(longest), grid_shape, precision)
        # Twice the angle goes around once over the n of an even number of cells, twice over an odd one.
        double = 2.0 * np.pi * np.arange(n) / n * (2 if angles % 2 and n > 1 else 1)
        turned = np.cos(double), np.sin(double)
        offsets = widths.size, 2 * widths.size - 1
        # Offsets with j >= 0 only; those with j < 0 are mirror images.
        self._samples = np.zeros((len(self._components), n, n, *offsets))
        for component, samples in zip(self._components, self._samples, strict=True):
            _sample(h, widths, shape, *turned, component.entry, samples)
        self._samples *= scale

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """See `Spectra`."""
        lines, lanes = lines_and_lanes(padded[1] // 2 + 1, self.precision)
        return padded[0] // 2 + 1, len(self._components), lines, self._angles, self._angles, lanes

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """The cosine or sine sum over all offsets, to `blocks` of `block_shape`.

        Offsets with j < 0 mirror those with j > 0, which therefore count twice.
        """
        cells = self.cells
        kx, ky = np.arange(blocks.shape[2] * blocks.shape[5]), np.arange(blocks.shape[0])
        along = waves(np.arange(-cells, cells + 1), kx, padded[1])
        # Frequencies that only fill the last line.
        along[..., padded[1] // 2 + 1 :] = 0.0
        cosine, sine = waves(np.arange(cells + 1), ky, padded[0]).swapaxes(1, 2)
        # j and -j give the same, but for j = 0.
        for wave in (cosine, sine):
            wave[:, 1:] *= 2.0
        # cos(a + b) = cos a cos b - sin a sin b and sin(a + b) likewise: both kinds along x for each.
        across = np.array([np.hstack([cosine, -sine]), np.hstack([sine, cosine])])
        which = np.zeros((*self._samples.shape[:3], 2), np.int64)
        # The first kind across makes sums of cosines, the second one of sines.
        which[..., 1] = self.odd[:, None, None]
        transform_blocks(self._samples, along, across, which, blocks)


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
def _sample(
    h: float,
    widths: NDArray[np.int64],
    shape: PotentialShape,
    cosines: Array,
    sines: Array,
    entry: int,
    out: Array,
) -> None:
    """One entry of `pair_potential` at the offsets (j, i), j >= 0: out[a, b, j, R + i]."""
    n = cosines.size
    for task in numba.prange(out.shape[2] * n):
        j, a = task // n, task % n
        _sample_offsets((h, j, widths[j], entry), (cosines, sines), a, shape, out[a, :, j])


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
    # Offset i = 0.
    middle = out.shape[1] // 2
    for b in range(cosines.size):
        for i in range(-width, width + 1):
            values = pair_potential(i * h, j * h, cosines[a], sines[a], cosines[b], sines[b], shape)
            out[b, middle + i] = values[entry]

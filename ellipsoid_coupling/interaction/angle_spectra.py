"""The kernels on an (angle, y, x) grid, Fourier transformed in space: a dense block per frequency.

K_ab(delta), the potential or one of its derivatives between angle cells a and b, is even
(potential, torque) or odd (force) in delta, so that its transform is real, or i times real,

    sum_delta K_ab e^{i k delta} = sum_delta K_ab cos(k delta)  or  i sum_delta K_ab sin(k delta)

Angle cells are centred on multiples of their width, so that y -> -y maps cell a to cell -a:

    K_ab(k_x, -k_y) = +-K_{-a,-b}(k_x, k_y)

and ky >= 0 is enough. Frequencies are ordered as in `spectra`, so that thinned-out ones come first.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.grid_forces import Array, half_widths
from ellipsoid_coupling.interaction.spectra import LANES, Indices, Precision, Real, padded_length
from ellipsoid_coupling.kernels import kernel, parallel_kernel
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

Quantity = Literal["forces", "potential"]

# Blocks larger than this are not made.
MOST_BYTES = 3e9


class AngleSpectra(NamedTuple):
    """The transformed kernels.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, n, n, padded Px//2 + 1) float64 or float32
        Axis order (ky, component, target angle, source angle, kx), without the factor i of the
        force; scaled with the given factor.
    odd, mirrored : (components,) int64
        1 where the kernel is odd in delta, else 0; its sign, 1 or -1, under y -> -y.
    padded : (Py, Px)
        Lengths of the transforms, multiples of 4.
    cells : int
        Reach of the potential in cells.
    order : (Px//2 + 1,) int64
        kx of the last axis.
    """

    blocks: Real
    odd: Indices
    mirrored: Indices
    padded: tuple[int, int]
    cells: int
    order: Indices


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


def angle_spectra(
    grid_shape: tuple[int, int, int],
    h: float,
    shape: PotentialShape,
    scale: float,
    quantity: Quantity,
    precision: Precision = np.float64,
) -> AngleSpectra:
    """The spectra of `scale` times the potential's gradient, or the potential.

    Parameters
    ----------
    grid_shape : (angles, ny, nx)
    h : float
        Spacing in x and y.
    scale : float
        Factor on everything; -eps0 h^2 k makes forces.
    quantity : "forces" or "potential"
        d/dx, d/dy and - unless circles - d/dtheta; or U.
    precision : np.float32 or np.float64
        What the blocks are kept in; they are computed in double precision.

    Raises
    ------
    InputError
        If the blocks take more than 3 GB.
    """
    angles, ny, nx = grid_shape
    n = distinct_angles(angles, shape)
    widths = half_widths(shape, h)
    cells = widths.size - 1
    padded = padded_length(ny, cells), padded_length(nx, cells)
    torque = () if shape.shape_factor == 0.0 else _TORQUE
    components = _POTENTIAL if quantity == "potential" else _FORCE + torque
    kx = np.arange(padded[1] // 2 + 1)
    order = np.concatenate([kx[0::4], kx[2::4], kx[1::2]])
    columns = -(-kx.size // LANES) * LANES
    size = padded[0] // 2 + 1, len(components), n, n, columns
    _check_memory(size, grid_shape, precision)
    double = 2.0 * np.pi * np.arange(n) / n * (2 if angles % 2 and n > 1 else 1)
    blocks: Real = np.zeros(size, precision)
    for c, component in enumerate(components):
        samples = np.zeros((cells + 1, n, n, 2 * cells + 1))
        turned = np.cos(double), np.sin(double)
        _sample(h, widths, tuple(shape), *turned, component.entry, samples)
        blocks[:, c, ..., : kx.size] = scale * _transform(samples, order, padded, component.odd)
    odd, mirrored = np.array([[c.odd, c.mirrored] for c in components]).T.copy()
    return AngleSpectra(blocks, odd, mirrored, padded, cells, order)


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


def _transform(samples: Array, order: Indices, padded: tuple[int, int], odd: int) -> Array:
    """The cosine or sine sum of half the offsets, (R + 1, n, n, 2 R + 1), at ky >= 0 and all kx.

    Offsets with j < 0 mirror those with j > 0, which therefore count twice.
    """
    cells = samples.shape[0] - 1
    cos_x, sin_x = _waves(np.arange(-cells, cells + 1), order, padded[1])
    cos_y, sin_y = _waves(np.arange(cells + 1), np.arange(padded[0] // 2 + 1), padded[0])
    cos_y[1:] *= 2.0
    sin_y[1:] *= 2.0
    rows = samples.reshape(-1, samples.shape[-1])
    cosine = (rows @ cos_x).reshape(cells + 1, -1)
    sine = (rows @ sin_x).reshape(cells + 1, -1)
    whole = sin_y.T @ cosine + cos_y.T @ sine if odd else cos_y.T @ cosine - sin_y.T @ sine
    return np.asarray(whole).reshape(-1, *samples.shape[1:3], order.size)


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
    """One entry of `pair_potential` at the offsets (j, i), j >= 0: out[j, a, b, R + i]."""
    shape_factor, size, reach, bluntness = shape
    n = cosines.size
    for task in numba.prange(out.shape[0] * n):
        j, a = task // n, task % n
        constants = PotentialShape(shape_factor, size, reach, bluntness)
        _sample_offsets((h, j, widths[j], entry), (cosines, sines), a, constants, out[j, a])


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

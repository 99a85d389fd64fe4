"""Which way to compute the interaction on an r-grid: by harmonics where they pay, else directly."""

from __future__ import annotations

from typing import Literal

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution.angular_series import angular_series
from ellipsoid_coupling.interaction.convolution.fft_lengths import padded_length
from ellipsoid_coupling.interaction.convolution.spectra import LEAST_SINGLE_TOLERANCE
from ellipsoid_coupling.interaction.direct import DirectInteraction
from ellipsoid_coupling.interaction.grid_forces import GridInteraction, check_grid, half_widths
from ellipsoid_coupling.interaction.periodic import ContinuedInteraction, Periods
from ellipsoid_coupling.interaction.rho_grid import HarmonicInteraction
from ellipsoid_coupling.physics.potential import PotentialShape

Method = Literal["auto", "direct", "harmonics"]

# Cost of one point of a transform and of one entry of a block, in pairs of cells of the direct sum
# (measured: 4.0, 0.63 and 3.3 ns on two threads, single precision).
POINT_COST = 1.2
ENTRY_COST = 0.2
# Spectra larger than this are not made.
MOST_BYTES = 1e9


def choose_interaction(
    grid_shape: tuple[int, int],
    h: float,
    shape: PotentialShape,
    strength: float,
    tolerance: float,
    method: Method = "auto",
    periods: Periods = (False, False),
) -> GridInteraction:
    """The interaction integral of `GridInteraction` within `tolerance` (see `angular_series`).

    "auto" takes the harmonics if the series for the tolerance is short enough to cost less than
    the direct sum over a full grid and to fit into 1 GB, else the direct sum. The choice depends
    on the arguments only, not on the machine.

    Parameters
    ----------
    grid_shape : (ny, nx)
    h : float
        Spacing, the same in both directions.
    shape : PotentialShape
    strength : float
        eps0.
    tolerance : float
        Largest error in units of max(density) * eps0 h^2 * (sum of the kernel's largest absolute
        values over angles), the latter for force and torque each.
    method : "auto", "direct" or "harmonics"
    periods : whether y and x are periodic, with an even number of cells.

    Raises
    ------
    InputError
        A grid without cells or spacing, a tolerance <= 0, an unknown method, or "harmonics" where
        the tolerance takes more memory than 1 GB.
    """
    check_grid(grid_shape, h)
    if method not in ("auto", "direct", "harmonics"):
        raise InputError("method", "auto, direct or harmonics", repr(method), "Name one of them.")
    if not tolerance > 0.0:
        raise InputError("tolerance", "a positive number", f"{tolerance}", "Try 5e-3.")
    if method == "direct":
        return _direct(grid_shape, h, shape, strength, periods)
    most = _most_harmonics(grid_shape, h, shape, tolerance, cheap=method == "auto")
    series = angular_series(shape, h, tolerance, most)
    if series is not None:
        return HarmonicInteraction(grid_shape, strength, series, periods)
    if method == "harmonics":
        raise InputError(
            "interaction by harmonics",
            f"a tolerance that {most} harmonics (1 GB of spectra) reach",
            f"{tolerance}",
            "Raise the tolerance or take the direct sum.",
        )
    return _direct(grid_shape, h, shape, strength, periods)


def _direct(
    grid_shape: tuple[int, int], h: float, shape: PotentialShape, strength: float, periods: Periods
) -> GridInteraction:
    def make(cells: tuple[int, int]) -> GridInteraction:
        return DirectInteraction(cells, h, shape, strength)

    if not any(periods):
        return make(grid_shape)
    return ContinuedInteraction(grid_shape, periods, half_widths(shape, h).size - 1, make)


def _most_harmonics(
    grid_shape: tuple[int, int], h: float, shape: PotentialShape, tolerance: float, *, cheap: bool
) -> int:
    """The largest M that fits into `MOST_BYTES` and, if `cheap`, costs less than the direct sum."""
    widths = half_widths(shape, h)
    py, px = (padded_length(cells, widths.size - 1) for cells in grid_shape)
    components = 2 if shape.shape_factor == 0.0 else 3
    # Offsets of the disc: its rows on both sides, the middle one once.
    offsets = 2 * (2 * widths + 1).sum() - (2 * widths[0] + 1)
    pairs = int(offsets) * grid_shape[0] * grid_shape[1]
    bytes_each = 4 if tolerance >= LEAST_SINGLE_TOLERANCE else 8
    harmonics = 0
    # Costs grow with the length of the series: the first that is too long ends the search.
    while True:
        functions = 2 * (harmonics + 1) + 1
        points = (1 + components) * functions * py * px
        # A quarter of all frequencies: fields are real, and ky >= 0 tells the others (`spectra`).
        entries = components * functions**2 * (py // 2 + 1) * (px // 2 + 1)
        # Doubles move twice as many bytes as the floats that were measured.
        cost = bytes_each / 4 * (POINT_COST * points + ENTRY_COST * entries)
        if entries * bytes_each > MOST_BYTES or (cheap and cost > pairs):
            return harmonics
        harmonics += 1

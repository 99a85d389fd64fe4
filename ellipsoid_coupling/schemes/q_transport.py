"""Transport of the q-equations' fields in one direction, confined to the window that holds mass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.schemes.boundary import fill_ghosts, fill_periodic
from ellipsoid_coupling.schemes.fluxes.contract import Flux
from ellipsoid_coupling.schemes.grid import GHOSTS
from ellipsoid_coupling.schemes.q_grid import NORMAL, Indices, Window, grown, runs
from ellipsoid_coupling.schemes.sweeps import sweep_columns, sweep_rows

Floats = NDArray[np.float64]


def transport(
    flux: Flux, fields: Floats, axis: int, ratio: float, window: Window, reflecting: bool
) -> Window:
    """One step of `flux` along one axis, in place; returns the window that holds the mass now.

    Parameters
    ----------
    flux : NamedTuple
        A numerical flux of schemes/fluxes.
    fields : (K, na + 4, ny + 4, nx + 4) float64, contiguous
        Conserved fields; ghosts are filled here.
    axis : int
        -1 for x, -2 for y, -3 for the angle, which is periodic.
    ratio : float
        dt / cell width along the axis.
    window : Window
        Holds all mass before the step.
    reflecting : bool
        The boundary in x and y: reflecting or open.
    """
    normal = NORMAL[axis]
    if axis == -3:
        fill_periodic(fields, 1)
    else:
        fill_ghosts(fields, axis + 4, reflecting, normal)
    na, ny, nx = (n - 2 * GHOSTS for n in fields.shape[1:])
    window = grown(window, (na, ny, nx), axis)
    if window.planes.size:
        _sweep(flux, fields, axis, normal, ratio, window)
    return window


def _sweep(
    flux: Flux, fields: Floats, axis: int, normal: int, ratio: float, window: Window
) -> None:
    components, *padded = fields.shape
    flat = fields.reshape(components, -1)
    row = padded[2]
    plane = padded[1] * row
    y_first, y_end, x_first, x_end = (int(n) for n in window.extent)
    planes: Indices = (window.planes + GHOSTS) * plane
    rows: Indices = (np.arange(y_first, y_end) + GHOSTS) * row
    corner = x_first + GHOSTS
    if axis == -1:
        first = (planes[:, None] + rows + corner).ravel()
        sweep_rows(flux, flat, first, x_end - x_first, normal, ratio)
    elif axis == -2:
        first, extent = planes + rows[0] + corner, (x_end - x_first, row)
        sweep_columns(flux, flat, first, y_end - y_first, extent, normal, ratio)
    else:
        # A run that wraps round is two runs: the ghosts between them hold the old values.
        for begin, count in runs(window.planes):
            first, extent = (begin + GHOSTS) * plane + rows + corner, (x_end - x_first, plane)
            sweep_columns(flux, flat, first, count, extent, normal, ratio)

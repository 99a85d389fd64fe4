"""Twins that treat all cells: of what only goes where mass is, and of what is done row by row."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.boundary import fill_ghosts
from ellipsoid_coupling.finite_volume.fluxes.contract import Flux
from ellipsoid_coupling.finite_volume.grid import GHOSTS, interior
from ellipsoid_coupling.finite_volume.kick import Kick
from ellipsoid_coupling.finite_volume.sweep import Runs, bundle_width, sweep_runs
from ellipsoid_coupling.geometry.boundaries import Boundaries, everywhere
from ellipsoid_coupling.geometry.ghost_table import GhostTable, ghost_table

Floats = NDArray[np.float64]


def _all_runs(padded: tuple[int, ...], axis: int) -> tuple[Runs, int]:
    """The runs along one axis of a padded grid that is filled, and their stride."""
    index = np.arange(math.prod(padded), dtype=np.int64).reshape(padded)
    inner = index[(slice(GHOSTS, -GHOSTS),) * len(padded)]
    # The first cell of every line along the axis; across rows, of every bundle of them.
    first = np.moveaxis(inner, axis, 0)[0]
    if axis == -1:
        first, width = first.ravel(), np.ones(first.size, np.int64)
    else:
        bundle = bundle_width(first.shape[-1], first.size // first.shape[-1])
        offsets = np.arange(0, first.shape[-1], bundle)
        width = np.broadcast_to(
            np.minimum(bundle, first.shape[-1] - offsets), (*first.shape[:-1], offsets.size)
        ).ravel()
        first = first[..., ::bundle].ravel()
    runs = Runs(first, np.full(first.size, inner.shape[axis]), np.ascontiguousarray(width))
    return runs, math.prod(padded[axis + 1 :]) if axis != -1 else 1


def ghosts_of(fields: Floats, kind: Any) -> GhostTable:
    """The table of padded fields (K, .., ny + 4, nx + 4) with that kind at all sides, or `Boundaries`."""
    kinds = kind if isinstance(kind, Boundaries) else everywhere(kind)
    rows, columns = fields.shape[-2:]
    return ghost_table(kinds, (rows - 2 * GHOSTS, columns - 2 * GHOSTS), GHOSTS)


def fill(fields: Floats, axis: int, kind: Any) -> None:
    """Fill the ghosts along x (-1) or y (-2) of fields with that kind at all sides."""
    fill_ghosts(fields, axis, ghosts_of(fields, kind), 0.0)


def sweep(
    flux: Flux,
    fields: Floats,
    axis: int,
    normal: int,
    ratio: float,
    left: Floats | None = None,
) -> None:
    """Transport padded fields along one axis, in place; their ghosts along it are filled.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64, contiguous
    axis : int
        -1 for x, -2 for y, -3 for the angle.
    normal : int
        Component of the momentum along it.
    ratio : float
        dt / h.
    left : (1,) float64, optional
        What leaves through the boundary is added, in units of a cell's density.
    """
    runs, stride = _all_runs(fields.shape[1:], axis)
    flat = fields.reshape(fields.shape[0], -1)
    gone = sweep_runs(flux, flat, runs, stride, normal, ratio)
    if left is not None:
        left += gone


def kick(fields: Floats, drift: Floats, change: Kick, turning: float = 0.0) -> None:
    """V and omega of an r-grid become decay v + gain F; then phi += turning omega. In place."""
    inner = interior(fields)
    for k, rate, decay, gain in zip((1, 2, 4), drift, change.decay, change.gain, strict=False):
        inner[k] = decay * inner[k] + gain * inner[0] * rate
    if len(fields) > 4:
        inner[3] += turning * inner[4]

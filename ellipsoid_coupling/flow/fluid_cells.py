"""Which cells of a uniform grid hold some of the fluid, by its outline alone.

A cell does if its centre lies in the fluid, or if an edge of the outline runs through it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.inside import grid_in_fluid
from ellipsoid_coupling.flow.polygons import Index

Array = NDArray[np.float64]

# In cells: an edge along a line of the grid belongs to the cells on its left, where the fluid is.
_ASIDE = 1e-6


def fluid_cells(ends: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """(ny, nx), the cells between the nodes x (nx+1,), y (ny+1,) that hold some of the fluid.

    Parameters
    ----------
    ends : (E, 2, 2), of the outline's edges, the fluid on the left; see `Outline`
    """
    corner, step = np.array([x[0], y[0]]), np.array([x[1] - x[0], y[1] - y[0]])
    scaled = (ends - corner) / step
    columns, rows = np.arange(0.5, x.size - 1), np.arange(0.5, y.size - 1)
    inside = grid_in_fluid(scaled, columns, rows)
    row, column = _crossed(scaled)
    there = (row >= 0) & (row < inside.shape[0]) & (column >= 0) & (column < inside.shape[1])
    inside[row[there], column[there]] = True
    return inside


def _crossed(ends: Array) -> tuple[Index, Index]:
    """Rows and columns of the cells that edges run through; ends in units of cells."""
    number = np.arange(len(ends))
    edges, places = [number, number], [np.zeros(len(ends)), np.ones(len(ends))]
    for axis in (0, 1):
        along = ends[..., axis]
        first = np.floor(along.min(axis=1)) + 1.0
        edge, line = _each(first, np.ceil(along.max(axis=1)) - first)
        edges.append(edge)
        places.append((line - along[edge, 0]) / (along[edge, 1] - along[edge, 0]))
    edge, place = np.concatenate(edges), np.concatenate(places)
    order = np.lexsort((place, edge))
    edge, place = edge[order], place[order]
    # In the middle between two lines of the grid, or between a line and an end.
    same = edge[1:] == edge[:-1]
    edge, middle = edge[1:][same], (0.5 * (place[1:] + place[:-1]))[same, None]
    way = ends[edge, 1] - ends[edge, 0]
    left = np.stack((-way[:, 1], way[:, 0]), axis=-1) / np.hypot(way[:, :1], way[:, 1:])
    column, row = np.floor(ends[edge, 0] + middle * way + _ASIDE * left).astype(np.int64).T
    return row, column


def _each(first: Array, count: Array) -> tuple[Index, Array]:
    """For every edge the whole numbers first, first + 1, ..., `count` of them: the edge, the number."""
    number = np.maximum(count, 0.0).astype(np.int64)
    edge = np.repeat(np.arange(number.size), number)
    within = np.arange(edge.size) - np.repeat(np.cumsum(number) - number, number)
    return edge, first[edge] + within

"""The stream function at mesh points from the velocity in cells, by least squares over edges.

Along the edge from point a to point b, with u in its middle,

    psi_b - psi_a = u_x (y_b - y_a) - u_y (x_b - x_a),

which is the flux through the edge. Edges on the boundary, where u is given, hold exactly, the
others as well as they can: sum over edges of (what is missing / edge length)^2 is the least.
Exact for velocities that are linear in space, on any mesh, second order otherwise; where the
boundary's velocity is not given, that takes cells with two neighbours or more.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree

from ellipsoid_coupling.flow.polygons import Edges, Index

Array = NDArray[np.float64]

# A face's centre is an edge's middle, up to this part of the edge: readers give single precision.
SAME_PLACE = 1e-2
# Where a cell's neighbours lie in one line, its gradient across the line is taken as 0.
RANK = 1e-6


class Patch(NamedTuple):
    """A boundary patch: its faces' centres (n, 2) and the velocity there (n, 2)."""

    centres: Array
    velocity: Array


def stream_function(
    points: Array, edges: Edges, centres: Array, velocity: Array, patches: Mapping[str, Patch]
) -> Array:
    """(P,), up to a constant: psi at the mesh points (P, 2), u = (d psi/dy, -d psi/dx).

    Parameters
    ----------
    points, edges : the mesh
    centres, velocity : (C, 2), the cells' centroids and the velocity there
    patches : by name; boundary edges that none of them covers take the cells' velocity
    """
    along = points[edges.points[:, 1]] - points[edges.points[:, 0]]
    middle = points[edges.points].mean(axis=1)
    length = np.hypot(along[:, 0], along[:, 1])
    given = given_on_edges(points, edges, velocity, patches)
    u = _on_edges(middle, edges, centres, velocity, given)
    jump = u[:, 0] * along[:, 1] - u[:, 1] * along[:, 0]

    # First the boundary alone: each connected part of it is known up to a constant. Walls stay
    # constant to the last bit, which a compromise with the cells beside them would not leave them.
    start, stop = edges.points.T
    fixed = np.isfinite(given[:, 0])
    weight = 1.0 / length
    psi, part = _potential(start[fixed], stop[fixed], jump[fixed], weight[fixed], len(points))
    # Then one unknown for each such part and each other point.
    rest = jump - (psi[stop] - psi[start])
    shift, _ = _potential(part[start], part[stop], rest, weight, int(part.max()) + 1)
    return psi + shift[part]


def given_on_edges(
    points: Array, edges: Edges, velocity: Array, patches: Mapping[str, Patch]
) -> Array:
    """(E, 2), the boundary's velocity in the middle of its edges, NaN inside and where none is given.

    Parameters as `stream_function`; a patch that repeats the cells' velocity gives none.
    """
    rim = np.flatnonzero(edges.cells[:, 1] < 0)
    ends = points[edges.points[rim]]
    middle, along = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    given = np.full((len(edges.points), 2), np.nan)
    for patch in patches.values():
        distance, nearest = KDTree(patch.centres).query(middle)
        here = distance <= SAME_PLACE * length
        values = patch.velocity[np.asarray(nearest)[here]]
        # An outlet or a plane of symmetry repeats its cells: nothing that U itself does not say.
        if not np.array_equal(values, velocity[edges.cells[rim[here], 0]]):
            given[rim[here]] = values
    return given


def _on_edges(middle: Array, edges: Edges, centres: Array, velocity: Array, given: Array) -> Array:
    """(E, 2), the velocity in the middle of edges: given, or continued from the cells beside."""
    gradient = _gradients(middle, edges, centres, velocity, given)

    def continued(cell: Index) -> Array:
        step = middle - centres[cell]
        there: Array = velocity[cell] + np.einsum("ei,eij->ej", step, gradient[cell])
        return there

    first, second = edges.cells.T
    one = continued(first)
    mean = np.where(second[:, None] < 0, one, 0.5 * (one + continued(second)))
    return np.where(np.isfinite(given), given, mean)


def _gradients(middle: Array, edges: Edges, centres: Array, velocity: Array, given: Array) -> Array:
    """(C, 2, 2), d u_j / d x_i in cells, by least squares over neighbours and boundary faces."""
    inner, known = edges.cells[:, 1] >= 0, np.isfinite(given[:, 0])
    first, second = edges.cells[inner].T
    beside = edges.cells[known, 0]
    cell = np.concatenate((first, second, beside))
    step = np.concatenate((
        centres[second] - centres[first], centres[first] - centres[second],
        middle[known] - centres[beside],
    ))  # fmt: skip
    change = np.concatenate((
        velocity[second] - velocity[first], velocity[first] - velocity[second],
        given[known] - velocity[beside],
    ))  # fmt: skip
    weighted = step / np.sum(step**2, axis=1, keepdims=True)
    matrix, right = (
        np.stack([
            [np.bincount(cell, weighted[:, i] * other[:, j], len(centres)) for j in (0, 1)]
            for i in (0, 1)
        ]).transpose(2, 0, 1)
        for other in (step, change)
    )  # fmt: skip
    gradient: Array = np.linalg.pinv(matrix, rcond=RANK, hermitian=True) @ right
    return gradient


def _potential(
    start: Index, stop: Index, jump: Array, weight: Array, number: int
) -> tuple[Array, Index]:
    """Values (number,) with value[stop] - value[start] nearest to jump, and their parts (number,).

    Parts are what the edges connect, numbered from 0; the first value of each is 0.
    """
    graph = coo_array((np.ones(start.size), (start, stop)), shape=(number, number))
    part = connected_components(graph, directed=False)[1].astype(np.int_)
    free = np.ones(number, bool)
    free[np.unique(part, return_index=True)[1]] = False
    value = np.zeros(number)
    if free.any():
        row = np.arange(start.size)
        ends = np.concatenate((row, row)), np.concatenate((stop, start))
        sign = np.repeat((1.0, -1.0), start.size)
        difference = coo_array((sign, ends), shape=(start.size, number)).tocsc()[:, free]
        normal = difference.T @ diags_array(weight**2)
        value[free] = spsolve((normal @ difference).tocsc(), normal @ jump)
    return value, part

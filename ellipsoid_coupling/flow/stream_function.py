"""The stream function at mesh points: from the fluxes through edges, or from the velocity in cells.

Along the edge from point a to point b, with u in its middle,

    psi_b - psi_a = u_x (y_b - y_a) - u_y (x_b - x_a),

which is the flux through the edge, from its left to its right. Solvers keep the fluxes: then the jumps
are known, and a walk along the edges adds them up (`from_fluxes`). Where there is only U, psi is fitted
(`from_velocity`): edges on the boundary, where u is given, hold exactly, the others as well as they can:
sum over edges of (what is missing / edge length)^2 is the least. Exact for velocities that are linear in
space, on any mesh, second order otherwise; where the boundary's velocity is not given, that takes cells
with two neighbours or more.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.sparse.linalg import spsolve

from ellipsoid_coupling.flow.polygons import Edges, Index

Array = NDArray[np.float64]

# Where a cell's neighbours lie in one line, its gradient across the line is taken as 0.
RANK = 1e-6


class Patch(NamedTuple):
    """A boundary patch: its faces' centres (n, 2), the velocity there (n, 2), its type in the case.

    kind : "" where it is not known
    """

    centres: Array
    velocity: Array
    kind: str = ""


class Rim(NamedTuple):
    """Faces of patches among the edges: the edges (R,), the number of each one's patch, the face in it."""

    edge: Index
    patch: Index
    face: Index


def from_fluxes(edges: Edges, jump: Array, points: int) -> tuple[Array, float]:
    """Psi (points,) and by how much it does not close, as a part of its range.

    Parameters
    ----------
    edges : of the mesh
    jump : (E,), the flux through each edge: psi's difference between its ends
    points : their number

    Notes
    -----
    Edges of the boundary without flux are contracted first, so that psi is constant on walls to the bit.
    Of the others a tree, breadth first, gives psi; what those miss that are not in it tells how well the
    fluxes close.
    """
    start, stop = edges.points.T
    still = (jump == 0.0) & (edges.cells[:, 1] < 0)
    number, part = _parts(start[still], stop[still], points)
    first, second = part[start], part[stop]
    # Between two parts one edge is enough, and none from a part to itself.
    pair = np.minimum(first, second) * number + np.maximum(first, second)
    used = np.unique(pair, return_index=True)[1]
    used = used[first[used] != second[used]]
    psi = _summed(first[used], second[used], jump[used], number)[part]
    missed = float(np.abs(psi[stop] - psi[start] - jump).max(initial=0.0))
    size = float(np.ptp(psi))
    return psi, missed / size if size > 0.0 else missed


def _parts(start: Index, stop: Index, number: int) -> tuple[int, Index]:
    """How many parts the edges make of `number` nodes, and the part of each node."""
    graph = coo_array((np.ones(start.size), (start, stop)), shape=(number, number))
    count, part = connected_components(graph, directed=False)
    return int(count), part.astype(np.int_)


def _summed(start: Index, stop: Index, jump: Array, number: int) -> Array:
    """(number,): jumps added up along a tree of the edges, from 0 at one node of each part."""
    roots = np.unique(_parts(start, stop, number)[1], return_index=True)[1]
    # One more node, in front of all parts.
    start = np.concatenate((start, np.full(roots.size, number)))
    stop, jump = np.concatenate((stop, roots)), np.concatenate((jump, np.zeros(roots.size)))
    edge = np.arange(1, start.size + 1)
    ends = np.concatenate((start, stop)), np.concatenate((stop, start))
    graph = csr_array((np.concatenate((edge, -edge)), ends), shape=(number + 1, number + 1))
    order, before = breadth_first_order(graph, number, directed=True)
    order, parent = order[1:], before[order[1:]]
    along = graph[parent, order]
    steps = np.sign(along) * jump[np.abs(along) - 1]
    value = [0.0] * (number + 1)
    for node, known, step in zip(order.tolist(), parent.tolist(), steps.tolist(), strict=True):
        value[node] = value[known] + step
    return np.array(value[:number])


def velocity_of_fluxes(points: Array, edges: Edges, jump: Array, cells: int) -> Array:
    """(cells, 2): the velocity that the fluxes (E,) through the edges of each cell fit best.

    sum over edges of n n^T l u = sum over edges of n phi, n being an edge's normal and l its length: exact
    where u is constant, as OpenFOAM's `reconstruct`.
    """
    way = points[edges.points[:, 1]] - points[edges.points[:, 0]]
    length = np.hypot(way[:, 0], way[:, 1])
    normal = np.stack((way[:, 1], -way[:, 0]), axis=-1) / length[:, None]
    beside = edges.cells >= 0
    cell = np.concatenate((edges.cells[beside[:, 0], 0], edges.cells[beside[:, 1], 1]))
    edge = np.concatenate((np.flatnonzero(beside[:, 0]), np.flatnonzero(beside[:, 1])))
    matrix = np.zeros((cells, 2, 2))
    np.add.at(matrix, cell, (length[:, None, None] * normal[:, :, None] * normal[:, None, :])[edge])
    right = np.zeros((cells, 2))
    np.add.at(right, cell, (normal * jump[:, None])[edge])
    return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0])


def from_velocity(
    points: Array, edges: Edges, centres: Array, velocity: Array, given: Array
) -> Array:
    """(P,), up to a constant: psi at the mesh points (P, 2), u = (d psi/dy, -d psi/dx).

    Parameters
    ----------
    points, edges : the mesh
    centres, velocity : (C, 2), the cells' centroids and the velocity there
    given : (E, 2), the boundary's velocity, see `given_on_edges`; where it is none, the cells' is taken
    """
    along = points[edges.points[:, 1]] - points[edges.points[:, 0]]
    middle = points[edges.points].mean(axis=1)
    length = np.hypot(along[:, 0], along[:, 1])
    u = _on_edges(middle, edges, centres, velocity, given)
    jump = u[:, 0] * along[:, 1] - u[:, 1] * along[:, 0]

    return fitted_to_jumps(edges, jump, length, np.isfinite(given[:, 0]), len(points))


def fitted_to_jumps(
    edges: Edges, jump: Array, length: Array, fixed: NDArray[np.bool_], points: int
) -> Array:
    """Psi (points,), whose jumps along edges (E,) are those of the `fixed` ones, the others best.

    length : (E,), of the edges
    """
    # First the boundary alone: each connected part of it is known up to a constant. Walls stay
    # constant to the last bit, which a compromise with the cells beside them would not leave them.
    start, stop = edges.points.T
    weight = 1.0 / length
    psi, part = _potential(start[fixed], stop[fixed], jump[fixed], weight[fixed], points)
    # Then one unknown for each such part and each other point.
    rest = jump - (psi[stop] - psi[start])
    shift, _ = _potential(part[start], part[stop], rest, weight, int(part.max()) + 1)
    return psi + shift[part]


def given_on_edges(edges: Edges, velocity: Array, patches: Mapping[str, Patch], rim: Rim) -> Array:
    """(E, 2), the boundary's velocity in the middle of its edges, NaN inside and where none is given.

    Parameters
    ----------
    edges, velocity : of the mesh, (C, 2) in its cells
    patches, rim : by name, and where they lie; one that repeats the cells' velocity gives none
    """
    given = np.full((len(edges.points), 2), np.nan)
    for number, patch in enumerate(patches.values()):
        here = rim.patch == number
        edge, values = rim.edge[here], patch.velocity[rim.face[here]]
        # An outlet or a plane of symmetry repeats its cells: nothing that U itself does not say.
        if not np.array_equal(values, velocity[edges.cells[edge, 0]]):
            given[edge] = values
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

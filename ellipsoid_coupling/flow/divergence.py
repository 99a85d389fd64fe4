"""The part of a flow that has sources: grad chi, which leaves fluxes that a stream function has.

    u = rot psi + grad chi

A spline's chi takes from the solver's fluxes phi what does not close, around cells and around solids:

    out of each cell          int grad chi . n ds = sum of phi over its edges
    out through the boundary  int grad chi . n ds = what its closed line lets out in all, on the edges that
                              let it out, in parts as phi's; nothing on walls

So chi is flat where phi closes. The rest, phi less these fluxes, has a psi that is constant on walls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.fitted import SMOOTH, mesh_nodes, periods
from ellipsoid_coupling.flow.fluid_cells import fluid_cells
from ellipsoid_coupling.flow.least_squares import (
    Equations,
    Nodes,
    solve,
    spline_rows,
    third_differences,
)
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.slopes import Chi
from ellipsoid_coupling.flow.stream_function import fitted_to_jumps
from ellipsoid_coupling.flow.stream_values import chi_slopes
from ellipsoid_coupling.flow.wall_curves import WallEdges

Array = NDArray[np.float64]
Index = NDArray[np.int_]

# Weights, against the regulariser: of fluxes out of cells and through the boundary.
_FLUX = 3.0
# Parts of an edge at which a spline's flux through it is taken: Gauss' two points.
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
# Coefficients that meet in an equation of a cell are as many apart: the cell is three wide at most.
_REACH = 6
# Normal equations of a Laplacian lose digits over many cells; each round brings them back.
_ROUNDS = 2


class Sources(NamedTuple):
    """The part of a flow that has sources, and what is left.

    Attributes
    ----------
    chi : FlowField
        A flow of nothing but grad chi, on the nodes of the mesh's spline.
    psi : (P,) float64
        Of the rest, at the mesh points.
    """

    chi: FlowField
    psi: Array

    def without(self, mesh: MeshFlow) -> Array:
        """(C, 2): what grad chi leaves of the velocity in cells, mean by mean."""
        at, owner = mesh.cells.scatter(mesh.points)
        slopes = chi_slopes(self.chi.arrays, at[:, 0], at[:, 1])
        count = len(mesh.velocity)
        means = [np.bincount(owner, part, count) / mesh.cells.sizes for part in slopes]
        return np.asarray(mesh.velocity - np.stack(means, axis=-1))

    def along(self, mesh: MeshFlow, walls: WallEdges) -> WallEdges:
        """The walls, with what grad chi leaves of their speeds."""
        start, stop = mesh.points[walls.start], mesh.points[walls.stop]
        way, (x, y) = stop - start, 0.5 * (start + stop).T
        chi_x, chi_y = chi_slopes(self.chi.arrays, x, y)
        along = (chi_x * way[:, 0] + chi_y * way[:, 1]) / np.hypot(way[:, 0], way[:, 1])
        return walls._replace(speed=walls.speed - along)

    def joined(self, field: FlowField) -> FlowField:
        """The flow of psi, which has the same nodes, and chi together."""
        coefficients = np.vstack((
            field.arrays.coefficients, self.chi.arrays.coefficients[field.cells[0] + 3 :],
        ))  # fmt: skip
        arrays = field.arrays._replace(coefficients=coefficients, chi=self.chi.arrays.chi)
        return FlowField(arrays, field.origin, field.outline)


def sources(mesh: MeshFlow, flux: Array, outline: Outline) -> Sources:
    """The sources of a flow whose fluxes do not close.

    Parameters
    ----------
    mesh : MeshFlow
    flux : (E,) float64
        Through its edges, as a jump of psi; exactly 0 on walls.
    outline : Outline
        Relative to the mesh's corner.
    """
    edges = mesh.edges
    out = _owners_side(mesh) * flux
    cyclic = _cyclic(mesh, outline)
    through = _through_boundary(mesh, out, cyclic)
    nodes, finer = mesh_nodes(mesh)
    x, y = nodes.lines()
    inside = fluid_cells(outline.ends, x, y)
    rows = _flux_rows(nodes, mesh)
    used = nodes.needed(inside | nodes.around(_gauss_points(mesh).reshape(-1, 2)))
    h = np.sqrt(nodes.dx * nodes.dy)
    rim = np.flatnonzero((edges.cells[:, 1] < 0) & ~cyclic)
    per_length = 1.0 / mesh.lengths()
    equations = [
        _out_of_cells(mesh, rows, out).weighted(_FLUX),
        Equations(
            csr_array(diags_array(per_length[rim]) @ rows[rim]), per_length[rim] * through[rim]
        ).weighted(_FLUX),
        *periods(nodes, mesh, np.zeros(len(mesh.points)), outline, used),
        _level(nodes, mesh).weighted(1.0 / h),
        third_differences(used).weighted(SMOOTH * finer / h),
    ]
    chi = solve(equations, used, reach=_REACH, rounds=_ROUNDS)
    taken = rows @ chi.ravel()
    taken[rim] = through[rim]
    rest = _owners_side(mesh) * (out - taken)
    psi = fitted_to_jumps(edges, rest, mesh.lengths(), edges.cells[:, 1] < 0, len(mesh.points))
    stacked = np.vstack((np.zeros_like(chi), chi))
    field = FlowField.from_coefficients(stacked, x, y, "", inside, outline)
    arrays = field.arrays._replace(chi=Chi(len(chi)))
    return Sources(FlowField(arrays, "", outline), psi)


def _owners_side(mesh: MeshFlow) -> Array:
    """(E,), 1 where an edge's owner lies on the left of the way along it, else -1."""
    start, stop = mesh.points[mesh.edges.points[:, 0]], mesh.points[mesh.edges.points[:, 1]]
    way, aside = stop - start, mesh.centres[mesh.edges.cells[:, 0]] - start
    return np.where(way[:, 0] * aside[:, 1] - way[:, 1] * aside[:, 0] > 0.0, 1.0, -1.0)


def _cyclic(mesh: MeshFlow, outline: Outline) -> NDArray[np.bool_]:
    """(E,), the edges of cyclic patches."""
    found = np.zeros(len(mesh.edges.points), np.bool_)
    found[mesh.edges.cells[:, 1] < 0] = np.array(outline.types)[outline.patch] == "cyclic"
    return found


def _through_boundary(mesh: MeshFlow, out: Array, cyclic: NDArray[np.bool_]) -> Array:
    """(E,), what grad chi lets out through edges of the boundary; 0 inside and on cyclic sides.

    out : (E,), what flows out of each edge's owner
    """
    rim = np.flatnonzero(mesh.edges.cells[:, 1] < 0)
    start, stop = mesh.edges.points[rim].T
    size = len(mesh.points)
    graph = coo_array((np.ones(rim.size), (start, stop)), shape=(size, size))
    line = connected_components(graph, directed=False)[1][start]
    in_all = np.bincount(line, out[rim])[line]
    helps = np.where(out[rim] * in_all > 0.0, np.abs(out[rim]), 0.0) * ~cyclic[rim]
    whole = np.bincount(line, helps)[line]
    found = np.zeros(out.size)
    found[rim] = in_all * np.divide(helps, whole, out=np.zeros(rim.size), where=whole > 0.0)
    return found


def _gauss_points(mesh: MeshFlow) -> Array:
    """(E, 2, 2), two points on each edge."""
    start, stop = (mesh.points[mesh.edges.points[:, k]][:, None, :] for k in (0, 1))
    return np.asarray(start + _GAUSS[:, None] * (stop - start))


def _flux_rows(nodes: Nodes, mesh: MeshFlow) -> csr_array:
    """(E, coefficients), the flux of grad chi through each edge, out of its owner."""
    at = _gauss_points(mesh)
    way = mesh.points[mesh.edges.points[:, 1]] - mesh.points[mesh.edges.points[:, 0]]
    half = 0.5 * _owners_side(mesh)[:, None] * way
    return csr_array(sum(
        diags_array(half[:, 1]) @ spline_rows(nodes, at[:, k], "x")
        - diags_array(half[:, 0]) @ spline_rows(nodes, at[:, k], "y")
        for k in range(_GAUSS.size)
    ))  # fmt: skip


def _out_of_cells(mesh: MeshFlow, rows: csr_array, out: Array) -> Equations:
    """What grad chi lets out of each cell, over the cell's perimeter: a velocity."""
    beside = mesh.edges.cells >= 0
    edge = np.concatenate([np.flatnonzero(beside[:, k]) for k in (0, 1)])
    cell = np.concatenate([mesh.edges.cells[beside[:, k], k] for k in (0, 1)])
    sign = np.repeat((1.0, -1.0), beside.sum(axis=0))
    shape = len(mesh.velocity), len(mesh.edges.points)
    perimeter = np.bincount(cell, mesh.lengths()[edge], shape[0])
    summed = coo_array((sign / perimeter[cell], (cell, edge)), shape=shape).tocsr()
    return Equations(csr_array(summed @ rows), np.asarray(summed @ out))


def _level(nodes: Nodes, mesh: MeshFlow) -> Equations:
    """That chi is 0 in one cell of each connected part of the mesh."""
    first, second = mesh.edges.cells[mesh.edges.cells[:, 1] >= 0].T
    count = len(mesh.velocity)
    graph = coo_array((np.ones(first.size), (first, second)), shape=(count, count))
    part = connected_components(graph, directed=False)[1]
    at = mesh.centres[np.unique(part, return_index=True)[1]]
    return Equations(spline_rows(nodes, at, ""), np.zeros(len(at)))

"""The least-squares stream function: exact for linear flows, second order, walls constant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ellipsoid_coupling.flow.plates import with_patches
from ellipsoid_coupling.flow.polygons import Edges, Polygons
from ellipsoid_coupling.flow.stream_function import (
    Patch,
    from_fluxes,
    from_velocity,
    given_on_edges,
    velocity_of_fluxes,
)
from tests.flow.known import Array, shaken, stream, velocity

Velocity = Callable[[Array, Array], tuple[Array, Array]]
Mesh = tuple[Array, Polygons]


def _fit(mesh: Mesh, u: Velocity, repeats: bool = False) -> Array:
    """The fit to u on a mesh, with u on one patch all around, or there the cells' own velocity."""
    points, cells = mesh
    edges, centres = cells.edges(), cells.centroids(points)
    speed = np.column_stack(u(*centres.T))
    rim = edges.cells[:, 1] < 0
    middle = points[edges.points[rim]].mean(axis=1)
    around = speed[edges.cells[rim, 0]] if repeats else np.column_stack(u(*middle.T))
    return _from_patches(mesh, speed, {"around": Patch(middle, around)})


def _from_patches(mesh: Mesh, speed: Array, patches: dict[str, Patch]) -> Array:
    points, cells = mesh
    edges, rim = with_patches(points, cells.edges(), patches)
    given = given_on_edges(edges, speed, patches, rim)
    return from_velocity(points, edges, cells.centroids(points), speed, given)


def _linear(x: Array, y: Array) -> tuple[Array, Array]:
    """Of psi = 3 x - x y / 2 + y^2 - x^2, so that nowhere on the rim the flux vanishes."""
    return -0.5 * x + 2.0 * y, -3.0 + 0.5 * y + 2.0 * x


@pytest.mark.parametrize(("corners", "repeats"), [(3, False), (4, False), (4, True)])
def test_linear_flows_are_exact_on_any_mesh(corners: int, repeats: bool) -> None:
    """Rounding only, whether the boundary gives u or merely repeats the cells, as outlets do."""
    mesh = shaken(9, corners)
    psi = _fit(mesh, _linear, repeats)
    x, y = mesh[0].T
    exact = 3.0 * x - 0.5 * x * y + y**2 - x**2
    assert np.abs(psi - psi[0] - exact + exact[0]).max() < 1e-12


@pytest.mark.parametrize("corners", [3, 4])
def test_other_flows_are_second_order(corners: int) -> None:
    errors = []
    for cells in (16, 32, 64):
        mesh = shaken(cells, corners)
        psi, exact = _fit(mesh, velocity), stream(*mesh[0].T)
        errors.append(float(np.sqrt(np.mean((psi - psi[0] - exact + exact[0]) ** 2))))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 1.8) & (orders < 2.3)), (errors, orders)


def test_walls_are_constant_to_rounding() -> None:
    """Up to the rounding of sin(pi) in the flux that is given: cells must not pull at it."""
    mesh = shaken(12)
    psi = _fit(mesh, velocity)
    on_wall = np.any((mesh[0] == 0.0) | (mesh[0] == 1.0), axis=1)
    assert np.ptp(psi[on_wall]) < 1e-15


def test_a_part_of_the_boundary_without_patch_follows_the_cells() -> None:
    """Fluxes through three sides given, the fourth from the cells: a linear flow stays exact."""
    points, cells = shaken(6, 4)
    edges, centres = cells.edges(), cells.centroids(points)
    middle = points[edges.points[edges.cells[:, 1] < 0]].mean(axis=1)
    middle = middle[middle[:, 0] < 1.0]
    patch = Patch(middle, np.column_stack(_linear(*middle.T)))
    speed = np.column_stack(_linear(*centres.T))
    psi = _from_patches((points, cells), speed, {"three": patch})
    x, y = points.T
    exact = 3.0 * x - 0.5 * x * y + y**2 - x**2
    assert np.abs(psi - psi[0] - exact + exact[0]).max() < 1e-12


def test_fluxes_add_up_to_psi() -> None:
    """Exact but for the sum's rounding; walls are constant to the bit, as is a wall of several sides."""
    points, cells = shaken(16)
    edges = cells.edges()
    exact = stream(*points.T)
    psi, gap = from_fluxes(
        edges, exact[edges.points[:, 1]] - exact[edges.points[:, 0]], len(points)
    )
    assert gap < 1e-14
    assert np.abs(psi - psi[0] - exact + exact[0]).max() < 1e-14
    on_wall = np.any((points == 0.0) | (points == 1.0), axis=1)
    assert np.ptp(psi[on_wall]) == 0.0


def test_fluxes_with_a_source_do_not_close() -> None:
    """A flux out of one cell is missed somewhere: the gap is that flux over psi's range."""
    points, cells = shaken(8)
    edges = cells.edges()
    exact = stream(*points.T)
    jump = exact[edges.points[:, 1]] - exact[edges.points[:, 0]]
    inner = int(np.flatnonzero(edges.cells[:, 1] >= 0)[50])
    jump[inner] += 0.01 * np.ptp(exact)
    assert 0.002 < from_fluxes(edges, jump, len(points))[1] < 0.02


@pytest.mark.parametrize("corners", [3, 4])
def test_fluxes_give_the_velocity_in_cells(corners: int) -> None:
    """Exact where u is constant; elsewhere first order: 7 % on shaken triangles, 24 to a side."""
    points, cells = shaken(24, corners)
    edges, count = cells.edges(), cells.sizes.size
    along = points[edges.points[:, 1]] - points[edges.points[:, 0]]
    steady = 2.0 * along[:, 1] + 3.0 * along[:, 0]
    found = velocity_of_fluxes(points, edges, steady, count)
    np.testing.assert_allclose(found, np.tile([2.0, -3.0], (count, 1)), atol=1e-12)
    exact = stream(*points.T)
    jump = exact[edges.points[:, 1]] - exact[edges.points[:, 0]]
    at = np.column_stack(velocity(*cells.centroids(points).T))
    off = velocity_of_fluxes(points, edges, jump, count) - at
    assert np.linalg.norm(off) < 0.08 * np.linalg.norm(at)


def test_two_meshes_that_do_not_meet_have_each_their_constant() -> None:
    points, cells = shaken(4)
    edges = cells.edges()
    ends = np.concatenate((edges.points, edges.points + len(points)))
    both = Edges(ends, np.tile(edges.cells, (2, 1)))
    exact = stream(*points.T)
    jump = np.tile(exact[edges.points[:, 1]] - exact[edges.points[:, 0]], 2)
    psi, gap = from_fluxes(both, jump, 2 * len(points))
    assert gap < 1e-14
    np.testing.assert_allclose(psi[: len(points)], psi[len(points) :], atol=1e-15)


def test_polygons_know_their_parts() -> None:
    """Nine quadrilaterals: 24 edges, 12 of them outside; fans and centroids fill the square."""
    points, cells = shaken(3, 4)
    edges = cells.edges()
    assert edges.points.shape == (24, 2)
    assert np.count_nonzero(edges.cells[:, 1] < 0) == 12
    a, b, c = np.moveaxis(points[cells.triangles()], 1, 0)
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.shape == (18,)
    assert np.all(area > 0.0)
    np.testing.assert_allclose(area.sum(), 1.0, rtol=1e-14)
    # The centroids' mean, weighted with the cells' areas, is the square's centre.
    weights = area.reshape(9, 2).sum(axis=1)
    np.testing.assert_allclose(weights @ cells.centroids(points), [0.5, 0.5], rtol=1e-14)

"""From any plane mesh to a field: irregular points, NaN, partly covered sides, holes, sources."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.mesh_flow import flow_field
from ellipsoid_coupling.flow.plates import with_patches
from ellipsoid_coupling.flow.polygons import Index, polygons
from ellipsoid_coupling.flow.stream_function import Patch, Rim
from tests.flow.known import Array, points, shaken, velocity

NOWHERE = Rim(*(np.zeros(0, np.int_),) * 3)


def _mesh(at: Array, corner: Index, count: int, patches: dict[str, Patch]) -> MeshFlow:
    """Triangles with the known flow on them."""
    cells = polygons(at, corner, np.repeat(np.arange(count), 3), count)
    edges, rim = with_patches(at, cells.edges(), patches)
    speed = np.column_stack(velocity(*cells.centroids(at).T))
    return MeshFlow(at, edges, cells, speed, patches, rim, None, "here", "made", np.zeros(2))


def _irregular(cells: int) -> MeshFlow:
    """Triangles on a shaken lattice of the unit square, with the known flow on it."""
    at, found = shaken(cells)
    edges = found.edges()
    rim = at[edges.points[edges.cells[:, 1] < 0]].mean(axis=1)
    sides = {}
    for name, axis, place in (
        ("floor", 1, 0.0),
        ("lid", 1, 1.0),
        ("left", 0, 0.0),
        ("right", 0, 1.0),
    ):
        middle = rim[rim[:, axis] == place]
        sides[name] = Patch(middle, np.column_stack(velocity(*middle.T)) * (name == "lid"))
    return _mesh(at, found.corner, found.sizes.size, sides)


def test_irregular_mesh_converges() -> None:
    """Second order, as psi from U in cells is; through a wall 1e-4 of the top speed, 1.8, at most.

    But for the last cell before the lid: there the wall's speed jumps, and the spline is smooth.
    """
    errors = []
    x, y = points(4000)
    for cells in (12, 24):
        field = flow_field(_irregular(cells), allow_misfit=True)
        sample, exact = field.evaluate(x, y), velocity(x, y)
        error = np.hypot(sample.velocity_x - exact[0], sample.velocity_y - exact[1])
        errors.append(float(np.sqrt(np.mean(error**2))))
        assert sample.inside.all()
    along = np.linspace(0.0, 0.95, 101)
    assert np.abs(field.evaluate(np.zeros(101), along).velocity_x).max() < 2e-4
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.9, errors


def test_a_hole_is_not_in_the_fluid() -> None:
    """Cells of the grid are inside if they hold some of the mesh; beside the hole the field holds.

    The hole's rim is no wall and gives no velocity: there the field errs by at most 2 % of the top speed.
    """
    whole = _irregular(24)
    near = np.hypot(*(whole.centres - 0.5).T) < 0.2
    triangles = whole.cells.corner.reshape(-1, 3)[~near]
    used, corner = np.unique(triangles, return_inverse=True)
    holed = _mesh(whole.points[used], corner.ravel(), len(triangles), dict(whole.patches))
    field = flow_field(holed)
    assert field.outline is not None
    assert field.outline.names[-1] == "unnamed"
    x, y = points(4000)
    sample, exact = field.evaluate(x, y), velocity(x, y)
    distance = np.hypot(x - 0.5, y - 0.5)
    assert not sample.inside[distance < 0.14].any()
    assert sample.inside[distance > 0.25].all()
    beside = (distance > 0.25) & (distance < 0.4)
    error = np.hypot(sample.velocity_x - exact[0], sample.velocity_y - exact[1])[beside]
    assert error.max() < 0.02 * np.hypot(*exact).max()


def test_not_finite_values_are_an_input_error() -> None:
    mesh = _irregular(8)
    mesh.velocity[3, 1] = np.nan
    with pytest.raises(InputError, match="expected finite values of U, found 1 NaN"):
        flow_field(mesh)


def test_sides_that_no_patch_covers_follow_psi() -> None:
    """Without patches no velocity is given anywhere: close, no longer exact."""
    bare = replace(_irregular(24), patches={}, rim=NOWHERE)
    nodes = np.linspace(0.0, 1.0, 49)
    lid = flow_field(bare).evaluate(nodes, np.ones(49)).velocity_x
    exact = velocity(nodes, np.ones(49))[0]
    assert np.abs(lid - exact).max() < 0.1 * np.abs(exact).max()


def test_a_velocity_with_sources_is_an_input_error() -> None:
    """U = r has no stream function: the best one is 100 % off."""
    mesh = _irregular(8)
    swelling = replace(mesh, velocity=mesh.centres - 0.5, patches={}, rim=NOWHERE)
    with pytest.raises(InputError, match="expected a velocity U without sources"):
        flow_field(swelling)
    assert "% off U (rms)" in flow_field(swelling, allow_misfit=True).origin

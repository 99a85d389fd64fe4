"""From any plane mesh to a field: irregular points, NaN, partly covered sides, sources."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.mesh_flow import MeshFlow, flow_field
from ellipsoid_coupling.flow.openfoam.reader import _Inside
from ellipsoid_coupling.flow.polygons import polygons
from ellipsoid_coupling.flow.stream_function import Patch
from tests.flow.known import points, shaken, velocity


def _irregular(cells: int) -> MeshFlow:
    """Triangles on a shaken lattice of the unit square, with the known flow on it."""
    at, cells_at = shaken(cells)
    edges, centres = cells_at.edges(), cells_at.centroids(at)
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
    speed = np.column_stack(velocity(centres[:, 0], centres[:, 1]))
    inside = _Inside(at, cells_at.triangles())
    corner = np.zeros(2)
    return MeshFlow(at, edges, centres, speed, sides, inside, "here", "irregular", corner)


def test_irregular_mesh_converges() -> None:
    """With estimated slopes the velocity is better than first order; walls hold exactly."""
    errors = []
    x, y = points(4000)
    for cells in (12, 24):
        field = flow_field(_irregular(cells), allow_misfit=True)
        sample, exact = field.evaluate(x, y), velocity(x, y)
        error = np.hypot(sample.velocity_x - exact[0], sample.velocity_y - exact[1])
        errors.append(float(np.sqrt(np.mean(error**2))))
        assert sample.inside.all()
        along = np.linspace(0.0, 1.0, 101)
        assert np.abs(field.evaluate(np.zeros(101), along).velocity_x).max() < 1e-15
    assert 1.2 < np.log2(errors[0] / errors[1]) < 2.5, errors


def test_a_mesh_with_a_hole_is_continued_smoothly() -> None:
    """Least bending across the hole: beside it the field errs by at most 2 % of the top speed."""
    mesh = _irregular(24)

    def contains(at: np.ndarray) -> np.ndarray:
        return np.asarray(np.hypot(*(at - 0.5).T) > 0.2)

    # The rim's own points lie a little within it, as the hole is cut from a ragged mesh.
    kept = contains(mesh.centres)
    used, corner = np.unique(shaken(24)[1].triangles()[kept], return_inverse=True)
    at, owner = mesh.points[used], np.repeat(np.arange(kept.sum()), 3)
    edges = polygons(at, corner.ravel(), owner, int(kept.sum())).edges()
    holed = MeshFlow(
        at, edges, mesh.centres[kept], mesh.velocity[kept], mesh.patches, contains,
        "here", "holed", np.zeros(2),
    )  # fmt: skip
    field = flow_field(holed)
    x, y = points(4000)
    sample, exact = field.evaluate(x, y), velocity(x, y)
    near = np.hypot(x - 0.5, y - 0.5)
    assert not sample.inside[near < 0.15].any()
    assert sample.inside[near > 0.25].all()
    beside = (near > 0.25) & (near < 0.4)
    error = np.hypot(sample.velocity_x - exact[0], sample.velocity_y - exact[1])[beside]
    assert error.max() < 0.02 * np.hypot(*exact).max()


def test_not_finite_values_are_an_input_error() -> None:
    mesh = _irregular(8)
    mesh.velocity[3, 1] = np.nan
    with pytest.raises(InputError, match="expected finite values of U, found 1 NaN"):
        flow_field(mesh)


def test_nodes_that_no_patch_covers_take_their_slope_from_psi() -> None:
    """Without patches all slopes are differences of psi: close, no longer exact."""
    mesh = _irregular(24)
    bare = replace(mesh, patches={})
    nodes = np.linspace(0.0, 1.0, 49)
    lid = flow_field(bare).evaluate(nodes, np.ones(49)).velocity_x
    exact = velocity(nodes, np.ones(49))[0]
    assert np.abs(lid - exact).max() < 0.1 * np.abs(exact).max()


def test_a_velocity_with_sources_is_an_input_error() -> None:
    """U = r has no stream function: the best one is 100 % off."""
    mesh = _irregular(8)
    swelling = replace(mesh, velocity=mesh.centres - 0.5, patches={})
    with pytest.raises(InputError, match="expected a velocity U without sources"):
        flow_field(swelling)
    assert "% off U (rms)" in flow_field(swelling, allow_misfit=True).origin

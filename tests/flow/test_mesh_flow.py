"""From any plane mesh to a field: irregular points, both signs, NaN, partly covered sides."""

from __future__ import annotations

import numpy as np
import pytest
from tests.flow.known import points, stream, velocity
from scipy.spatial import Delaunay

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.mesh_flow import MeshFlow, Patch, flow_field
from ellipsoid_coupling.flow.reader import _Inside


def _irregular(cells: int, sign: float = 1.0) -> MeshFlow:
    """Triangles on a shaken lattice of the unit square, with the known flow on it."""
    nodes = np.linspace(0.0, 1.0, cells + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(nodes, nodes))
    shake = np.random.default_rng(0).uniform(-0.3, 0.3, (2, x.size)) / cells
    x = x + shake[0] * ((x > 0.0) & (x < 1.0))
    y = y + shake[1] * ((y > 0.0) & (y < 1.0))
    at = np.column_stack((x, y))
    triangles = Delaunay(at).simplices.astype(np.int_)
    centres = at[triangles].mean(axis=1)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    ones, zeros = np.ones(cells), np.zeros(cells)
    lid = np.column_stack((velocity(middles, ones)[0], zeros))
    still = np.zeros((cells, 2))
    sides = {
        "lid": Patch(np.column_stack((middles, ones)), lid),
        "floor": Patch(np.column_stack((middles, zeros)), still),
        "left": Patch(np.column_stack((zeros, middles)), still),
        "right": Patch(np.column_stack((ones, middles)), still),
    }
    speed = np.column_stack(velocity(centres[:, 0], centres[:, 1]))
    inside = _Inside(at, triangles)
    return MeshFlow(at, sign * stream(x, y), centres, speed, sides, inside, "here", "irregular")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_irregular_mesh_converges_whatever_its_sign(sign: float) -> None:
    """With estimated slopes the velocity is better than first order; walls hold exactly."""
    errors = []
    x, y = points(4000)
    for cells in (12, 24):
        field = flow_field(_irregular(cells, sign))
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
    # The rim's own points lie a little within it, as the hole is cut from a ragged mesh.
    away = np.hypot(*(mesh.points - 0.5).T) > 0.2 - 1.5 / 24

    def contains(at: np.ndarray) -> np.ndarray:
        return np.asarray(np.hypot(*(at - 0.5).T) > 0.2)

    kept = contains(mesh.centres)
    holed = MeshFlow(
        mesh.points[away], mesh.psi[away], mesh.centres[kept], mesh.velocity[kept],
        mesh.patches, contains, "here", "holed",
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
    bare = MeshFlow(
        mesh.points, mesh.psi, mesh.centres, mesh.velocity, {}, mesh.contains, "here", "bare"
    )
    nodes = np.linspace(0.0, 1.0, 49)
    lid = flow_field(bare).evaluate(nodes, np.ones(49)).velocity_x
    exact = velocity(nodes, np.ones(49))[0]
    assert np.abs(lid - exact).max() < 0.1 * np.abs(exact).max()

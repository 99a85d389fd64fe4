"""From any plane mesh to a field: irregular points, both signs, NaN, partly covered sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.mesh_flow import MeshFlow, flow_field
from ellipsoid_coupling.flow.polygons import polygons
from ellipsoid_coupling.flow.reader import _Inside
from ellipsoid_coupling.flow.stream_function import Patch
from tests.flow.known import points, shaken, stream, velocity


def _irregular(cells: int, sign: float = 1.0) -> MeshFlow:
    """Triangles on a shaken lattice of the unit square, with the known flow on it."""
    at, cells_at = shaken(cells)
    nodes = np.linspace(0.0, 1.0, cells + 1)
    centres = cells_at.centroids(at)
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
    psi, inside = sign * stream(*at.T), _Inside(at, cells_at.triangles())
    edges = cells_at.edges()
    corner = np.zeros(2)
    return MeshFlow(at, edges, psi, centres, speed, sides, inside, "here", "irregular", corner)


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


@pytest.mark.parametrize("fitted", [False, True])
def test_a_mesh_with_a_hole_is_continued_smoothly(fitted: bool) -> None:
    """Least bending across the hole: beside it the field errs by at most 2 % of the top speed."""
    mesh = _irregular(24)

    def contains(at: np.ndarray) -> np.ndarray:
        return np.asarray(np.hypot(*(at - 0.5).T) > 0.2)

    # The rim's own points lie a little within it, as the hole is cut from a ragged mesh.
    kept = contains(mesh.centres)
    used, corner = np.unique(shaken(24)[1].triangles()[kept], return_inverse=True)
    at, owner = mesh.points[used], np.repeat(np.arange(kept.sum()), 3)
    edges = polygons(at, corner.ravel(), owner, int(kept.sum())).edges()
    psi = mesh.psi[used] if mesh.psi is not None and not fitted else None
    holed = MeshFlow(
        at, edges, psi, mesh.centres[kept], mesh.velocity[kept], mesh.patches, contains,
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


@pytest.mark.parametrize("factor", [None, 1.1, np.nan])
def test_without_a_fitting_stream_function_one_is_made(factor: float | None) -> None:
    """A psi that is 10 % too large, NaN or none at all: U decides, and the origin says so.

    The fit is as good as the exact psi up to 20 %: both leave the interpolation's error.
    """
    mesh = _irregular(24)
    assert mesh.psi is not None
    psi = None if factor is None else factor * mesh.psi
    x, y = points(4000)
    exact = velocity(x, y)
    errors = []
    for case in (mesh, replace(mesh, psi=psi)):
        field = flow_field(case)
        sample = field.evaluate(x, y)
        squared = (sample.velocity_x - exact[0]) ** 2 + (sample.velocity_y - exact[1]) ** 2
        errors.append(float(np.sqrt(np.mean(squared))))
    assert ("fitted to U, as" in field.origin) == (factor is not None)
    assert errors[1] < 1.2 * errors[0], errors


def test_a_velocity_with_sources_is_an_input_error() -> None:
    """U = r has no stream function: the best one is 100 % off."""
    mesh = _irregular(8)
    swelling = replace(mesh, velocity=mesh.centres - 0.5, patches={}, psi=None)
    with pytest.raises(InputError, match="expected a velocity U without sources"):
        flow_field(swelling)
    assert "% off U (rms)" in flow_field(swelling, allow_misfit=True).origin

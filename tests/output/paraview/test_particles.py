"""Particles in ParaView: glyph arrays, realisations, polygons."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.output.paraview.particles import particle_ellipses, particle_points
from ellipsoid_coupling.result import Result


def test_points_carry_what_a_glyph_needs(particle_result: Result) -> None:
    time, mesh = list(particle_points(particle_result, 1))[1]
    assert time == particle_result.times[1]
    variables = {name: values[1, 1] for name, values in particle_result.variables.items()}
    data = mesh.point_data
    np.testing.assert_array_equal(mesh.points[:, 0], variables["x"])
    np.testing.assert_array_equal(mesh.points[:, 1], variables["y"])
    axis = np.arctan(np.tan(variables["angle"]))
    np.testing.assert_allclose(data["angle"], axis, atol=1e-14)
    np.testing.assert_array_equal(data["velocity"][:, 1], variables["velocity_y"])
    np.testing.assert_allclose(data["speed"], np.linalg.norm(data["velocity"], axis=1), rtol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(data["orientation"], axis=1), 1.0, rtol=1e-15)
    np.testing.assert_array_equal(data["orientation"][:, 1], np.sin(variables["angle"]))
    assert set(data["length"]) == {0.05}
    assert set(data["width"]) == {0.025}
    np.testing.assert_array_equal(data["scale"], np.tile([0.05, 0.025, 0.025], (30, 1)))
    assert set(data["realisation"]) == {1}


def test_all_realisations_follow_each_other(particle_result: Result) -> None:
    _, mesh = next(particle_points(particle_result, None))
    assert mesh.n_points == mesh.n_verts == 90
    np.testing.assert_array_equal(mesh.points[:, 0], particle_result.variables["x"][0].ravel())
    np.testing.assert_array_equal(mesh.point_data["realisation"], np.repeat([0, 1, 2], 30))


def test_polygons_are_the_ellipses(particle_result: Result) -> None:
    _, mesh = next(particle_ellipses(particle_result, 0))
    assert mesh.n_cells == 30
    areas = mesh.compute_cell_sizes(length=False, volume=False).cell_data["Area"]
    # A 32-gon inside the ellipse lacks 0.64 % of pi/4 L D.
    np.testing.assert_allclose(areas, np.pi / 4 * 0.05 * 0.025, rtol=0.0065)
    centres = mesh.cell_centers().points
    np.testing.assert_allclose(centres[:, 0], particle_result.variables["x"][0, 0], atol=1e-12)
    angle = particle_result.variables["angle"][0, 0]
    np.testing.assert_allclose(mesh.cell_data["angle"], np.arctan(np.tan(angle)), atol=1e-14)
    # The first corner is the end of the main axis.
    first = mesh.points[0::32] - centres
    axis = 0.025 * np.stack([np.cos(angle), np.sin(angle), np.zeros(30)], axis=-1)
    np.testing.assert_allclose(first, axis, atol=1e-12)

"""Grid fields in ParaView: axis order, means over the angle, vacuum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.paraview.fields import (
    HIDDEN_CELL,
    grid_fields,
    grid_images,
    histogram_images,
)
from ellipsoid_coupling.result import Result


def test_cells_lie_where_the_grid_has_them(rho_result: Result) -> None:
    time, image = next(grid_images(rho_result))
    assert time == rho_result.times[0]
    assert image.bounds[:4] == (0.0, 1.0, 0.0, 0.75)
    cell = image.find_containing_cell((0.8125, 0.1875, 0.0))
    assert image.cell_data["density"][cell] == 7.0
    assert image.cell_data["mean_angle"][cell] == rho_result.variables["mean_angle"][0, 1, 6]
    velocity = [rho_result.variables[f"velocity_{axis}"][0, 1, 6] for axis in "xy"]
    np.testing.assert_array_equal(image.cell_data["velocity"][cell], [*velocity, 0.0])


def test_orientation_is_a_unit_vector_where_there_is_mass(rho_result: Result) -> None:
    fields = grid_fields(rho_result, 0)
    filled = fields["density"].ravel() > 0.0
    # cos^2 + sin^2 to rounding; nothing points anywhere in vacuum.
    lengths = np.linalg.norm(fields["orientation"], axis=1)
    np.testing.assert_allclose(lengths, filled, atol=1e-15)
    assert np.all(fields["velocity"][~filled] == 0.0)
    # One angle a cell: all of it is in order, along the same axis as the mean angle.
    np.testing.assert_allclose(fields["S"].ravel(), filled, atol=1e-15)
    turned = np.exp(2j * fields["angle"]) - np.exp(2j * rho_result.variables["mean_angle"][0])
    np.testing.assert_allclose(turned.ravel()[filled], 0.0, atol=1e-14)
    assert np.all(np.abs(fields["angle"]) <= 0.5 * np.pi)


def test_q_is_integrated_over_the_angle(q_result: Result) -> None:
    fields = grid_fields(q_result, 0)
    # Two of twelve cells of width pi/6, each holding 7; angles 330 and 0 degrees; speeds 1 and 3.
    assert np.isclose(fields["density"][1, 6], 2 * 7.0 * np.pi / 6, rtol=1e-14)
    assert np.isclose(fields["mean_angle"][1, 6], 2 * np.pi - np.pi / 12, rtol=1e-14)
    assert np.isclose(fields["alignment"][1, 6], np.cos(np.pi / 12), rtol=1e-14)
    np.testing.assert_allclose(fields["velocity"][1 * 8 + 6], [2.0, 2.0, 0.0], rtol=1e-14)
    assert fields["density"][0, 0] == fields["mean_angle"][0, 0] == fields["S"][0, 0] == 0.0
    # Axes at -30 and 0 degrees: S is the cosine of what lies between them.
    assert np.isclose(fields["S"][1, 6], np.cos(np.pi / 6), rtol=1e-14)
    assert np.isclose(fields["angle"][1, 6], -np.pi / 12, rtol=1e-14)
    assert np.isclose(fields["speed"][1, 6], np.hypot(2.0, 2.0), rtol=1e-14)


def test_all_zero_density_is_written(rho_result: Result) -> None:
    variables = rho_result.variables | {"density": np.zeros((2, 6, 8))}
    fields = grid_fields(replace(rho_result, variables=variables), 1)
    assert all(np.all(values == 0.0) for values in fields.values())


def test_histogram_counts_all_realisations(particle_result: Result) -> None:
    images = list(histogram_images(particle_result, 10))
    assert [time for time, _ in images] == list(particle_result.times)
    density = images[1][1].cell_data["density"]
    # All particles lie inside: the integral is 1 to rounding.
    assert np.isclose(density.sum() * 0.1 * 0.075, 1.0, rtol=1e-12)
    np.testing.assert_array_equal(density, particle_result.density(10)[1].ravel())


def test_cells_in_solids_are_hidden_where_patches_bound_the_flow(rho_result: Result) -> None:
    """A square of 2 x 2 cells, of which ParaView draws nothing; without a flow all cells are drawn."""
    x, y = np.linspace(0.0, 1.0, 9), np.linspace(0.0, 0.75, 7)
    solid = np.array([[0.25, 0.25], [0.25, 0.5], [0.5, 0.5], [0.5, 0.25]])
    outline = polygon_outline([("solid", "wall", solid, True)])
    flow = FlowField.from_stream_function(np.zeros((7, 9)), x, y, "at rest", outline=outline)
    _, image = next(grid_images(rho_result, flow))
    hidden = image.cell_data["vtkGhostType"].reshape(6, 8)
    expected = np.zeros((6, 8))
    expected[2:4, 2:4] = HIDDEN_CELL
    np.testing.assert_array_equal(hidden, expected)
    _, image = next(grid_images(rho_result))
    assert "vtkGhostType" not in image.cell_data

"""FlowField: order, divergence, walls, continuity, outside, saving, and the kernel itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, WallVelocity, sample_flow
from ellipsoid_coupling.flow.outline import polygon_outline
from tests.flow.known import Array, points, spline, velocity


def test_velocity_is_third_order() -> None:
    """The derivative of a cubic spline is third order; halving h divides the error by 8 +- 10 %."""
    errors = []
    for cells in (32, 64, 128):
        x, y = points(20_000)
        sample, exact = spline(cells).evaluate(x, y), velocity(x, y)
        error = np.hypot(sample.velocity_x - exact[0], sample.velocity_y - exact[1])
        errors.append(np.sqrt(np.mean(error**2)))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 2.9) & (orders < 3.15)), orders


def test_divergence_vanishes_by_differences() -> None:
    """Five-point differences are exact for the cubic of a cell: 1e-10 is rounding over the step."""
    field, step = spline(16), 1e-3
    # Within the middle of the cells, so that no difference reaches into the next one.
    x, y = ((np.floor(16 * at) + 0.25 + 0.5 * (16 * at % 1)) / 16 for at in points(2000))

    def slope(f: Callable[[float], Array]) -> Array:
        far, near = f(2.0 * step) - f(-2.0 * step), f(step) - f(-step)
        return (8.0 * near - far) / (12.0 * step)

    dux_dx = slope(lambda s: field.evaluate(x + s, y).velocity_x)
    duy_dy = slope(lambda s: field.evaluate(x, y + s).velocity_y)
    dux_dy = slope(lambda s: field.evaluate(x, y + s).velocity_x)
    duy_dx = slope(lambda s: field.evaluate(x + s, y).velocity_y)
    sample = field.evaluate(x, y)
    assert np.abs(dux_dx + duy_dy).max() < 1e-10
    np.testing.assert_allclose(sample.dux_dx, dux_dx, atol=1e-10)
    np.testing.assert_allclose(-sample.dux_dx, duy_dy, atol=1e-10)
    np.testing.assert_allclose(sample.dux_dy, dux_dy, atol=1e-10)
    np.testing.assert_allclose(sample.duy_dx, duy_dx, atol=1e-10)


def test_nothing_crosses_a_wall() -> None:
    """Psi is constant along closed walls, so the normal velocity is 0 to rounding everywhere."""
    field = spline(16)
    along = np.linspace(0.0, 1.0, 1001)
    for wall in (0.0, 1.0):
        assert np.abs(field.evaluate(np.full(1001, wall), along).velocity_x).max() < 1e-15
        assert np.abs(field.evaluate(along, np.full(1001, wall)).velocity_y).max() < 1e-15


def test_walls_move_as_given() -> None:
    """The tangential velocity is the end slope: exact at the nodes, to rounding."""
    field, nodes = spline(16), np.linspace(0.0, 1.0, 17)
    lid = field.evaluate(nodes, np.ones(17)).velocity_x
    np.testing.assert_allclose(lid, velocity(nodes, np.ones(17))[0], atol=1e-14)
    for side in (0.0, 1.0):
        still = field.evaluate(np.full(17, side), nodes).velocity_y
        np.testing.assert_allclose(still, 0.0, atol=1e-14)


def test_a_lid_that_moves_at_its_corner_does_not_open_the_wall() -> None:
    """The lid's speed of 1 at the corners must give way to the closed side walls."""
    nodes = np.linspace(0.0, 1.0, 17)
    still, psi = np.zeros(17), spline(16)
    grid = np.meshgrid(nodes, nodes)
    values = np.sin(np.pi * grid[0]) ** 2 * grid[1] ** 2 * (1.0 - grid[1])
    values[:, -1] = 0.0
    walls = WallVelocity(still, still, still, np.ones(17))
    field = FlowField.from_stream_function(values, nodes, nodes, psi.origin, walls)
    assert np.abs(field.evaluate(np.ones(101), np.linspace(0, 1, 101)).velocity_x).max() < 1e-15


def test_gradient_is_continuous_across_cells() -> None:
    """C1 velocity: both sides of a cell's rim agree up to the third derivative times their gap."""
    field, gap = spline(16), 1e-9
    rim = np.arange(1.0, 16.0) / 16
    x, y = np.meshgrid(rim, np.linspace(0.01, 0.99, 50))
    for before, after in (
        (field.evaluate(x - gap, y), field.evaluate(x + gap, y)),
        (field.evaluate(y, x - gap), field.evaluate(y, x + gap)),
    ):
        for one, other in zip(before[:5], after[:5], strict=True):
            assert np.abs(one - other).max() < 1e3 * gap


def test_kernel_is_scipys_spline_and_its_own_python() -> None:
    """Three implementations of one polynomial: equal to rounding times cells squared."""
    field = spline(8)
    knots = np.arange(-3.0, 12.0) / 8.0
    x, y = points(40)
    for at_x, at_y in zip(x, y, strict=True):
        found = sample_flow(field.arrays, at_x, at_y)
        slow = plain(sample_flow)(field.arrays, at_x, at_y)
        np.testing.assert_allclose(found, slow, atol=1e-12)

        def psi(nu_y: int, nu_x: int, at_x: float = at_x, at_y: float = at_y) -> float:
            column = BSpline(knots, field.arrays.coefficients, 3)(at_y, nu_y)
            return float(BSpline(knots, column, 3)(at_x, nu_x))

        theirs = (psi(1, 0), -psi(0, 1), psi(1, 1), psi(2, 0), -psi(0, 2), True)
        np.testing.assert_allclose(found, theirs, atol=1e-12)


def test_outside_is_reported() -> None:
    """Beyond the rim's 1e-9 and for NaN and infinity; on the rim and by rounding beyond, not."""
    field = spline(8)
    x = np.array([0.0, 1.0, 1.0 + 1e-10, -1e-10, 1.0 + 1e-8, -1e-8, 2.0, np.nan, np.inf, 0.5])
    y = np.array([0.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, np.nan])
    inside = field.evaluate(x, y).inside
    assert inside.tolist() == [True] * 4 + [False] * 6


def test_masked_cells_are_outside() -> None:
    nodes = np.linspace(0.0, 1.0, 9)
    cells = np.ones((8, 8), bool)
    cells[4:, 6:] = False
    psi = np.add.outer(nodes, -nodes)
    field = FlowField.from_stream_function(psi, nodes, nodes, "masked", inside=cells)
    assert field.evaluate([0.9, 0.1], [0.9, 0.9]).inside.tolist() == [False, True]


def test_continued_takes_the_walls_velocity() -> None:
    """A ghost cell beyond a wall sees the nearest wall point's velocity, bit for bit."""
    field = spline(8)
    beyond, wall = field.continued([0.4, 1.5], [1.3, 2.0]), field.evaluate([0.4, 1.0], [1.0, 1.0])
    for one, other in zip(beyond, wall, strict=True):
        np.testing.assert_array_equal(one, other)


def test_evaluate_keeps_the_shape() -> None:
    sample = spline(8).evaluate(np.zeros((3, 1)), np.zeros((1, 4)))
    assert sample.velocity_x.shape == sample.inside.shape == (3, 4)


def test_saved_is_loaded_bit_for_bit(tmp_path: Path) -> None:
    field = spline(8)
    field.save(tmp_path / "flow.npz")
    loaded = FlowField.load(tmp_path / "flow.npz")
    assert loaded.origin == field.origin
    assert loaded.bounds == field.bounds
    assert loaded.cells == (8, 8)
    for one, other in zip(loaded.evaluate(*points(50)), field.evaluate(*points(50)), strict=True):
        np.testing.assert_array_equal(one, other)
    assert [path.name for path in tmp_path.iterdir()] == ["flow.npz"]


def outlined() -> FlowField:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    outline = polygon_outline(
        [("w\u00e4nde", "wall", corners[:3], False), ("in", "patch", corners[2:], False)]
    )
    return replace(spline(8), outline=outline._replace(outflow=np.array([0.0, 0.5, -0.5])))


def test_an_outline_is_saved_and_told_by_the_digest(tmp_path: Path) -> None:
    field, plain_one = outlined(), spline(8)
    field.save(tmp_path / "flow.npz")
    loaded = FlowField.load(tmp_path / "flow.npz")
    assert field.outline is not None
    assert loaded.outline is not None
    for before, after in zip(field.outline, loaded.outline, strict=True):
        np.testing.assert_array_equal(before, after)
    assert loaded.digest == field.digest != plain_one.digest
    renamed = replace(field, outline=field.outline._replace(names=("w", "in")))
    assert renamed.digest != field.digest


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("outline_ends", np.zeros((3, 2, 2))), ("outline_ends", np.ones((2, 2, 2))),
        ("outline_patch", np.array([0, 1, 2])), ("outline_patch", np.array([0, 0, -1])),
        ("outline_patch", np.array([0.0, 0.0, 1.0])), ("outline_outflow", np.array([0.0, np.nan, 1.0])),
        ("outline_names", np.array(["a", "b\x1b[0m"])), ("outline_names", np.array([], "<U1")),
        ("outline_types", np.array(["wall"])), ("outline_types", np.array([1, 2])), ("outline_types", None),
    ],
)  # fmt: skip
def test_a_broken_outline_is_an_input_error(tmp_path: Path, name: str, value: Array | None) -> None:
    outlined().save(tmp_path / "flow.npz")
    with np.load(tmp_path / "flow.npz") as file:
        arrays = dict(file)
    if value is None:
        arrays.pop(name)
    else:
        arrays[name] = value
    np.savez(tmp_path / "flow.npz", **arrays)
    with pytest.raises(InputError, match="outline"):
        FlowField.load(tmp_path / "flow.npz")


@pytest.mark.parametrize("content", [b"", b"not a flow", b"PK\x03\x04 broken"])
def test_loading_something_else_is_an_input_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "flow.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"flow\.npz: expected a flow saved"):
        FlowField.load(path)


def test_loading_other_arrays_or_nothing_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="missing"):
        FlowField.load(tmp_path / "missing.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match="coefficients"):
        FlowField.load(tmp_path / "other.npz")


def test_loading_nan_is_an_input_error(tmp_path: Path) -> None:
    field = spline(8)
    field.arrays.coefficients[3, 3] = np.nan
    field.save(tmp_path / "nan.npz")
    with pytest.raises(InputError, match=r"coefficients\[3, 3\].*NaN"):
        FlowField.load(tmp_path / "nan.npz")


def test_a_wrong_shape_is_an_input_error() -> None:
    nodes = np.linspace(0.0, 1.0, 9)
    with pytest.raises(InputError, match=r"psi\[y, x\]"):
        FlowField.from_stream_function(np.zeros((9, 8)), nodes, nodes, "wrong")

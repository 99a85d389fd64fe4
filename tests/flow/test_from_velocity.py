"""Flows from formulas and from velocities on a grid, against what they were made from."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, analytic_flow, register_flow

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
SQUARE = ((0.0, 1.0), (0.0, 1.0))
K = 2.0 * np.pi
# Inside and up to the rim, on no node.
X, Y = np.meshgrid(np.linspace(0.0, 1.0, 211), np.linspace(0.0, 1.0, 193))


def vortices(x: Array, y: Array) -> tuple[Array, Array]:
    """Taylor and Green's, of psi = sin(K x) sin(K y)/K."""
    return np.sin(K * x) * np.cos(K * y), -np.cos(K * x) * np.sin(K * y)


def off(field: FlowField) -> float:
    """Rms distance from the vortices, whose speed has the rms 1/2^(1/2)."""
    sample, exact = field.evaluate(X, Y), vortices(X, Y)
    return float(
        np.sqrt(np.mean((sample.velocity_x - exact[0]) ** 2 + (sample.velocity_y - exact[1]) ** 2))
    )


def test_rotation_is_exact_to_rounding() -> None:
    """Linear velocities: the integrals along the edges, and the quadratic psi, are exact."""
    field = FlowField.from_function(lambda x, y: (y, -x), ((-1.0, 2.0), (-1.0, 1.0)), cells=7)
    x, y = np.linspace(-1.0, 2.0, 31), np.linspace(-1.0, 1.0, 31)
    sample = field.evaluate(x, y)
    np.testing.assert_allclose(sample.velocity_x, y, atol=1e-13)
    np.testing.assert_allclose(sample.velocity_y, -x, atol=1e-13)
    np.testing.assert_allclose(sample.dux_dy, 1.0, atol=1e-12)


@pytest.mark.parametrize("way", ["velocity", "psi"])
def test_vortices_are_met_to_the_order_of_the_spline(way: str) -> None:
    """Velocities are slopes of a cubic spline: third order, so halving h divides the error by about 8.

    From 64 cells on: below, psi's one-sided slopes at the rim, of fourth order, are the larger part.
    """

    def psi(x: Array, y: Array) -> Array:
        return np.sin(K * x) * np.sin(K * y) / K

    made_from = vortices if way == "velocity" else psi
    errors = [off(FlowField.from_function(made_from, SQUARE, cells=n)) for n in (64, 128, 256)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 2.9) & (orders < 3.2)), orders


def test_a_grid_of_velocities_is_the_formula_sampled() -> None:
    """The same numbers by both ways, on a rectangle that is no square: axis order (y, x)."""
    domain = ((0.0, 1.0), (0.0, 0.5))
    x, y = np.linspace(*domain[0], 41), np.linspace(*domain[1], 41)
    by_grid = FlowField.from_velocity(*vortices(*np.meshgrid(x, y)), x, y)
    by_formula = FlowField.from_function(vortices, domain, cells=40)
    assert np.array_equal(by_grid.arrays.coefficients, by_formula.arrays.coefficients)
    wide = FlowField.from_velocity(*vortices(*np.meshgrid(x[:21], y)), x[:21], y)
    assert wide.cells == (40, 20)


def test_nothing_crosses_a_side_that_the_velocity_does_not_cross() -> None:
    """The vortices' normal velocity on the square's sides is 0 to rounding, and stays so."""
    field = FlowField.from_function(vortices, SQUARE, cells=20)
    along = np.linspace(0.0, 1.0, 301)
    for side in (0.0, 1.0):
        assert np.abs(field.evaluate(np.full(301, side), along).velocity_x).max() < 1e-14
        assert np.abs(field.evaluate(along, np.full(301, side)).velocity_y).max() < 1e-14


def test_the_part_without_divergence_is_left_and_the_rest_is_told() -> None:
    """The leak of u = (y + e x, -x + e y) on [-1, 1]^2 is 2 e. The nearest flow lacks grad(phi),

        laplace(phi) = 2 e inside,  phi = 0 on the rim,

    which is the torsion of a square bar: int |grad(phi)|^2 = 2.2492 e^2 (Saint-Venant), of
    int |u|^2 = (1 + e^2) 8/3. So 0.918 e is lost, less what edges on the rim weigh too much (first order
    in h = 0.1), and of the leak 0.323 e (rms) stays beside the rotation.
    """
    e = 0.04

    def leaking(x: Array, y: Array) -> tuple[Array, Array]:
        return y + e * x, -x + e * y

    domain = ((-1.0, 1.0), (-1.0, 1.0))
    field = FlowField.from_function(leaking, domain, cells=20, origin="a leak")
    told = float(field.origin.split(", ")[1].split(" %")[0]) / 100.0
    assert abs(told - 0.918 * e) < 0.05 * e
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(-1.0, 1.0, 41))
    sample = field.evaluate(x, y)
    rest = np.sqrt(np.mean((sample.velocity_x - y) ** 2 + (sample.velocity_y + x) ** 2))
    assert abs(rest - 0.323 * e) < 0.1 * e
    e = 0.2
    with pytest.raises(
        InputError, match=r"without divergence, to 5% \(rms\), found one that is 0\.18 "
    ):
        FlowField.from_function(leaking, domain, cells=20)


def test_a_parallel_flow_may_be_given_by_numbers() -> None:
    field = FlowField.from_function(lambda _x, _y: (2.0, 0.0), SQUARE, cells=np.int64(4))
    np.testing.assert_allclose(field.evaluate(0.3, 0.7)[:2], (2.0, 0.0), atol=1e-14)


def test_a_fluid_at_rest_is_a_flow() -> None:
    still = FlowField.from_function(lambda x, _y: (0.0 * x, 0.0), SQUARE, cells=8)
    assert still.largest_speed == 0.0


NODES = np.linspace(0.0, 1.0, 9)
GRID = np.zeros((9, 9))


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: FlowField.from_function(lambda x, y: (math.sin(x), y), SQUARE), "np.sin"),
        (
            lambda: FlowField.from_function(lambda x, y: (1.0 / x, y), SQUARE),
            "NaN or infinity at u",
        ),
        (lambda: FlowField.from_function(lambda x, y: np.log(x) + y, SQUARE), "at psi"),
        (lambda: FlowField.from_function(lambda x, y: (x, y, x), SQUARE), "two components"),
        (lambda: FlowField.from_function(lambda x, _y: x[:2], SQUARE), "shape"),
        (lambda: FlowField.from_function(vortices, SQUARE, cells=3), "4 or more"),
        (lambda: FlowField.from_function(vortices, SQUARE, cells=True), "whole number"),
        (lambda: FlowField.from_function(vortices, ((1.0, 0.0), (0.0, 1.0))), "low < high"),
        (lambda: FlowField.from_velocity(GRID[:8], GRID, NODES, NODES), r"axis order \(y, x\)"),
        (lambda: FlowField.from_velocity(GRID, GRID, NODES**2, NODES), "evenly spaced"),
        (lambda: FlowField.from_velocity(GRID, GRID, NODES[::-1], NODES), "rising"),
        (lambda: FlowField.from_velocity(GRID[:, :4], GRID[:, :4], NODES[:4], NODES), "at least 5"),
    ],
)
def test_what_is_no_flow_is_refused_in_one_line(make: object, told: str) -> None:
    assert callable(make)
    with np.errstate(all="ignore"), pytest.raises(InputError, match=told) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_given_flow_runs_as_the_registered_formula_does() -> None:
    """Two ways to the same psi: the spline of psi itself, and that of its velocity, 2e-5 apart."""

    def psi(x: Array, y: Array) -> Array:
        return np.sin(K * x) * np.sin(K * y) / K

    register_flow("test_from_velocity_vortices", psi)
    scene = ec.load_scene(
        {
            "name": "vortices",
            "times": [0.5],
            "domain": {"x": [0, 1], "y": [0, 1], "boundary": "reflecting"},
            "particles": {"length": 0.04, "width": 0.01, "inertia": 1e-3, "number": 20},
            "start": {"x": [0.1, 0.9], "y": [0.1, 0.9]},
            "flow": {"source": "given", "drag": 5.0, "angular_drag": 5.0},
            "numerics": {"cell": 0.05},
        }
    )
    flow = FlowField.from_function(vortices, SQUARE, cells=100)
    given = ec.simulate(scene, "microscopic", flow=flow)
    named = analytic_flow("test_from_velocity_vortices", domain=SQUARE)
    other = ec.simulate(scene, "microscopic", flow=named)
    for name in ("x", "y", "angle"):
        np.testing.assert_allclose(given.variables[name], other.variables[name], atol=1e-3)


def test_a_flow_that_is_missing_or_not_wanted_is_told_with_a_remedy() -> None:
    flow = FlowField.from_function(vortices, SQUARE, cells=8)
    with pytest.raises(InputError, match=r"a scene with a \[flow\] section.*source = \"given\""):
        ec.simulate("stationary", "microscopic", flow=flow)
    given = {"source": "given", "drag": 1.0, "angular_drag": 1.0}
    with pytest.raises(InputError, match=r"flow=\.\.\. in Python"):
        ec.simulate(ec.load_scene("cavity", {"flow": given}), "microscopic")
    with pytest.raises(InputError, match="no field, case or parameters"):
        ec.load_scene("cavity", {"flow": {**given, "field": "cavity"}})

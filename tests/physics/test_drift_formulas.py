"""Jeffery's term and the outer potentials against their definitions, in particles and in cells."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import ellipsoid_coupling
from ellipsoid_coupling.compiled.jit import kernel, plain
from ellipsoid_coupling.finite_volume.cell_acceleration import (
    angular_rate,
    cell_tables,
    largest_outer_torque,
)
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.physics.angular import (
    Axis,
    Sine,
    angular_energy,
    outer_torque,
    outer_torque_slope,
)
from ellipsoid_coupling.physics.drift import External, Fluid, external_drift
from ellipsoid_coupling.physics.jeffery import jeffery_coefficients, jeffery_rate, jeffery_slope
from ellipsoid_coupling.physics.outer import Gravity, Harmonic, outer_energy, outer_force
from ellipsoid_coupling.physics.outer.gravity import WithGravity
from ellipsoid_coupling.scenes.kinds import Record

GRADIENT = np.array([[0.3, -1.1], [0.7, -0.3]])  # d u_i / d x_j


@kernel
def turning(angle: float, xx: float, xy: float, yx: float, factor: float) -> tuple[float, float]:
    a, b, c = jeffery_coefficients(1.0, xx, xy, yx, factor)
    c2, s2 = math.cos(2.0 * angle), math.sin(2.0 * angle)
    return jeffery_rate(c2, s2, a, b, c), jeffery_slope(c2, s2, b, c)


def matrix_form(angle: float) -> float:
    """1/2 rot u + lambda n_perp . E n with lambda = 0.6."""
    across = np.array([-math.sin(angle), math.cos(angle)])
    along = np.array([math.cos(angle), math.sin(angle)])
    strain = 0.5 * (GRADIENT + GRADIENT.T)
    return float(0.5 * (GRADIENT[1, 0] - GRADIENT[0, 1]) + 0.6 * across @ strain @ along)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 2.9])
def test_jeffery_equals_the_matrix_form(angle: float) -> None:
    """Exact to rounding; its slope to 1e-9, the error of the central difference."""
    rate, slope = turning(angle, 0.3, -1.1, 0.7, 0.6)
    assert rate == pytest.approx(matrix_form(angle), abs=1e-15)
    step = 1e-5
    difference = (matrix_form(angle + step) - matrix_form(angle - step)) / (2.0 * step)
    assert slope == pytest.approx(difference, abs=1e-9)


def test_a_circle_turns_with_the_fluid() -> None:
    rate, slope = turning(0.4, 0.3, -1.1, 0.7, 0.0)
    assert rate == pytest.approx(0.9, abs=1e-15)
    assert slope == 0.0


def slope_of(function: Callable[[float], float], at: float) -> float:
    """The central difference, error 1e-10 for functions of size 1."""
    return (function(at + 1e-5) - function(at - 1e-5)) / 2e-5


FALLING = Gravity(0.7, -1.1)


@pytest.mark.parametrize(
    "potential", [Harmonic(1.7), None, FALLING, WithGravity(Harmonic(1.7), FALLING)]
)
def test_outer_forces_are_minus_the_gradients(potential: Record | None) -> None:
    x, y = 0.4, -0.9
    force = outer_force(potential, x, y)
    assert force[0] == pytest.approx(
        -slope_of(lambda a: outer_energy(potential, a, y), x), abs=1e-9
    )
    assert force[1] == pytest.approx(
        -slope_of(lambda a: outer_energy(potential, x, a), y), abs=1e-9
    )


def test_the_harmonic_potential_is_its_formula() -> None:
    assert outer_energy(Harmonic(1.7), 0.4, -0.9) == pytest.approx(1.7 * 0.97 / 2.0, rel=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1.1, 4.0])
@pytest.mark.parametrize("potential", [Sine(0.8), Axis(0.8, 0.3), None])
def test_outer_torques_are_minus_the_derivatives(potential: Record | None, angle: float) -> None:
    torque = -slope_of(lambda a: angular_energy(potential, a), angle)
    slope = slope_of(lambda a: outer_torque(potential, a), angle)
    assert outer_torque(potential, angle) == pytest.approx(torque, abs=1e-9)
    assert outer_torque_slope(potential, angle) == pytest.approx(slope, abs=1e-9)


def test_angular_potentials_are_their_formulas() -> None:
    assert angular_energy(Sine(0.8), 1.1) == pytest.approx(0.8 * math.sin(1.1), rel=1e-15)
    axis = -0.8 * math.cos(1.1 - 0.3) ** 2
    assert angular_energy(Axis(0.8, 0.3), 1.1) == pytest.approx(axis, rel=1e-15)
    assert angular_energy(Axis(0.8, 0.3), 1.1 + math.pi) == pytest.approx(axis, rel=1e-14)


def everything(flow: FlowField) -> External:
    return External(Fluid(flow.arrays, 2.0, 3.0, 0.6), Harmonic(1.7), Sine(0.8))


def test_particles_and_cells_have_the_same_drift(rotation_flow: FlowField) -> None:
    """The same bits: both call the same formula, of which cells keep the part without the angle."""
    external = everything(rotation_flow)
    x, y = np.linspace(-1.0, 0.9, 7), np.linspace(-0.8, 1.0, 5)
    steady, turning = cell_tables(external, 0.0, x, y)
    columns, rows = (a.ravel() for a in np.meshgrid(x, y))
    angle = np.linspace(-3.0, 7.0, columns.size)
    force = np.empty((3, columns.size))
    particle_forces(Drift(external), 0.0, np.array([columns, rows, angle]), force)
    assert np.array_equal(force[:2], steady.reshape(2, -1))
    for k in range(columns.size):
        j, i = divmod(k, x.size)
        rate, _ = angular_rate(turning, external.angular, j, i, float(angle[k]))
        assert rate == pytest.approx(force[2, k], rel=1e-15)


def test_the_drift_is_its_sum(rotation_flow: FlowField) -> None:
    """By numpy, to rounding, compiled and not; u = (y, -x), so g = -1."""
    external, x, y, angle = everything(rotation_flow), 0.4, -0.3, 1.3
    expected = (2.0 * y - 1.7 * x, -2.0 * x - 1.7 * y, -3.0 - 0.8 * math.cos(angle))
    axis = math.cos(2.0 * angle), math.sin(2.0 * angle)
    for formula in (external_drift, plain(external_drift)):
        found = formula(*external, 0.0, (x, y, angle), axis)
        assert found == pytest.approx(expected, abs=1e-14)


def test_the_largest_torque_of_a_sine_is_its_amplitude() -> None:
    angles = 2.0 * np.pi * np.arange(8) / 8
    assert largest_outer_torque(Sine(0.8), angles) == 0.8
    assert largest_outer_torque(None, angles) == 0.0


PACKAGE = Path(ellipsoid_coupling.__file__).parent
GRADIENTS = {"dux_dy", "duy_dx"}


def named(node: ast.AST) -> set[str]:
    """All names and attributes in an expression."""
    names = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    return names | {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)}


def sums(tree: ast.AST) -> list[ast.BinOp]:
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub)
    ]


def is_strain(tree: ast.AST) -> bool:
    """d_x u_y and d_y u_x added or subtracted: strain and rotation, from which Jeffery's term is made."""
    return any(named(node.left) | named(node.right) >= GRADIENTS for node in sums(tree))


def is_linear_in_the_axis(tree: ast.AST) -> bool:
    """A sum of something times sin 2 theta and something else times cos 2 theta."""
    return any({"s2", "c2"} <= weighted(node) for node in sums(tree))


def weighted(node: ast.AST) -> set[str]:
    """The names that stand in products, but not with one another."""
    products = (
        n for n in ast.walk(node) if isinstance(n, ast.BinOp) and isinstance(n.op, ast.Mult)
    )
    pairs = ([n.id for n in (p.left, p.right) if isinstance(n, ast.Name)] for p in products)
    return {name for pair in pairs for name in pair if sum(n in ("s2", "c2") for n in pair) == 1}


def has_field(name: str) -> Callable[[ast.AST], bool]:
    """A potential's own number is read."""

    def found(tree: ast.AST) -> bool:
        reads = (n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr == name)
        return any({"potential", "angular", "outer", "terms"} & named(n.value) for n in reads)

    return found


@pytest.mark.parametrize(
    ("is_formula", "places"),
    [
        (is_strain, ["flow/scales.py", "physics/jeffery.py"]),
        (is_linear_in_the_axis, ["physics/jeffery.py"]),
        (has_field("stiffness"), ["physics/outer/harmonic.py"]),
        (has_field("amplitude"), ["physics/angular/axis.py", "physics/angular/sine.py"]),
    ],
    ids=["gradients", "a + b sin + c cos", "V1", "V2"],
)
def test_each_formula_stands_once(is_formula: Callable[[ast.AST], bool], places: list[str]) -> None:
    """Jeffery's, V1 and V2 in no other file of what computes.

    Pictures may show a flow's rotation, and `flow.scales` says how large its shear is.
    """
    found = [
        source.relative_to(PACKAGE).as_posix()
        for source in sorted(PACKAGE.rglob("*.py"))
        if "output" not in source.parts and is_formula(ast.parse(source.read_text()))
    ]
    assert found == places

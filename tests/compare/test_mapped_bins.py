"""Bins of whole runs whose density has a closed form: linear flows without interaction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import exact_reference
from ellipsoid_coupling.flow import FlowField, analytic_flow
from ellipsoid_coupling.flow.provide import SHIPPED
from ellipsoid_coupling.geometry.flow_map import part_below
from ellipsoid_coupling.result import FROZEN, SAMPLES_ACROSS, Result

Floats = NDArray[np.float64]

FREE = {"interaction": None, "particles.realisations": 1, "times": [0.5, 1.5]}
EDGES = np.linspace(-1.5, 1.5, 21)
AREA = 0.15**2


def carried(gradient: Floats, t: float) -> Floats:
    """The matrix from start to place of x'' = gradient x - x', from rest."""
    motion = np.block([[np.zeros((2, 2)), np.eye(2)], [gradient, -np.eye(2)]])
    return np.asarray(expm(t * motion)[:2, :2])


def overlaps(half: float) -> Floats:
    """The masses of a constant density on (-half, half) in the 20 bins."""
    return np.asarray(np.diff(np.clip(EDGES, -half, half)) / (2.0 * half))


def test_a_stagnation_flow_fills_bins_exactly() -> None:
    """Products of overlaps: to RK4's 1e-8, from 32 x 32 samples; the part beyond the domain is in none."""
    scene = ec.load_scene("top_bottom", FREE)
    density = exact_reference(scene, analytic_flow("top_bottom"), 32).density(20) * AREA
    for k, t in enumerate(scene.times):
        grown = np.abs(np.diag(carried(np.diag([-1.0, 1.0]), t)))
        exact = np.outer(overlaps(grown[1]), overlaps(grown[0]))
        assert np.abs(density[k] - exact).sum() < 1e-7


def test_a_rotation_fills_bins_exactly(rotation_flow: FlowField) -> None:
    """Both marginals are trapezoids: to the steps' tolerance of 1e-4, and all of the mass is there."""
    scene = ec.load_scene("rotation", FREE)
    result = ec.simulate(scene, "mckean_vlasov", flow=rotation_flow)
    density = result.density(20) * AREA
    assert density.sum(axis=(1, 2)) == pytest.approx(1.0, abs=1e-12)
    for k, t in enumerate(scene.times):
        matrix = carried(np.array([[0.0, 1.0], [-1.0, 0.0]]), t)
        for axis in (0, 1):
            centre, sides = matrix[axis] @ [0.45, 0.0], 0.5 * matrix[axis]
            exact = np.diff([part_below(edge - centre, *sides) for edge in EDGES])
            assert np.abs(density[k].sum(axis=axis) - exact).sum() < 5e-4


def test_reflecting_walls_keep_all_mass() -> None:
    """To rounding, also where parallelograms reach beyond a wall."""
    scene = ec.load_scene("cavity_free", {"particles.realisations": 1, "times": [5.0]})
    result = ec.simulate(scene, "mckean_vlasov", flow=FlowField.load(SHIPPED / "cavity.npz"))
    assert result.density(20).sum() / 400 == pytest.approx(1.0, abs=1e-12)
    angles = result.angle_distribution(60).sum() * 2.0 * np.pi / 60
    assert angles == pytest.approx(1.0, abs=1e-12)


def small_run() -> Result:
    scene = ec.load_scene("rotation", FREE | {"times": [0.5]})
    return ec.simulate(scene, "mckean_vlasov", flow=analytic_flow("rotation"))


def test_a_saved_result_has_the_same_bins(tmp_path: Path) -> None:
    result = small_run()
    result.save(tmp_path / "result.nc")
    loaded = Result.load(tmp_path / "result.nc")
    assert np.array_equal(loaded.density(20), result.density(20))
    assert np.array_equal(loaded.angle_distribution(), result.angle_distribution())


def test_without_a_whole_map_samples_are_counted() -> None:
    """No columns, a number that does not fit, or one that has left: plain histograms."""
    result = small_run()
    size = result.variables["x"][0].size
    counted = replace(result, attributes=result.attributes | {SAMPLES_ACROSS: 0.0})
    whole = np.round(counted.density(20) * AREA * size, 9)
    assert np.array_equal(whole, np.round(whole))
    assert not np.array_equal(counted.density(20), result.density(20))
    for columns in (-3.0, 7.0, 1e9):
        other = replace(result, attributes=result.attributes | {SAMPLES_ACROSS: columns})
        assert np.array_equal(other.density(20), counted.density(20))
    gone = np.zeros((1, 1, size))
    gone[0, 0, 3] = 1.0
    left = replace(result, variables=result.variables | {FROZEN: gone})
    assert left.density(20).sum() * AREA == pytest.approx(1.0 - 1.0 / size, abs=1e-12)

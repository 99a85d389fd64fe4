"""Errors, references and the frontier."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import (
    compare_runs,
    errors_against,
    exact_reference,
    has_exact_reference,
    sampling_errors,
    short_frontier,
    short_runs,
    write_table,
)
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField

TINY = {
    "interaction": None,
    "particles.number": 50,
    "particles.realisations": 4,
    "numerics.cell": 0.05,
    "times": [0.2, 0.5],
}


def test_equal_results_are_no_distance_apart_and_strangers_two() -> None:
    result = ec.simulate(ec.load_scene("rotation", TINY), "microscopic")
    same = errors_against(result, result)
    assert np.all(same.density == 0.0)
    far = replace(result, variables=result.variables | {"x": -result.variables["x"] - 0.5})
    assert np.allclose(errors_against(far, result).density, 2.0)


def test_other_times_cannot_be_compared() -> None:
    one = ec.simulate(ec.load_scene("rotation", TINY), "microscopic")
    other = ec.simulate(ec.load_scene("rotation", TINY | {"times": [0.3]}), "microscopic")
    with pytest.raises(InputError, match="same save times"):
        errors_against(one, other)


def test_the_sampling_error_is_that_of_independent_samples() -> None:
    """200 x 50 independent particles: the estimate is the law of large numbers' to 30 %."""
    scene = ec.load_scene("rotation", TINY | {"particles.realisations": 200})
    ensemble = ec.simulate(scene, "microscopic")
    estimate = sampling_errors(ensemble).density
    density = ensemble.density(20)
    # E|n/N - p| summed over bins, n Poisson: sqrt(2/pi) sum sqrt(p/N)
    mass = density * 9.0 / 400
    expected = math.sqrt(2 / math.pi) * np.sqrt(mass / 10_000).sum(axis=(1, 2))
    assert np.allclose(estimate, expected, rtol=0.3)


def test_the_reference_is_exact(rotation_flow: FlowField) -> None:
    """Against the matrix exponential of the linear flow, 1e-8 (RK4 at dt = 0.01)."""
    from scipy.linalg import expm

    scene = ec.load_scene("rotation", TINY)
    end = exact_reference(scene, rotation_flow, side=32).variables
    part = (np.arange(32) + 0.5) / 32
    x0, y0 = np.meshgrid(0.2 + 0.5 * part, -0.25 + 0.5 * part)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    move = expm(0.5 * np.block([[np.zeros((2, 2)), np.eye(2)], [turn, -np.eye(2)]]))[:2, :2]
    expected = np.einsum("ij,jyx->iyx", move, np.array([x0, y0]))
    assert np.abs(end["x"][1, 0] - expected[0].ravel()).max() < 1e-8
    assert np.abs(end["y"][1, 0] - expected[1].ravel()).max() < 1e-8


def test_only_independent_particles_have_an_exact_reference() -> None:
    assert has_exact_reference(ec.load_scene("cavity_free"))
    assert not has_exact_reference(ec.load_scene("cavity"))
    assert not has_exact_reference(ec.load_scene("stationary", {"interaction": None}))
    with pytest.raises(InputError, match="no interaction"):
        exact_reference(ec.load_scene("cavity"), None)


def test_a_short_frontier_has_three_resolutions_of_each(tmp_path: Path) -> None:
    scene = ec.load_scene("rotation", TINY)
    cases = short_runs(scene)
    assert len(cases) == 12
    assert [c.scene.numerics.cell for c in cases if c.model != "microscopic"][:3] == [
        0.2,
        0.1,
        0.05,
    ]
    frontier = short_frontier(scene, _flow(), folder=tmp_path)
    assert frontier.exact
    assert len(frontier.rows) == 12
    assert (tmp_path / "rotation-microscopic-paper" / "result.nc").is_file()
    fine = {(r.model, r.scheme): r for r in frontier.rows}
    accurate, paper = (
        fine["rho_mono_kinetic", s].density_errors[-1] for s in ("accurate", "paper")
    )
    assert accurate < paper
    lines = list(csv.DictReader(write_table([frontier], tmp_path).read_text().splitlines()))
    assert len(lines) == 24
    assert {line["reference"] for line in lines} == {"exact"}
    assert all(float(line["density_error"]) >= 0 for line in lines)


def _flow() -> FlowField:
    from ellipsoid_coupling.flow import analytic_flow

    return analytic_flow("rotation")


def test_with_interaction_the_reference_is_an_own_ensemble() -> None:
    scene = ec.load_scene("rotation", TINY | {"interaction.strength": 1.0, "times": [0.1]})
    frontier = short_frontier(scene, _flow())
    assert not frontier.exact
    assert frontier.reference.attributes["seed"] == 1
    assert frontier.sampling.density[0] > 0
    # The rows share no start position with the reference: they err by its noise and their own.
    micro = [row.density_errors[0] for row in frontier.rows if row.model == "microscopic"]
    assert all(error > 0.5 * frontier.sampling.density[0] for error in micro)


def test_finished_runs_are_compared(rotation_flow: FlowField) -> None:
    scene = ec.load_scene("rotation", TINY)
    runs = [ec.simulate(scene, m) for m in ("microscopic", "rho_mono_kinetic")]
    frontier = compare_runs(runs, rotation_flow)
    assert [row.model for row in frontier.rows] == ["microscopic", "rho_mono_kinetic"]
    other = ec.simulate(ec.load_scene("top_bottom", TINY), "microscopic")
    with pytest.raises(InputError, match="one scene"):
        compare_runs([runs[0], other], rotation_flow)

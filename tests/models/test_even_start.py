"""Samples without noise stand nearer along the axis that the flow draws out, and tell their columns."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.models import Setup, build_model, model_terms
from ellipsoid_coupling.models.even_start import Lattice, flow_map_columns, sample_lattice
from ellipsoid_coupling.scenes import load_scene


def setup_of(name: str, realisations: int = 1, **values: Any) -> Setup:
    scene = load_scene(name, {key.replace("__", "."): value for key, value in values.items()})
    flow = None if scene.flow is None else analytic_flow(scene.flow.name)
    return Setup(scene, model_terms(scene, "mckean_vlasov"), "accurate", flow, 0, realisations)


def test_a_stagnation_flow_is_sampled_along_its_outflow() -> None:
    """Lines along y grow by e^(0.618 t), 22 at t = 5, those along x shrink: the ratio's bound, 16."""
    rows, columns = sample_lattice(setup_of("top_bottom"), 65_536)
    assert (rows, columns) == (1024, 64)
    assert rows * columns == pytest.approx(65_536, rel=0.1)


def test_a_short_stretch_is_followed_by_its_size() -> None:
    """The exact growth is that of y'' = y - y' from rest: cosh and sinh; rows are multiples of 16."""
    time = 1.5
    root = 0.5 * np.sqrt(5.0)
    grown = np.exp(-0.5 * time) * (np.cosh(root * time) + 0.5 / root * np.sinh(root * time))
    rows, columns = sample_lattice(setup_of("top_bottom", times=[time]), 65_536)
    assert rows / columns == pytest.approx(grown, rel=0.1)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("rotation", {}),  # turns all lines alike
        ("top_bottom", {"times": [0.1]}),  # before anything has moved
        ("stationary", {"noise": None}),  # no flow
    ],
)
def test_elsewhere_the_lattice_is_square(name: str, values: dict[str, Any]) -> None:
    assert sample_lattice(setup_of(name, **values), 10_000) == Lattice(100, 100)


def test_a_few_samples_stay_square() -> None:
    assert sample_lattice(setup_of("top_bottom"), 200) == Lattice(14, 14)


def test_the_model_starts_there_and_tells_its_columns() -> None:
    setup = setup_of("top_bottom", 5, interaction=None)
    model = build_model("mckean_vlasov", setup)
    rows, columns = sample_lattice(setup, 5000)
    assert rows > 4 * columns
    start = model.snapshot()
    expected = even_points((-1.0, 1.0), (-1.0, 1.0), columns, rows)
    assert np.array_equal([start["x"][0], start["y"][0]], expected.reshape(2, -1))
    assert model.counts()["samples_across"] == columns


@pytest.mark.parametrize(
    "values",
    [
        {"noise__noise": 0.1, "noise__angular_noise": 0.0},
        {"noise__noise": 0.0, "noise__angular_noise": 0.1},
        {"domain__boundary": "periodic"},
        {"particles__number": 2, "start__points": [[0.3, 0.0], [0.4, 0.1]]},
    ],
)
def test_torn_maps_have_no_columns(values: dict[str, Any]) -> None:
    smooth, torn = setup_of("rotation"), setup_of("rotation", **values)
    assert flow_map_columns(smooth, None, 7) == 7
    assert flow_map_columns(torn, None, 7) == 0


def test_seeds_do_not_matter() -> None:
    setup = setup_of("top_bottom")
    assert sample_lattice(setup, 3000) == sample_lattice(replace(setup, seed=5), 3000)

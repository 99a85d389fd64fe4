"""Densities over angle on stairs, with interaction: what stays exact, and against samples of the limit."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.fluid_cells import fluid_cells
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, scene_from_table
from tests.staircase_flows import couette_ring, past_cylinder

Floats = NDArray[np.float64]

EACH = pytest.mark.parametrize(
    ("model", "scheme"),
    [
        ("rho_mono_kinetic", "accurate"),
        ("q_mono_kinetic", "accurate"),
        ("q_maxwellian", "accurate"),
        ("q_maxwellian", "paper"),
    ],
)


def scene(half: float, cell: float, **parts: Any) -> Scene:
    table: dict[str, Any] = {
        "name": "q on stairs", "times": [0.5],
        "domain": {"x": [-half, half], "y": [-half, half], "boundary": "open"},
        "particles": {"length": 0.2, "width": 0.1, "inertia": 0.01, "number": 400},
        "start": {"x": [-half, half], "y": [-half, half]},
        "flow": {"source": "openfoam", "field": "none", "drag": 3.0, "angular_drag": 3.0},
        "interaction": {"strength": 0.3},
        "numerics": {"cell": cell, "angle_cells": 8, "harmonics_tolerance": 1e-3},
    }  # fmt: skip
    for name, part in parts.items():
        table[name] = {**table.get(name, {}), **part} if isinstance(part, dict) else part
    kept = {name: part for name, part in table.items() if part is not None}
    return scene_from_table(kept, "q on stairs")


def fluid_of(result: Result, flow: FlowField) -> NDArray[np.bool_]:
    x = result.coordinates["x"]
    return fluid_cells(flow.outline, x, x, float(x[1] - x[0])).inside


@EACH
def test_interaction_in_the_ring_keeps_solids_empty_mass_and_symmetry(
    model: str, scheme: Any
) -> None:
    """With noise: 0 to the bit, rounding, and rounding that sums in another order stretch.

    The ring, its flow and the start are the same turned by half a turn.
    """
    flow = couette_ring()
    own = scene(
        1.0, 0.1, noise={"noise": 0.5, "angular_noise": 0.5},
        start={"x": [-0.9, 0.9], "y": [-0.7, 0.7]},
    )  # fmt: skip
    result = ec.simulate(own, model, scheme, flow=flow)
    fluid, density = fluid_of(result, flow), result.cell_density()[-1]
    assert not density[~fluid].any()
    assert result.variables["density"].min() >= 0.0
    masses = result.attributes
    assert abs(masses["mass_end"] + masses["mass_left"] - 1.0) < 1e-13
    assert abs(masses["mass_left"]) < 1e-15
    np.testing.assert_allclose(density, density[::-1, ::-1], atol=1e-7 * density.max())


@pytest.mark.parametrize(("model", "apart"), [("q_mono_kinetic", 0.12), ("rho_mono_kinetic", 0.12)])
def test_past_the_cylinder_with_interaction_as_samples_of_the_limit(
    model: str, apart: float
) -> None:
    """L1 of the density on bins of 0.5: cells of 0.1 smear a box of 0.6 by that part of its mass."""
    flow = past_cylinder()
    start = {"x": [-1.5, -0.9], "y": [-0.3, 0.3]}
    own = scene(2.0, 0.1, start=start, particles={"number": 900})
    found = ec.simulate(own, model, flow=flow).density(8)[-1]
    exact = ec.simulate(own, "mckean_vlasov", flow=flow).density(8)[-1]
    assert np.abs(found - exact).sum() * 0.5**2 < apart


def by_resolution(model: str, scheme: Any, cells: tuple[float, ...], bins: int) -> list[Floats]:
    """The density past the cylinder on common bins, without interaction, of each resolution."""
    parts: dict[str, Any] = {
        "start": {"x": [-1.6, -0.8], "y": [-0.4, 0.4]}, "interaction": None,
        "flow": {"drag": 20.0, "angular_drag": 20.0}, "times": [1.0], "numerics": {"angle_cells": 4},
    }  # fmt: skip
    flow = past_cylinder()
    return [
        ec.simulate(scene(2.0, cell, **parts), model, scheme, flow=flow).density(bins)[-1]
        for cell in cells
    ]


@pytest.mark.heavy
def test_the_mono_kinetic_density_converges_to_the_limit() -> None:
    """Against samples that never touch the cylinder: L1 on bins of 0.2 falls with order 1 or better."""
    flow = past_cylinder()
    bare = FlowField(flow.arrays, flow.origin, None)
    own = scene(
        2.0, 0.1, start={"x": [-1.6, -0.8], "y": [-0.4, 0.4]}, interaction=None, times=[1.0],
        flow={"drag": 20.0, "angular_drag": 20.0}, particles={"number": 4000},
    )  # fmt: skip
    exact = ec.simulate(own, "mckean_vlasov", flow=bare, realisations=64).density(20)[-1]
    found = by_resolution("q_mono_kinetic", "accurate", (0.1, 0.05, 0.025), 20)
    errors = np.array([np.abs(one - exact).sum() * 0.2**2 for one in found])
    orders = np.log2(errors[:-1] / errors[1:])
    print("L1", errors, "orders", orders)
    assert (orders > 0.75).all()
    assert orders[-1] > 0.95


@pytest.mark.heavy
@pytest.mark.parametrize("scheme", ["accurate", "paper"])
def test_the_maxwellian_density_converges(scheme: str) -> None:
    """No samples have its closure: towards its own next resolution L1 falls with the scheme's order.

    First order for the stairs, half an order for FORCE at steps of its CFL number.
    """
    found = by_resolution("q_maxwellian", scheme, (0.2, 0.1, 0.05, 0.025), 20)
    apart = np.array([np.abs(a - b).sum() * 0.2**2 for a, b in pairwise(found)])
    orders = np.log2(apart[:-1] / apart[1:])
    print("L1", apart, "orders", orders)
    assert (orders > (0.75 if scheme == "accurate" else 0.4)).all()

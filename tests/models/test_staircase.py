"""Grids whose fluid is bounded by patches: even tracers, solids, mass, symmetry, inlets, all models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.geometry.fluid_cells import fluid_cells
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, scene_from_table
from ellipsoid_coupling.simulation import simulate
from tests.staircase_flows import box, couette_ring, past_cylinder

Floats = NDArray[np.float64]

REFLECT = {"kind": "reflect"}
ALL = [
    (model, scheme)
    for model in ("rho_mono_kinetic", "diffusive", "q_mono_kinetic", "q_maxwellian")
    for scheme in ("accurate", "paper")
]


def scene(half: tuple[float, float], cell: float, **parts: Any) -> Scene:
    """About 0, open sides, without interaction; parts replace sections, or add to them."""
    x, y = ([-one, one] for one in half)
    table: dict[str, Any] = {
        "name": "staircase", "times": [1.0], "domain": {"x": x, "y": y, "boundary": "open"},
        "particles": {"length": 0.1, "width": 0.05, "number": 100}, "start": {"x": x, "y": y},
        "flow": {"source": "openfoam", "field": "none", "drag": 2.0, "angular_drag": 1.0},
        "numerics": {"cell": cell, "angle_cells": 8},
    }  # fmt: skip
    for name, part in parts.items():
        table[name] = {**table.get(name, {}), **part} if isinstance(part, dict) else part
    return scene_from_table(table, "staircase")


def fluid_of(result: Result, flow: FlowField) -> NDArray[np.bool_]:
    x, y = result.coordinates["x"], result.coordinates["y"]
    return fluid_cells(flow.outline, x, y, float(x[1] - x[0])).inside


def last(result: Result) -> Floats:
    return np.asarray(result.cell_density()[-1])


def balance(result: Result) -> float:
    return float(result.attributes["mass_end"] + result.attributes["mass_left"] - 1.0)


@pytest.mark.parametrize(("model", "scheme"), ALL)
def test_density_in_solids_is_zero_and_mass_is_kept(model: str, scheme: Any) -> None:
    """In the ring, with inertia: to the bit in solids, to rounding in sum, and nowhere negative.

    The flow is the same turned by half a turn, and so is the density; both axes are summed in the same
    order then, and differ by rounding.
    """
    flow = couette_ring()
    start = {"x": [-0.95, 0.95], "y": [-0.6, 0.6]}
    result = simulate(scene((1.0, 1.0), 0.05, start=start), model, scheme, flow=flow)
    fluid, density = fluid_of(result, flow), last(result)
    assert not density[~fluid].any()
    assert result.variables["density"].min() == 0.0
    assert abs(balance(result)) < 1e-13
    assert abs(result.attributes["mass_left"]) < 1e-15
    even = 1.0 / (fluid.sum() * 0.05**2)
    assert np.ptp(density[fluid]) > 0.1 * even
    np.testing.assert_allclose(density, density[::-1, ::-1], atol=1e-11 * even)


@pytest.mark.parametrize(("model", "scheme"), ALL[:4])
@pytest.mark.parametrize("name", ["ring", "cylinder"])
def test_even_tracers_stay_even(name: str, model: str, scheme: Any) -> None:
    """Drag 1e6 on stairs: to rounding where all faces' velocities are the fluid's.

    FORCE mixes the last cell with its ghost, which has the mean velocity of the cell, not of the face: 1 %
    at sides that the fluid leaves through.
    """
    ring = name == "ring"
    flow, half, cell = (couette_ring(), 1.0, 0.05) if ring else (past_cylinder(), 2.0, 0.1)
    made = scene((half, half), cell, flow={"drag": 1e6}, particles={"width": 0.1})
    x = np.arange(-half + cell / 2, half, cell)
    even = 1.0 / (fluid_cells(flow.outline, x, x, cell).inside.sum() * cell**2)
    if not ring:
        inlet = {"far": {"kind": "inlet", "density": even}}
        made = scene(
            (half, half), cell, flow={"drag": 1e6}, particles={"width": 0.1}, boundaries=inlet
        )
    result = simulate(made, model, scheme, flow=flow)
    fluid = fluid_of(result, flow)
    exact = ring or scheme == "accurate"
    np.testing.assert_allclose(last(result)[fluid], even, rtol=1e-12 if exact else 1e-2)
    assert abs(balance(result)) < 1e-13


def channel(plate: bool = False) -> FlowField:
    """Plug flow u = (1, 0) in [-1, 1] x [-0.5, 0.5]; a thin plate across all of it at x = 0.3."""
    x, y = np.linspace(-1.0, 1.0, 9), np.linspace(-0.5, 0.5, 5)
    psi = np.broadcast_to(y[:, None], (5, 9)).copy()
    corners = box(1.0, 0.5)
    parts = [
        (name, kind, corners[[k, (k + 1) % 4]], False)
        for k, (name, kind) in enumerate(
            (("low", "wall"), ("outlet", "patch"), ("high", "wall"), ("inlet", "patch"))
        )
    ]
    if plate:
        there = np.array([[0.3, -0.5], [0.3, 0.5]])
        parts += [("west", "wall", there, False), ("east", "wall", there[::-1], False)]
    return FlowField.from_stream_function(psi, x, y, "plug flow", outline=polygon_outline(parts))


INLET = {"inlet": {"kind": "inlet", "density": 3.0, "angle": 0.5}}


@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_mono_kinetic"])
def test_what_comes_in_is_what_the_fluid_carries(model: str) -> None:
    """Density u_n height t at the inlet's angle, moving with the fluid from its birth: at rest nothing.

    While the first cell fills, its flux sees a jump: a small part of a cell's mass is off (2e-4 of all).
    """
    flow, out = channel(), {"x": [0.9, 1.0], "y": [-0.5, 0.5]}
    made = scene((1.0, 0.5), 0.05, start=out, boundaries=INLET, flow={"drag": 1e6})
    result = simulate(made, model, flow=flow)
    left = dict(part.rsplit(" ", 1) for part in result.attributes["mass_left_by_patch"].split(", "))
    assert set(left) == {"outlet", "inlet"}
    assert float(left["inlet"]) == pytest.approx(-3.0, rel=2e-3)
    # What started in the last tenth has left; the front is at x = 0.
    assert float(left["outlet"]) == pytest.approx(1.0, rel=1e-6)
    assert abs(balance(result)) < 1e-13
    density, x = last(result), result.coordinates["x"]
    np.testing.assert_allclose(density[:, x < -0.4], 3.0, rtol=1e-3)
    assert density[:, x > 0.4].max() < 1e-3
    if model == "rho_mono_kinetic":
        angle = result.variables["mean_angle"][-1][:, x < -0.2]
        np.testing.assert_allclose(angle, 0.5, rtol=1e-9)
    else:
        # 0.5 lies between the cells centred on 0 and pi/4; nothing turns in plug flow.
        held = result.variables["density"][-1][:, 5, 0] * 2.0 * np.pi / 8
        part = 0.5 / (np.pi / 4)
        expected = 3.0 * np.array([1 - part, part, *[0.0] * 6])
        np.testing.assert_allclose(held, expected, rtol=1e-3, atol=1e-12)


def test_nothing_passes_a_thin_plate() -> None:
    """Plug flow against a plate: all that started before it is still there, to the bit of rounding."""
    flow, before = channel(plate=True), {"x": [-0.2, 0.2], "y": [-0.3, 0.3]}
    made = scene((1.0, 0.5), 0.05, start=before, flow={"drag": 20.0})
    result = simulate(made, "rho_mono_kinetic", flow=flow)
    density, x = last(result), result.coordinates["x"]
    assert not density[:, x > 0.3].any()
    # Piled up at the plate.
    assert density[:, x < 0.3].sum() * 0.05**2 == pytest.approx(1.0, rel=1e-12)
    assert density[:, (x > 0.2) & (x < 0.3)].sum() > 0.9 * density.sum()


def test_a_straight_box_is_that_of_the_domains_sides() -> None:
    """Patches on the sides against sides of the same kinds: the same lines, and no fluid to follow.

    Walls all round; to 1e-11 without drag, where both are the plain ballistic flight.
    """
    x, y = np.linspace(-1.0, 1.0, 9), np.linspace(-0.5, 0.5, 5)
    outline = polygon_outline([("wall", "wall", box(1.0, 0.5), True)])
    flow, bare = (
        FlowField.from_stream_function(np.zeros((5, 9)), x, y, "at rest", outline=around)
        for around in (outline, None)
    )
    start = {"x": [-0.6, 0.4], "y": [-0.2, 0.3]}
    parts = {
        "start": start,
        "flow": {"drag": 0.0},
        "gravity": {"x": 1.5, "y": -1.0},
    }
    sides = dict.fromkeys(("left", "right", "bottom", "top"), REFLECT)
    there, here = (
        simulate(scene((1.0, 0.5), 0.05, boundaries=kinds, **parts), "rho_mono_kinetic", flow=field)
        for kinds, field in (({"wall": REFLECT}, flow), (sides, bare))
    )
    # Some of it has come back from two walls.
    assert min(last(here)[0].max(), last(here)[:, -1].max()) > 0.1
    np.testing.assert_allclose(last(there), last(here), atol=1e-11)
    assert there.attributes["steps"] == here.attributes["steps"]


def test_a_start_in_solids_is_cut_and_one_in_a_solid_alone_refused() -> None:
    flow = past_cylinder()
    cut = scene((2.0, 2.0), 0.1, start={"x": [-1.0, 1.0], "y": [-0.2, 0.2]}, times=[1e-3])
    result = simulate(cut, "rho_mono_kinetic", flow=flow)
    assert result.attributes["mass_start"] == pytest.approx(1.0, rel=1e-14)
    assert not last(result)[~fluid_of(result, flow)].any()
    within = scene((2.0, 2.0), 0.1, start={"x": [-0.2, 0.2], "y": [-0.1, 0.1]})
    with pytest.raises(
        InputError, match=r"key start: expected a start in the fluid.*\(-0\.15, -0\.05\)"
    ):
        simulate(within, "rho_mono_kinetic", flow=flow)


def test_a_domain_without_fluid_and_an_inlet_without_a_flow_are_refused() -> None:
    made = scene((0.2, 0.2), 0.1, boundaries={"cylinder": REFLECT})
    with pytest.raises(InputError, match="cells in the fluid of the domain"):
        simulate(made, "rho_mono_kinetic", flow=past_cylinder())
    left = scene((0.2, 0.2), 0.1, boundaries={"left": {"kind": "inlet", "density": 1.0}}, flow=None)
    with pytest.raises(InputError, match="a fluid that carries particles in"):
        simulate(left, "rho_mono_kinetic")


@pytest.mark.parametrize(
    ("model", "kinds"), [("rho_mono_kinetic", INLET), ("q_maxwellian", {"low": REFLECT})]
)
def test_a_run_that_goes_on_from_its_state_has_the_same_bits(
    model: str, kinds: dict[str, Any]
) -> None:
    from ellipsoid_coupling.models import Setup, build_model, model_terms

    made = scene((1.0, 0.5), 0.1, boundaries=kinds, start={"x": [-0.5, 0.5], "y": [-0.5, 0.5]})
    setup = Setup(made, model_terms(made, model), "accurate", channel(), 0, 1)
    straight, cut = build_model(model, setup), build_model(model, setup)
    while straight.time < 0.5:
        straight.advance(0.5)
    cut.advance(0.5)
    kept = {name: np.array(array) for name, array in cut.state().items()}
    again = build_model(model, setup)
    again.restore(kept)
    while again.time < 0.5:
        again.advance(0.5)
    assert again.snapshot()["density"].tobytes() == straight.snapshot()["density"].tobytes()
    assert again.counts()["mass_left_by_patch"] == straight.counts()["mass_left_by_patch"]


@pytest.mark.heavy
def test_the_density_past_a_cylinder_converges_to_that_of_the_limit() -> None:
    """Against samples of the limit that never touch the cylinder: L1 on common bins falls with order 1."""
    flow = past_cylinder()
    bare = FlowField(flow.arrays, flow.origin, None)
    parts: dict[str, Any] = {
        "start": {"x": [-1.6, -0.8], "y": [-0.4, 0.4]}, "flow": {"drag": 20.0}, "times": [1.0, 2.0],
        "particles": {"width": 0.1, "number": 4000},
    }  # fmt: skip
    exact = simulate(
        scene((2.0, 2.0), 0.1, **parts), "mckean_vlasov", flow=bare, realisations=64
    ).density(20)
    errors = []
    for cell in (0.05, 0.025, 0.0125):
        result = simulate(scene((2.0, 2.0), cell, **parts), "rho_mono_kinetic", flow=flow)
        errors.append(np.abs(result.density(20) - exact).sum(axis=(1, 2)) * 0.2**2)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 0.75).all()
    assert (orders[-1] > 0.95).all()
    assert (errors[-1] < [0.03, 0.13]).all()


@pytest.mark.heavy
@pytest.mark.parametrize("drag", [1.0, 5.0])
def test_with_inertia_lines_and_a_rectangle_agree_to_second_order(drag: float) -> None:
    """An eddy in a box whose walls are patches: what follows the fluid there differs by O(dt^2, h^2)."""
    nodes = np.linspace(-1.0, 1.0, 41)
    bump = np.cos(0.5 * np.pi * nodes)
    outline = polygon_outline([("wall", "wall", box(1.0, 1.0), True)])
    psi = 0.5 * bump[:, None] * bump
    flow = FlowField.from_stream_function(psi, nodes, nodes, "eddy", outline=outline)
    bare = FlowField(flow.arrays, flow.origin, None)
    parts: dict[str, Any] = {
        "start": {"x": [-0.5, 0.5], "y": [-0.3, 0.3]}, "flow": {"drag": drag},
        "particles": {"width": 0.1}, "domain": {"boundary": "reflecting"},
    }  # fmt: skip
    apart = []
    for cell in (0.05, 0.025, 0.0125):
        there = scene((1.0, 1.0), cell, boundaries={"wall": REFLECT}, **parts)
        lines = simulate(there, "rho_mono_kinetic", flow=flow).density(20)[-1]
        plain = simulate(scene((1.0, 1.0), cell, **parts), "rho_mono_kinetic", flow=bare)
        apart.append(np.abs(lines - plain.density(20)[-1]).sum() * 0.1**2)
    orders = np.log2(np.array(apart[:-1]) / apart[1:])
    assert orders[0] > 1.2
    assert orders[1] > 1.6
    assert apart[-1] < 3e-3

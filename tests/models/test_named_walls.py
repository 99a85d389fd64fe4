"""[walls] that name patches, in whole runs: particles and grids that interact past a cylinder."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.geometry.fluid_cells import fluid_cells
from ellipsoid_coupling.interaction.curved_walls import CurvedWalls
from ellipsoid_coupling.interaction.wall_lines import ghosts_along
from ellipsoid_coupling.interaction.walls import Walls
from ellipsoid_coupling.physics.potential import pair_potential, potential_shape
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, scene_from_table
from tests.staircase_flows import RADIUS, box, circle, past_cylinder

Floats = NDArray[np.float64]

WALL = {"cylinder": {"kind": "reflect"}}
# Each model and each scheme once, which compiles faster than the other way round.
CROSSED = pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "paper"), ("mckean_vlasov", "accurate")]
)
GRIDS = [
    ("rho_mono_kinetic", "accurate"),
    ("q_mono_kinetic", "paper"),
    ("q_maxwellian", "accurate"),
    ("q_maxwellian", "paper"),
]


def scene(**parts: Any) -> Scene:
    """About a cylinder of radius 1/2, open sides; parts replace sections, or add to them."""
    table: dict[str, Any] = {
        "name": "named walls", "times": [0.6],
        "domain": {"x": [-2.0, 2.0], "y": [-2.0, 2.0], "boundary": "open"},
        "particles": {"length": 0.2, "width": 0.1, "inertia": 0.01, "number": 40},
        "start": {"x": [-1.2, -0.6], "y": [-0.4, 0.4]}, "boundaries": WALL,
        "flow": {"source": "openfoam", "field": "none", "drag": 5.0, "angular_drag": 5.0},
        "interaction": {"strength": 0.2}, "walls": {"sides": ["cylinder"], "strength_factor": 40.0},
        "numerics": {"cell": 0.1, "angle_cells": 8, "harmonics_tolerance": 1e-3},
    }  # fmt: skip
    for name, part in parts.items():
        table[name] = {**table.get(name, {}), **part} if isinstance(part, dict) else part
    return scene_from_table(
        {name: part for name, part in table.items() if part is not None}, "named walls"
    )


def beside(result: Result, width: float = 0.15) -> float:
    """The mass of cells within `width` of the cylinder."""
    x, y = np.meshgrid(result.coordinates["x"], result.coordinates["y"])
    near = np.hypot(x, y) < RADIUS + width
    return float(result.cell_density()[-1][near].sum() * 0.1**2)


@pytest.mark.parametrize(("model", "scheme"), GRIDS)
def test_a_symmetric_flow_gives_a_symmetric_density_that_walls_keep_off(
    model: str, scheme: Any
) -> None:
    """In solids 0 to the bit, mass to rounding; y and -y are summed in another order, so 1e-7."""
    flow = past_cylinder()
    result = ec.simulate(scene(), model, scheme, flow=flow)
    density, x = result.cell_density()[-1], result.coordinates["x"]
    fluid = fluid_cells(flow.outline, x, x, 0.1).inside
    assert not density[~fluid].any()
    assert result.variables["density"].min() >= 0.0
    masses = result.attributes
    assert abs(masses["mass_end"] + masses["mass_left"] - 1.0) < 1e-13
    np.testing.assert_allclose(density, density[::-1], atol=1e-7 * density.max())
    without = ec.simulate(scene(walls=None), model, scheme, flow=flow)
    assert beside(result) < 0.97 * beside(without)


def still() -> FlowField:
    """A fluid at rest around the cylinder."""
    flow = past_cylinder(points=360)
    arrays = flow.arrays._replace(coefficients=np.zeros_like(flow.arrays.coefficients))
    return FlowField(arrays, "at rest", flow.outline)


@CROSSED
def test_a_particle_is_pushed_along_the_normal(model: str, scheme: Any) -> None:
    """Where ghosts stand alike to both sides: off by the angle of an edge, a degree, at most.

    Its axis lies across the normal, so that nothing turns it; alone, so that nothing else acts.
    """
    ghosts = ghosts_along(polygon_outline([("c", "wall", circle(RADIUS, 360, -1), True)]).ends, 0.2)
    turn = np.arctan2(ghosts.y[3], ghosts.x[3]) + np.array([0.0, 0.5]) * 2.0 * np.pi / ghosts.x.size
    for angle in turn:
        normal = np.array([np.cos(angle), np.sin(angle)])
        own = scene(
            times=[0.02], particles={"number": 1}, flow={"angular_drag": 0.0},
            start={"x": [-2.0, 2.0], "y": [-2.0, 2.0], "points": [[*(0.55 * normal), angle + 0.5 * np.pi]]},
        )  # fmt: skip
        values = ec.simulate(own, model, scheme, flow=still()).variables
        velocity = np.array([values[name][-1].item() for name in ("velocity_x", "velocity_y")])
        pushed = float(velocity @ normal)
        assert pushed > 0.01
        assert np.hypot(*(velocity - pushed * normal)) < np.radians(1.0) * pushed


@CROSSED
def test_particles_stay_further_off_than_without(model: str, scheme: Any) -> None:
    """In the mean of all that pass, and none gets into the solid.

    Without: with walls a billionth as strong, for which the same kernels do.
    """
    gaps = []
    for strength in (40.0, 1e-9):
        own = scene(
            walls={"strength_factor": strength}, particles={"number": 60, "realisations": 4}
        )
        values = ec.simulate(own, model, scheme, flow=past_cylinder()).variables
        inside = values["fate"][-1] == 0
        gaps.append(np.hypot(values["x"][-1], values["y"][-1])[inside] - RADIUS)
    assert min(gap.min() for gap in gaps) > -1e-4
    assert gaps[0].min() > gaps[1].min()
    assert np.sort(gaps[0])[:20].mean() > np.sort(gaps[1])[:20].mean()


@pytest.mark.parametrize("h", [0.05, 0.025])
def test_a_long_straight_patch_pushes_as_an_endless_wall_does(h: float) -> None:
    """A wall turned by 30 degrees against sums over fine ghosts along it, as deep as the ghost cells stand.

    The table is linear between its rows, h apart: of second order in h, and the error is below 6 % and
    1.6 % of the largest force, 19 % and 5 % of the largest torque, where these are flat at reach.
    """
    shape, turn = potential_shape(0.2, 0.1), np.radians(30.0)
    walls = Walls(((-1.0, 1.0), (-1.0, 1.0)), ("left",), 0.2, shape, 0.7, 100)
    centres = np.arange(-0.5 + h / 2, 0.5, h)
    along = np.array([np.cos(turn), np.sin(turn)])
    edge = np.array([[-3.0 * along, 3.0 * along]])
    x, y = np.meshgrid(centres, centres)
    distance = y * along[0] - x * along[1]
    entries = walls.table(h).entries
    curved = CurvedWalls(edge, entries, (centres, centres), distance > 0.0, h)
    theta = 0.4
    force_x, force_y, torque = (part[0] for part in curved.on_angles(np.array([theta]), x.shape))
    fine, normal = h / 8.0, np.array([-along[1], along[0]])
    s = np.arange(-1.2 * shape.reach, 1.2 * shape.reach, fine)
    depth = (np.arange(walls.depth(h)) + 0.5) * h
    scale = 10.0 * 0.7 * walls.density(h) * fine * h
    felt = np.argwhere((distance > 0.0) & (distance < shape.reach))
    ghost, own = (np.cos(2.0 * turn), np.sin(2.0 * turn)), (np.cos(2 * theta), np.sin(2 * theta))
    largest = np.array([np.hypot(force_x, force_y).max()] * 2 + [np.abs(torque).max()])
    for j, i in felt[:: max(1, len(felt) // 30)]:
        across = distance[j, i] + depth
        to = s[:, None, None] * along - across[:, None] * normal
        slopes = [
            plain(pair_potential)(float(dx), float(dy), *own, *ghost, shape)[1:]
            for dx, dy in to.reshape(-1, 2)
            if np.hypot(dx, dy) < shape.reach
        ]
        exact = -scale * np.sum(slopes, axis=0)
        found = np.array([force_x[j, i], force_y[j, i], torque[j, i]])
        allowed = np.array([1.0, 1.0, 3.0]) * (h / 0.2) ** 2
        assert (np.abs(found - exact) < allowed * largest).all()


def test_walls_that_are_none_are_refused() -> None:
    """A name that is neither a side nor a patch, and a patch that does not reflect."""
    for names, message in ((["nobody"], "nobody"), (["far"], "far")):
        with pytest.raises(InputError, match=message):
            ec.simulate(
                scene(walls={"sides": names}, boundaries=WALL | {"far": {"kind": "remove"}}),
                "rho_mono_kinetic",
                flow=past_cylinder(),
            )


def test_a_side_that_is_named_alone_leaves_the_patches_without_ghosts() -> None:
    """Grids as particles: the push is at the bottom, and none at the cylinder."""
    from ellipsoid_coupling.models import Setup, build_model, model_terms

    sides = {"bottom": {"kind": "reflect"}}
    for names, at_cylinder, at_bottom in ((["bottom"], False, True), (["cylinder"], True, False)):
        own = scene(
            walls={"sides": names}, boundaries=WALL | sides, flow={"drag": 1.0},
            domain={"x": [-1.0, 1.0], "y": [-1.0, 1.0]}, start={"x": [-0.9, -0.7], "y": [-0.2, 0.2]},
        )  # fmt: skip
        corners = box(1.0, 1.0)
        outline = polygon_outline(
            [("far", "patch", corners[[1, 2, 3, 0]], False),
             ("cylinder", "wall", circle(RADIUS, 360, -1), True)]
        )  # fmt: skip
        flow = FlowField(still().arrays, "at rest", outline)
        setup = Setup(own, model_terms(own, "q_mono_kinetic"), "accurate", flow, 0, 1)
        model: Any = build_model("q_mono_kinetic", setup)
        push = np.hypot(*model.cells.find_forces.walls[:2])[0]
        x, y = np.meshgrid(model.grid.plane.x, model.grid.plane.y)
        assert bool(push[np.hypot(x, y) < 0.6].any()) == at_cylinder
        assert bool(push[y < -0.9].any()) == at_bottom

"""Flows that do not fit a scene are refused, with the place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import Setup, build_model
from ellipsoid_coupling.models.flow_fit import can_be_left, require_fitting
from ellipsoid_coupling.scenes import Scene, terms_of
from tests.known_flows import channel

PARTICLES = ("microscopic", "mckean_vlasov")


def scene(boundary: str = "open", **changes: Any) -> Scene:
    settings = {
        "domain.x": [0.0, 4.0], "domain.y": [0.0, 1.0], "domain.boundary": boundary,
        "start.x": [0.1, 0.4], "start.y": [0.3, 0.7], "particles.number": 16,
        "particles.realisations": 1, "times": [0.1], "numerics.cell": 0.125,
    }  # fmt: skip
    return ec.load_scene("cavity_free", settings | changes)


def closed() -> FlowField:
    """A roll in [0, 4] x [0, 1]: no fluid crosses its sides."""
    x, y = np.linspace(0.0, 4.0, 33), np.linspace(0.0, 1.0, 17)
    psi = np.outer(np.sin(np.pi * y), np.sin(0.25 * np.pi * x))
    return FlowField.from_stream_function(psi, x, y, "a roll")


def test_a_model_has_a_flow_if_its_scene_has_one() -> None:
    """Without it there would be drag, and no fluid; with one too many, its name and nothing else."""
    own = scene()
    with pytest.raises(InputError, match=r"expected a flow for its \[flow\] section, found none"):
        build_model("microscopic", Setup(own, terms_of(own), "accurate", None, 0, 1))
    dry = scene(flow=None)
    with pytest.raises(InputError, match="expected no flow, found a channel"):
        build_model("microscopic", Setup(dry, terms_of(dry), "accurate", channel(), 0, 1))


def test_reflecting_sides_are_walls_of_the_flow() -> None:
    require_fitting(scene("reflecting"), closed())
    require_fitting(scene("open"), channel())


@pytest.mark.parametrize(
    ("changes", "flow", "told"),
    [
        (
            {},
            channel(),
            r"none on the left: fluid crosses that side of its mesh with 1 on the mean",
        ),
        (
            {"domain.x": [0.0, 3.0]},
            closed(),
            r"none on the right: the domain's side lies at x = 3,",
        ),
        (
            {"domain.y": [-0.5, 1.0]},
            closed(),
            r"on the bottom: the domain's side lies at y = -0.5,",
        ),
        ({"interaction.strength": 1.0, "walls.sides": ["bottom", "top"]}, channel(), "on the left"),
    ],
    ids=["outlet", "narrower", "wider", "walls"],
)
def test_reflecting_sides_that_are_no_walls_are_refused(
    changes: dict[str, Any], flow: FlowField, told: str
) -> None:
    """With the flow's rectangle; whatever the model."""
    with pytest.raises(InputError, match=told) as refused:
        require_fitting(scene("reflecting", **changes), flow)
    assert "[0, 4] x [0, 1]" in str(refused.value)


def test_only_flows_that_can_be_left_are_watched(rotation_flow: FlowField) -> None:
    """A formula holds everywhere; walls keep all inside, unless there is a solid among them."""
    assert not can_be_left(scene("open"), rotation_flow)
    assert not can_be_left(scene("open"), None)
    assert can_be_left(scene("open"), channel())
    assert not can_be_left(scene("reflecting"), closed())
    assert can_be_left(scene("reflecting"), channel(solid=(1.0, 1.5)))
    wide = scene("reflecting", **{"domain.x": [-1.0, 4.0]})
    assert can_be_left(wide, closed())


SOLID = channel(solid=(1.0, 1.5))
STARTS = [
    ({"start.x": [0.5, 1.25]}, SOLID, r"in a solid or beyond the mesh, the first at \(1\."),
    ({"domain.x": [-1.0, 4.0], "start.x": [-0.5, -0.25]}, channel(), r"16 of 16 in a solid"),
    (
        {"particles.number": 3, "start.points": [[0.5, 0.5], [1.2, 0.6], [0.5, 0.4]]},
        SOLID,
        r"1 of 3 in a solid or beyond the mesh, the first at \(1\.2, 0\.6\)",
    ),
]


@pytest.mark.parametrize("model", PARTICLES)
@pytest.mark.parametrize(("changes", "flow", "told"), STARTS, ids=["solid", "beyond", "points"])
def test_a_start_outside_the_fluid_is_refused_with_the_place(
    changes: dict[str, Any], flow: FlowField, told: str, model: str
) -> None:
    changes = {"start.y": [0.3, 0.7]} | changes
    if "start.points" in changes:
        changes |= {"start.x": [0.0, 2.0], "start.y": [0.0, 1.0]}
    with pytest.raises(InputError, match=told):
        ec.simulate(scene(**changes), model, flow=flow)

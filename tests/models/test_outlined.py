"""Particles in a fluid that patches bound: bounces, fates and counts, against boxes and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from tests.outlined_flows import (
    PLATE,
    SQUARE,
    channel_outline,
    circle,
    corners,
    past_a_cylinder,
    plug_flow,
    roll,
    solid,
)

DRAG = 10.0
BOTH = pytest.mark.parametrize("scheme", ["paper", "accurate"])
EACH = pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])
PAIRED = pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "accurate"), ("mckean_vlasov", "paper")]
)
MOVES = ("x", "y", "angle", "velocity_x", "velocity_y", "angular_velocity")


def scene(**changes: Any) -> Scene:
    settings = {
        "domain.x": [0.0, 4.0], "domain.y": [0.0, 1.0], "domain.boundary": "open",
        "start.x": [0.2, 0.8], "start.y": [0.05, 0.95], "particles.number": 100,
        "particles.length": 0.05, "particles.width": 0.025, "particles.inertia": 0.001,
        "particles.realisations": 2, "times": [0.5, 2.0], "numerics.cell": 0.125,
        "flow.drag": DRAG, "flow.angular_drag": DRAG, "numerics.time_step": 0.01,
    }  # fmt: skip
    if "start.points" in changes:
        settings |= {"start.x": settings["domain.x"], "start.y": settings["domain.y"]}
    return ec.load_scene("cavity_free", settings | changes)


def apart(one: Result, other: Result, names: tuple[str, ...] = MOVES) -> float:
    return max(float(np.abs(one.variables[n] - other.variables[n]).max()) for n in names)


@pytest.mark.parametrize(
    ("model", "scheme", "noise"),
    [
        ("microscopic", "paper", 0.0),
        ("microscopic", "accurate", 0.0),
        ("mckean_vlasov", "accurate", 1.0),
    ],
)
def test_straight_walls_as_an_outline_are_the_box(model: str, scheme: Any, noise: float) -> None:
    """To rounding, which bounces and the flow stretch: some hundred steps of 1e-15 each, 100 times.

    The outline lies within a domain whose sides are open: particles have fates, as in the tests below.
    """
    given: dict[str, Any] = {
        "domain.boundary": "reflecting", "start.x": [0.05, 3.95], "flow.drag": 1.0,
        "flow.angular_drag": 1.0, "numerics.tolerance": 1e-3, "numerics.time_step": 0.02,
        "times": [0.5, 1.5],
    }  # fmt: skip
    if noise:
        given |= {"noise.noise": noise, "noise.angular_noise": 0.3}
    boxed = ec.simulate(scene(**given), model, scheme, flow=roll(None))
    outline = polygon_outline([("walls", "wall", corners((0.0, 4.0), (0.0, 1.0)), True)])
    given |= {"domain.boundary": "open", "domain.x": [-0.25, 4.25], "domain.y": [-0.25, 1.25]}
    named = scene(**given, **{"boundaries.walls.kind": "reflect"})
    lined = ec.simulate(named, model, scheme, flow=roll(outline))
    assert lined.attributes["steps"] == boxed.attributes["steps"]
    assert apart(boxed, lined) < 1e-11
    assert np.abs(boxed.variables["velocity_y"]).max() > 0.1
    assert lined.attributes["mass_left"] == 0.0
    assert (lined.variables["fate"] == 0).all()


def test_straight_walls_as_an_outline_have_the_box_s_ghosts() -> None:
    """With interaction and ghosts, in steps of one length: to rounding."""
    given: dict[str, Any] = {
        "domain.boundary": "reflecting", "interaction.strength": 0.01, "times": [0.3],
        "walls.strength_factor": 10.0, "particles.length": 0.1, "particles.number": 60,
    }  # fmt: skip
    boxed = ec.simulate(scene(**given), "microscopic", "paper", flow=roll(None))
    outline = polygon_outline([("walls", "wall", corners((0.0, 4.0), (0.0, 1.0)), True)])
    named = scene(**given, **{"boundaries.walls.kind": "reflect"})
    lined = ec.simulate(named, "microscopic", "paper", flow=roll(outline))
    assert apart(boxed, lined) < 1e-11
    assert "fate" not in lined.variables
    given["walls.strength_factor"] = 1e-9
    without = ec.simulate(scene(**given), "microscopic", "paper", flow=roll(None))
    assert apart(boxed, without) > 1e-4


def turned_flow(angle: float) -> FlowField:
    """A linear shear flow in a box that is turned about the origin, each by an angle."""
    x = np.linspace(-2.0, 2.0, 33)
    across, along = np.meshgrid(x, x)
    cosine, sine = np.cos(angle), np.sin(angle)
    own_x, own_y = cosine * across + sine * along, cosine * along - sine * across
    # u = (own_y, -own_x / 2) in the box's own frame: a quadratic, which a spline holds to rounding.
    psi = 0.5 * own_y**2 + 0.25 * own_x**2
    points = corners((-1.0, 1.0), (-0.6, 0.6)) @ np.array([[cosine, sine], [-sine, cosine]])
    outline = polygon_outline([("walls", "wall", points, True)])
    return FlowField.from_stream_function(psi, x, x, "a turned box", outline=outline)


@BOTH
def test_a_turned_box_turns_everything(scheme: Any) -> None:
    """By 30 degrees, against the straight one turned: to 1e-12 of the size after some ten bounces.

    Steps are the save times' of both: their errors are measured along x and y, and would differ.
    """
    found = []
    for angle in (0.0, np.pi / 6.0):
        cosine, sine = np.cos(angle), np.sin(angle)
        own = np.random.default_rng(3).uniform((-0.9, -0.5), (0.9, 0.5), (60, 2))
        points = own @ np.array([[cosine, sine], [-sine, cosine]])
        given: dict[str, Any] = {
            "domain.x": [-2.0, 2.0], "domain.y": [-2.0, 2.0], "particles.number": 60,
            "particles.realisations": 1, "start.x": [-2.0, 2.0], "start.y": [-2.0, 2.0],
            "start.points": points.tolist(), "particles.width": 0.05, "flow.drag": 1.0,
            "times": np.linspace(0.02, 3.0, 150).tolist(), "numerics.tolerance": 1.0,
        }  # fmt: skip
        result = ec.simulate(scene(**given), "microscopic", scheme, flow=turned_flow(angle))
        place = np.stack((result.variables["x"][-1, 0], result.variables["y"][-1, 0]), axis=-1)
        found.append(place @ np.array([[cosine, -sine], [sine, cosine]]))
        assert (result.variables["fate"] == 0).all()
    assert np.abs(found[1] - found[0]).max() < 1e-12


@EACH
@BOTH
def test_who_reaches_an_outlet_is_counted_there(model: str, scheme: Any) -> None:
    """Plug flow: x = x0 + t - (1 - exp(-gamma t))/gamma. Fates, masses and the place to rounding.

    The time of the end to the order of the scheme: Euler's lag behind the closed form is half a step of
    0.01 in place, and as much again at the start.
    """
    times = [0.5, 3.4, 6.0]
    result = ec.simulate(
        scene(times=times, **{"numerics.tolerance": 1e-6, "boundaries.outlet.kind": "remove"}),
        model, scheme, flow=plug_flow(channel_outline()),
    )  # fmt: skip
    x, fate = result.variables["x"], result.variables["fate"]
    travelled = times[1] - (1.0 - np.exp(-DRAG * times[1])) / DRAG
    start = x[0] - (times[0] - (1.0 - np.exp(-DRAG * times[0])) / DRAG)
    clear = np.abs(start + travelled - 4.0) > 0.011
    assert np.array_equal((fate[1] == 2)[clear], (start + travelled > 4.0)[clear])
    assert 0.0 < (fate[1] == 2).mean() < 1.0
    assert np.all(fate[2] == 2)
    assert np.abs(x[2] - 4.0).max() < 1e-12
    number = x[0].size
    assert result.attributes["fates"] == f"outlet {number}, inlet 0, inside 0"
    assert result.attributes["mass_left"] == 1.0
    assert result.attributes["mass_left_by_patch"] == "outlet 1, inlet 0"
    for name in ("velocity_x", "velocity_y", "angular_velocity"):
        assert np.all(result.variables[name][fate != 0] == 0.0)
    ended = result.variables["end_time"]
    assert np.array_equal(np.isnan(ended), fate == 0)
    # Once told, it stays; and it is the time at which the way of the closed form is long enough.
    assert np.array_equal(ended[2][fate[1] == 2], ended[1][fate[1] == 2])
    way = ended[2] - (1.0 - np.exp(-DRAG * ended[2])) / DRAG
    within = {"accurate": 1e-4, "paper": 0.011}[scheme]
    assert np.abs(start + way - 4.0).max() < within
    # Streamlines are straight: each leaves where it started, to rounding.
    assert np.abs(result.variables["y"][2] - result.variables["y"][0]).max() < 1e-12


SOLIDS = {
    "square": solid(SQUARE),
    "plate": solid(PLATE),
    "circle": solid(circle(0.2, 60, (1.1, 0.5))[::-1]),
}


def in_solid(name: str, x: Any, y: Any) -> int:
    """How many places are in the solid; for the plate those in its wake that came straight through it."""
    if name == "square":
        return int(((x > 1.0) & (x < 1.2) & (y > 0.4) & (y < 0.6)).sum())
    if name == "circle":
        inner = 0.2 * np.cos(np.pi / 60)
        return int((np.hypot(x - 1.1, y - 0.5) < inner * (1.0 - 1e-9)).sum())
    return int(((x > 1.0) & (np.abs(y - 0.5) < 0.2)).sum())


@BOTH
@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("step", [0.003, 0.3])
def test_nothing_gets_into_a_solid(scheme: Any, name: str, step: float) -> None:
    """10^4 particles, which a fluid that goes through it presses against it; steps that jump it."""
    own = scene(
        times=[0.4, 0.9, 2.5],
        **{
            "numerics.time_step": step,
            "numerics.tolerance": step,
            "flow.drag": 3.0,
            "flow.angular_drag": 3.0,
            "particles.number": 5000,
        },
    )
    result = ec.simulate(own, "microscopic", scheme, flow=plug_flow(channel_outline(SOLIDS[name])))
    x, y = result.variables["x"], result.variables["y"]
    assert in_solid(name, x, y) == 0
    # Only the circle lets those slide past that the fluid presses against it.
    held = np.abs(y[0] - 0.5) < 0.09
    assert held.any()
    assert np.all(x[-1][held] < 1.0 + 1e-12) or name == "circle"
    assert np.all((y >= 0.0) & (y <= 1.0) & (x <= 4.0))


def test_a_wall_that_holds_what_touches_it() -> None:
    """The square stands in the way of those that start before it; the others go on: exact counts."""
    own = scene(times=[0.4, 2.0], **{"boundaries.solid.kind": "stick"})
    result = ec.simulate(
        own, "microscopic", "paper", flow=plug_flow(channel_outline(SOLIDS["square"]))
    )
    y, fate = result.variables["y"], result.variables["fate"]
    before = (y[0] > 0.4) & (y[0] < 0.6)
    stuck = fate[-1] == 5
    assert np.array_equal(stuck, before)
    assert np.abs(result.variables["x"][-1][stuck] - 1.0).max() < 1e-12
    held = int(before.sum())
    assert result.attributes["fates"] == f"outlet 0, inlet 0, solid {held}, inside {200 - held}"
    assert result.attributes["fate_meanings"].endswith("5 stick@solid")


@PAIRED
def test_a_start_in_a_solid_is_refused_with_its_place(model: str, scheme: Any) -> None:
    """In a solid to the last digit of its outline, not of the mesh's cells."""
    flow = plug_flow(channel_outline(SOLIDS["circle"]))
    for x, fits in ((1.1 - 0.2 * np.cos(np.pi / 60) + 1e-6, False), (0.8999, True)):
        own = scene(
            times=[0.01],
            **{"start.points": [[x, 0.5001]], "particles.number": 1, "particles.realisations": 1},
        )
        if fits:
            ec.simulate(own, model, scheme, flow=flow)
        else:
            with pytest.raises(InputError, match=rf"key start.*in a solid.*\({x:.6g}, 0\.5001\)"):
                ec.simulate(own, model, scheme, flow=flow)


def test_heavy_particles_hit_a_cylinder_from_the_critical_inertia_on() -> None:
    """On the axis before a cylinder in potential flow nobody hits it below U/(gamma R) = 1/8.

    Near the wall, s before it, u = -2 s U/R: s'' + gamma s' + 2 gamma (U/R) s = 0 swings through 0 from
    gamma = 8 U/R on downwards. Below, s falls for ever: at t = 6 it is 1e-5, and the spline is off by 6e-7.
    """
    for inertia, hits in ((0.97 / 8.0, False), (1.1 / 8.0, True)):
        own = scene(
            times=[6.0],
            **{
                "domain.x": [-3.0, 1.0], "domain.y": [-1.5, 1.5], "particles.number": 3,
                "particles.realisations": 1, "particles.width": 0.05, "numerics.tolerance": 1e-7,
                "numerics.cell": 0.1, "flow.drag": 1.0 / inertia, "start.x": [-3.0, 1.0],
                "start.y": [-1.5, 1.5], "start.points": [[-2.99, 0.0], [-2.99, 1e-9], [-2.99, 0.9]],
                "boundaries.cylinder.kind": "stick",
            },
        )  # fmt: skip
        result = ec.simulate(own, "microscopic", "accurate", flow=past_a_cylinder())
        stuck = result.variables["fate"][-1, 0] == 5
        assert stuck.tolist() == [hits, hits, False]
        before = -1.0 - result.variables["x"][-1, 0, 0]
        assert 5e-6 < before < 2e-5 or hits


def test_tracers_pass_a_cylinder_at_the_distance_of_their_streamline() -> None:
    """The least distance, above it, is that of psi = y (1 - 1/r^2): to 1e-3 of the radius."""
    starts = [0.02, 0.1, 0.3, 0.6]
    own = scene(
        times=np.linspace(0.1, 8.0, 160).tolist(),
        **{
            "domain.x": [-3.0, 1.0], "domain.y": [-1.5, 1.5], "start.x": [-3.0, 1.0],
            "start.y": [-1.5, 1.5], "start.points": [[-2.9, y] for y in starts],
            "particles.number": 4, "particles.realisations": 1, "particles.width": 0.05,
            "numerics.cell": 0.1, "numerics.tolerance": 1e-4, "flow.drag": 1e5,
        },
    )  # fmt: skip
    result = ec.simulate(own, "microscopic", "accurate", flow=past_a_cylinder())
    x, y = result.variables["x"][:, 0], result.variables["y"][:, 0]
    least = np.hypot(x, y).min(axis=0)
    for start, found in zip(starts, least, strict=True):
        psi = start * (1.0 - 1.0 / (2.9**2 + start**2))
        assert found == pytest.approx(0.5 * (psi + np.sqrt(psi**2 + 4.0)), abs=1e-3)

"""How to add a boundary: an inlet through which a density comes in at a speed, in one file. Three steps:

* a NamedTuple with its parameters, which are the keys of ``[boundaries.SIDE]`` in a scene file;
* a formula of what a ghost cell holds, from the cell at the edge, its mirror image, the inner normal, the
  time and the place; it is compiled into the sweeps;
* what a particle does that reaches the side: "reflect", "leave" or "wrap"; and, where mass comes in,
  how fast, which the first step from rest could not know. All are registered together.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compiled.algebra import Values, scale
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.geometry.boundaries import (
    ALONG,
    DENSITY,
    OTHERS,
    Place,
    ghost,
    register_boundary,
)


class Inlet(NamedTuple):
    """A density that comes in at a speed, straight on; both are reached in a time `rise`."""

    density: float
    speed: float
    rise: float = 0.0


@inline_kernel
def inlet_ghost(
    inlet: Inlet, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    """(rho, rho v_n, 0, and what else is transported: as much of it as the edge cell has)."""
    part = min(t / inlet.rise, 1.0) if inlet.rise > 0.0 else 1.0
    density = part * inlet.density
    # Of a particle's angle nothing comes in: it is that of the cell at the edge.
    per_mass = density / edge[DENSITY] if edge[DENSITY] > 0.0 else 0.0
    return (density, normal * density * inlet.speed, 0.0, *scale(per_mass, edge[OTHERS:]))


register_boundary("test inlet", Inlet, inlet_ghost, "leave", inflow=lambda inlet: inlet.speed)


# A channel from left to right: plug flow between walls that do not hold it up.
CHANNEL = """
name = "channel"
times = [0.4]

[domain]
x = [0.0, 1.0]
y = [0.0, 0.5]
boundary = "reflecting"

[boundaries.left]
kind = "test inlet"
density = 3.0
speed = 0.8

[boundaries.right]
kind = "remove"

[particles]
length = 0.1
width = 0.05
number = 1

[start]
x = [0.9, 1.0]
y = [0.0, 0.5]

[numerics]
cell = 0.05
"""


@pytest.fixture
def channel(tmp_path: Path) -> Path:
    """The scene file above."""
    path = tmp_path / "channel.toml"
    path.write_text(CHANNEL)
    return path


@pytest.mark.parametrize(
    ("scheme", "rel"),
    [pytest.param("paper", 1e-2, marks=pytest.mark.heavy), ("accurate", 1e-3)],
)
def test_mass_comes_in_as_plug_flow(channel: Path, scheme: Any, rel: float) -> None:
    """Mass in = density u_n height t.

    While the first cell fills, the fluxes see a jump at the edge: ballistic transport gives the ghost a
    slope that is a small part of it (4e-5 of the mass), FORCE mixes ghost and cell (3e-3).
    """
    result = ec.simulate(ec.load_scene(channel), model="rho_mono_kinetic", scheme=scheme)
    came_in = 3.0 * 0.8 * 0.5 * 0.4
    attributes = result.to_dataset().attrs
    assert attributes["mass_left"] == pytest.approx(-came_in, rel=rel)
    assert attributes["mass_end"] + attributes["mass_left"] == pytest.approx(1.0, rel=1e-12)
    last = result.to_dataset().isel(time=-1)
    # The front is at x = 0.32; what lies well behind it is the inlet's plug. All fly at one speed.
    plug = last.sel(x=slice(0.0, 0.15))
    np.testing.assert_allclose(plug["density"], 3.0, rtol=1e-2)
    np.testing.assert_allclose(plug["velocity_x"], 0.8, rtol=1e-12)


def test_it_has_its_parameters_in_a_scene_file(channel: Path) -> None:
    """What is missing, unknown or no number is refused in one line."""
    side = ec.load_scene(channel).sides["left"]
    assert side.parameters == {"density": 3.0, "speed": 0.8}
    for changes, message in (
        (
            {"boundaries.left.speed": None},
            r"left: expected .* \(density, speed, rise \(optional\)\)",
        ),
        ({"boundaries.left.angle": 1.0}, "not angle, density, speed"),
        ({"boundaries.left.speed": "fast"}, r"left\.speed: expected a valid number"),
        ({"boundaries.left.kind": "inlett"}, "expected one of inlet, periodic, .*test inlet"),
    ):
        with pytest.raises(ec.InputError, match=message):
            ec.load_scene(channel, changes)


def test_its_formula_may_follow_time() -> None:
    """Half the density at half the time to rise; Python runs the same formula."""
    inlet, edge = Inlet(2.0, 0.5, rise=4.0), (1.0, 0.1, 0.2, 0.7)
    held = ghost(inlet, edge, edge, -1.0, 2.0, Place(0.0, 0.0, 0.0))
    assert held[DENSITY] == 1.0
    assert held[ALONG] == -0.5
    assert held[2:] == (0.0, 0.7)


class Mistyped(NamedTuple):
    """A kind whose registration goes wrong."""

    density: float


def test_mistakes_in_a_registration_are_told_in_one_line() -> None:
    with pytest.raises(ValueError, match="there is another kind of boundary named 'test inlet'"):
        register_boundary("test inlet", Mistyped, inlet_ghost, "leave")
    with pytest.raises(TypeError, match=r"arguments \(kind, edge, .*\), found \(kind, edge\)"):
        register_boundary("mistyped", Mistyped, lambda kind, edge: edge, "leave")

"""The way along a tilted wall: the closed form, the channel, and, heavy, what slides and what does not."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

import ellipsoid_coupling as ec
from tests.workflows.test_workflows import workflow


@pytest.fixture
def tilted() -> ModuleType:
    return workflow("tilted_wall")


def test_the_exact_way_is_that_of_the_drag_alone(tilted: ModuleType) -> None:
    """Heun's rule for v' = gamma (1 - v), x' = v from rest: second order, 1e-6 at steps of 1e-3."""
    dt, way, speed = 1e-3, 0.0, 0.0
    for _ in range(round(tilted.TIME / dt)):
        ahead = speed + dt * tilted.DRAG * (1.0 - speed)
        after = speed + 0.5 * dt * tilted.DRAG * (2.0 - speed - ahead)
        way, speed = way + 0.5 * dt * (speed + ahead), after
    assert tilted.exact_way("rho_mono_kinetic") == pytest.approx(way, rel=1e-5)
    assert tilted.exact_way("diffusive") == tilted.TIME


@pytest.mark.parametrize("tilt", [0.0, 30.0])
def test_the_channel_lies_along_its_flow_and_gravity_across(
    tilted: ModuleType, tilt: float
) -> None:
    """To rounding of the spline; the start lies in the channel and the walls along the flow."""
    way = tilted.direction(tilt)
    flow, scene = tilted.channel(way), tilted.tilted_scene(way, 0.1, 1.0)
    sample = flow.evaluate(np.array([0.0, way.x]), np.array([0.1, way.y]))
    np.testing.assert_allclose(sample.velocity_x, way.x, atol=1e-9)
    np.testing.assert_allclose(sample.velocity_y, way.y, atol=1e-9)
    assert scene.gravity.x * way.x + scene.gravity.y * way.y == pytest.approx(0.0, abs=1e-12)
    sides = np.diff(flow.outline.ends, axis=1)[:, 0]
    along = sides[
        np.isin(flow.outline.patch, [flow.outline.names.index(n) for n in ("low", "high")])
    ]
    np.testing.assert_allclose(along[:, 0] * way.y - along[:, 1] * way.x, 0.0, atol=1e-12)


def parts_of(tilted: ModuleType, out: str) -> list[float]:
    """The numbers of a table with one resolution."""
    rows = [line for line in out.splitlines() if line[2:].startswith(tilted.MODELS)]
    return [float(line.split("|")[3]) for line in rows]


def test_mass_slides_along_a_tilted_wall(
    tilted: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    """It stayed where it landed, 0.29 of the way; with the fluid of its faces it is 5 % ahead on stairs."""
    assert tilted.main(["--models", "diffusive", "--tilts", "30", "--cells", "0.1"]) == 0
    assert abs(parts_of(tilted, capsys.readouterr().out)[0] - 1.0) < 0.06


def test_a_run_says_that_its_mass_lies_at_a_tilted_wall(tilted: ModuleType) -> None:
    """Pressed against it most of it does; none of an even density, and none at a wall along the grid."""
    way = tilted.direction(30.0)
    pressed = tilted.tilted_scene(way, 0.1, 1.0)
    (said,) = ec.simulate(pressed, "diffusive", flow=tilted.channel(way)).warnings
    assert "of the mass lies in cells at walls that are tilted" in said
    assert int(said.partition("%")[0]) > 60
    free = tilted.tilted_scene(way, 0.1, 0.0)
    assert ec.simulate(free, "diffusive", flow=tilted.channel(way)).warnings == []
    way = tilted.direction(0.0)
    along = tilted.tilted_scene(way, 0.1, 1.0)
    assert ec.simulate(along, "diffusive", flow=tilted.channel(way)).warnings == []


@pytest.mark.heavy
def test_along_the_grid_and_across_it_mass_slides_and_so_do_samples(
    tilted: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    """Samples to the accuracy of their steps; mass that lands has a cell's offset along the grid.

    On stairs mass with inertia is up to 12 % behind: it brings the mean velocity of the stair before.
    """
    sizes = ["--cells", "0.05"]
    assert tilted.main(["--tilts", "0", "30", *sizes]) == 0
    parts = np.array(parts_of(tilted, capsys.readouterr().out))
    assert (np.abs(parts - 1.0) < [1e-3, 1e-3, 0.02, 0.12, 1e-3, 0.06]).all()

"""Paths off edges: closed forms, billiards, corners, plates, and nothing that gets through."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.flow.inside import in_fluid
from ellipsoid_coupling.geometry.edge_grid import (
    ENDS,
    REFLECTS,
    SHIFTS,
    EdgeGrid,
)
from ellipsoid_coupling.geometry.edge_sorting import Edges, edge_grid
from ellipsoid_coupling.particles.bounces import Flight, fly
from ellipsoid_coupling.particles.path_parts import Path, Vector
from ellipsoid_coupling.particles.paths import End, follow
from tests.outlined_flows import PLATE, SQUARE, channel_outline, circle, corners, solid

Floats = NDArray[np.float64]
ZERO = (0.0, 0.0)


def ring_of(points: Floats) -> Floats:
    """Edges (n, 2, 2) from corner to corner, and back to the first."""
    return np.stack((points, np.roll(points, -1, axis=0)), axis=1)


def grid_of(ends: Floats, acts: list[int] | None = None, shifts: Floats | None = None) -> EdgeGrid:
    kinds = np.full(len(ends), REFLECTS) if acts is None else np.array(acts, np.int64)
    ways = np.zeros((len(ends), 2)) if shifts is None else shifts
    low, high = ends.reshape(-1, 2).min(axis=0), ends.reshape(-1, 2).max(axis=0)
    patches = np.arange(len(ends))
    return edge_grid(Edges(ends, ways, kinds, patches), (low[0], high[0]), (low[1], high[1]))


def free(place: Vector, velocity: Vector) -> Path:
    return Path(place, velocity, ZERO, ZERO, ZERO, ZERO, 0.0)


def path_of(parts: list[Any], damping: float) -> Path:
    """From place, velocity, force, slope, noise and kick."""
    place, velocity, force, slope, noise, kick = parts
    return Path(place, velocity, force, slope, noise, kick, damping)


@kernel
def billiard(edges: EdgeGrid, place: Vector, velocity: Vector, dt: float, steps: int) -> End:
    """Many steps, one after the other."""
    end = follow(edges, Path(place, velocity, ZERO, ZERO, ZERO, ZERO, 0.0), 0.0)
    for _ in range(steps):
        end = follow(edges, Path(place, velocity, ZERO, ZERO, ZERO, ZERO, 0.0), dt)
        place, velocity = end.position, end.velocity
    return end


@pytest.mark.parametrize("reflections", [10_000, pytest.param(1_000_000, marks=pytest.mark.heavy)])
@pytest.mark.parametrize("dt", [0.3, 20.0])
def test_a_billiard_in_a_circle_keeps_its_energy(reflections: int, dt: float) -> None:
    """To 1e-12 after a million reflections, within the polygon of 400 edges; one or ten a step."""
    edges = grid_of(ring_of(circle(1.0, 400)))
    # Chords of the circle are 1.2 long on the mean, the speed is 1.
    steps = int(1.2 * reflections / dt)
    end = billiard(edges, (0.3, 0.2), (0.6, 0.8), dt, steps)
    assert abs(math.hypot(*end.velocity) - 1.0) < 5e-13
    assert math.hypot(*end.position) < 1.0
    inside = in_fluid(ring_of(circle(1.0, 400)), *(np.array([value]) for value in end.position))
    assert inside.all()


def test_a_circle_keeps_the_angular_momentum_up_to_its_corners() -> None:
    """Chords of a true circle meet it at one angle; those of 20000 edges to 2 pi/20000 for each bounce."""
    edges = grid_of(ring_of(circle(1.0, 20_000)))
    end = follow(edges, free((0.3, 0.2), (0.6, 0.8)), 30.0)
    (x, y), (u, v) = end.position, end.velocity
    assert x * v - y * u == pytest.approx(0.3 * 0.8 - 0.2 * 0.6, abs=20 * math.pi / 20_000)


@pytest.mark.parametrize("damping", [0.0, 0.7, 300.0])
def test_a_box_is_two_coordinates(damping: float) -> None:
    """Force, slope and noise against `fly` in x and in y, with up to some ten bounces: to 1e-11."""
    edges = grid_of(ring_of(corners((0.0, 1.0), (0.0, 0.5))))
    rng = np.random.default_rng(4)
    for _ in range(200):
        place = rng.uniform((0.01, 0.01), (0.99, 0.49))
        motion = rng.normal(size=(5, 2)) * np.array([2.0, 4.0, 3.0, 1.0, 1.0])[:, None]
        parts: list[Any] = [tuple(map(float, row)) for row in (place, *motion)]
        end = follow(edges, path_of(parts, damping), 1.0)
        for d, high in enumerate((1.0, 0.5)):
            given = [part[d] for part in parts]
            start, speed, force, slope, noise, kick = given
            flight = Flight(start, speed, force, slope, noise, damping)
            at, after, sign, _ = fly(flight, 1.0, 0.0, high)
            assert end.position[d] == pytest.approx(at, abs=1e-11)
            assert end.velocity[d] == pytest.approx(after + sign * kick, abs=1e-10)


def test_a_ball_on_a_slope_bounces_as_in_its_frame() -> None:
    """Along the slope it rolls freely; across it, it is the bouncing ball.

    Ways end 2e-13 before the floor, which some ten bounces stretch: to 5e-12.
    """
    turn = 0.4
    along, normal = (
        np.array([math.cos(turn), math.sin(turn)]),
        np.array([-math.sin(turn), math.cos(turn)]),
    )
    floor = np.array(
        [-9.0 * along, 9.0 * along, 9.0 * along + 9.0 * normal, -9.0 * along + 9.0 * normal]
    )
    edges = grid_of(ring_of(floor))
    pull = -1.0 * normal + 0.3 * along
    for t in (0.3, 1.0, 1.9, 5.3):
        start = 0.32 * normal
        end = follow(edges, Path(tuple(start), ZERO, tuple(pull), ZERO, ZERO, ZERO, 0.0), t)
        at, speed, _, _ = fly(Flight(0.32, 0.0, -1.0, 0.0, 0.0, 0.0), t, 0.0, 9.0)
        assert normal @ end.position == pytest.approx(at, abs=5e-12)
        assert along @ end.position == pytest.approx(0.15 * t * t, abs=1e-12)
        assert normal @ end.velocity == pytest.approx(speed, abs=5e-12)


def test_what_is_pressed_against_a_wall_slides_along_it() -> None:
    """With its speed along the wall, and its tiny one across kept: no bounce is followed without end."""
    edges = grid_of(ring_of(corners((0.0, 4.0), (0.0, 1.0))))
    end = follow(edges, Path((0.5, 0.0), (1.0, 0.0), (0.0, -1.0), ZERO, ZERO, ZERO, 0.0), 2.0)
    assert end.position == pytest.approx((2.5, 0.0), abs=1e-12)
    assert end.velocity == pytest.approx((1.0, 0.0), abs=1e-6)
    turned = circle(1.0, 90)
    end = follow(
        grid_of(ring_of(turned)),
        Path((0.0, -0.9), (0.3, 0.0), (0.0, -50.0), ZERO, ZERO, ZERO, 5.0),
        3.0,
    )
    assert in_fluid(ring_of(turned), *(np.array([value]) for value in end.position)).all()


SOLIDS = {
    "square": solid(SQUARE),
    "plate": solid(PLATE),
    "wedge": solid(np.array([[1.0, 0.5], [2.0, 0.51], [2.0, 0.49]])),
    "circle": solid(circle(0.2, 60, (1.1, 0.5))[::-1]),
}


@kernel
def scatter(edges: EdgeGrid, starts: Floats, dt: float, steps: int, places: Floats) -> None:
    """Steps of particles with forces that change from step to step; places (steps, n, 2)."""
    for i in range(len(starts)):
        x, y, u, v = starts[i]
        place, velocity = (x, y), (u, v)
        for step in range(steps):
            swing = math.sin(1.3 * step + i), math.cos(0.7 * step + 2.0 * i)
            force = 3.0 * swing[0] / dt, 3.0 * swing[1] / dt
            slope = -5.0 * swing[1] / (dt * dt), 4.0 * swing[0] / (dt * dt)
            noise = swing[1], swing[0]
            path = Path(place, velocity, force, slope, noise, ZERO, 1.0 / dt)
            end = follow(edges, path, dt)
            place, velocity = end.position, end.velocity
            places[step, i, 0], places[step, i, 1] = place


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("dt", [0.01, 0.3, 20.0])
def test_nothing_gets_through_whatever_the_step(name: str, dt: float) -> None:
    """300 particles, 40 steps of curved ways between a hundredth and a hundred times the channel."""
    outline = channel_outline(SOLIDS[name])
    edges = grid_of(outline.ends)
    rng = np.random.default_rng(8)
    starts = rng.uniform((0.0, 0.0, -1.0, -1.0), (4.0, 1.0, 1.0, 1.0), (300, 4))
    starts = starts[in_fluid(outline.ends, starts[:, 0], starts[:, 1])]
    places = np.empty((40, len(starts), 2))
    scatter(edges, starts, dt, 40, places)
    assert in_fluid(outline.ends, places[..., 0].ravel(), places[..., 1].ravel()).all()
    # They do get about.
    assert np.ptp(places[..., 0], axis=0).mean() > 0.01


@pytest.mark.parametrize("offset", [0.0, 1e-17, 1e-15, -1e-15, 1e-13, 1e-9])
def test_aimed_at_a_corner(offset: float) -> None:
    """At the corners of a box from within, at those of a square and a plate: to the last digit."""
    outline = channel_outline(SOLIDS["square"])
    edges, plate = grid_of(outline.ends), channel_outline(SOLIDS["plate"])
    for grid, ends, corner in (
        (edges, outline.ends, (0.0, 0.0)), (edges, outline.ends, (4.0, 1.0)),
        (edges, outline.ends, (1.0, 0.4)), (edges, outline.ends, (1.0, 0.6)),
        (grid_of(plate.ends), plate.ends, (1.0, 0.3)),
    ):  # fmt: skip
        for start in ((0.5, 0.5), (0.3, 0.35), (1.0, 0.2), (2.5, 0.9)):
            way = corner[0] - start[0] + offset, corner[1] - start[1]
            if not in_fluid(ends, np.array([start[0]]), np.array([start[1]])).all():
                continue
            for speed in (1.0, 3.7, 1e3):
                end = follow(grid, free(start, (speed * way[0], speed * way[1])), 1.2)
                found = np.array([end.position[0]]), np.array([end.position[1]])
                assert in_fluid(ends, *found).all()
                assert math.hypot(*end.velocity) == pytest.approx(
                    speed * math.hypot(*way), rel=1e-13
                )


def test_a_plate_has_two_sides() -> None:
    """A bounce off its front leaves the back alone: one reflection each, from either side."""
    edges = grid_of(channel_outline(SOLIDS["plate"]).ends)
    for start, speed, end_x in ((0.6, 1.0, 0.6), (1.4, -1.0, 1.4)):
        end = follow(edges, free((start, 0.5), (speed, 0.0)), 0.8)
        assert end.position == pytest.approx((end_x, 0.5), abs=1e-12)
        assert end.velocity == (-speed, 0.0)


def test_an_edge_that_ends_a_path_tells_when_and_which() -> None:
    """At rest on it to 1e-12, at the time of the closed form, after a bounce on the way."""
    edges = grid_of(ring_of(corners((0.0, 4.0), (0.0, 1.0))), [REFLECTS, ENDS, REFLECTS, REFLECTS])
    end = follow(edges, free((3.0, 0.5), (0.5, 0.5)), 10.0)
    assert end.edge == 1
    assert end.time == pytest.approx(2.0, abs=1e-12)
    assert end.position == pytest.approx((4.0, 0.5), abs=1e-12)


def test_periodic_sides_shift_as_often_as_it_takes() -> None:
    """Modulo the period, to rounding, with bounces off the walls in between."""
    shifts = np.array([[0.0, 0.0], [-4.0, 0.0], [0.0, 0.0], [4.0, 0.0]])
    box = ring_of(corners((0.0, 4.0), (0.0, 1.0)))
    edges = grid_of(box, [REFLECTS, SHIFTS, REFLECTS, SHIFTS], shifts)
    for speed in (0.7, -0.7, 13.1):
        end = follow(edges, free((1.0, 0.5), (speed, 0.3)), 9.0)
        assert end.position[0] == pytest.approx((1.0 + 9.0 * speed) % 4.0, abs=1e-11)
        up = (0.5 + 2.7) % 2.0
        assert end.position[1] == pytest.approx(2.0 - up if up > 1.0 else up, abs=1e-11)


def test_numbers_that_are_none_come_back_as_such() -> None:
    """In bounded work: the run says that its solution is no longer finite."""
    edges = grid_of(ring_of(circle(1.0, 40)))
    for bad in (math.nan, math.inf):
        end = follow(edges, free((0.0, 0.0), (bad, 0.0)), 1.0)
        assert not math.isfinite(end.position[0])
    end = follow(edges, free((0.1, 0.2), (1e200, 1e150)), 1.0)
    assert math.hypot(*end.position) < 1.0

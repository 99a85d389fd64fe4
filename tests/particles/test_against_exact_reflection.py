"""Straight ways off random walls against the laws of reflection in exact fractions, edge by edge.

Walls are random polygons with sharp and re-entrant corners around the fluid and within it, and a plate
without thickness: `exact_way` knows nothing of cells, gaps or steps.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ellipsoid_coupling.flow.inside import in_fluid
from ellipsoid_coupling.geometry.edge_grid import REFLECTS, EdgeGrid
from ellipsoid_coupling.geometry.edge_sorting import Edges, edge_grid
from ellipsoid_coupling.interaction.particle_forces import Drift
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.forces import BlockForces
from ellipsoid_coupling.particles.own_clock import advance_own_clocks
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates
from ellipsoid_coupling.physics.drift import External
from ellipsoid_coupling.stepping.step_control import GIVEN, new_clock

Floats = NDArray[np.float64]
Exact = tuple[Fraction, Fraction]

# Corners, places and velocities are multiples of this: short fractions, exact as floats.
UNIT = 1.0 / 1024.0
# Ways that pass a corner or graze an edge this closely go one way or the other by rounding.
CLOSE = 1e-6
END = 1.0
PARTICLES = 6


class Way(NamedTuple):
    """Where an exact way ends, how many reflections it has, and whether rounding may change them."""

    position: Exact
    reflections: int
    delicate: bool


def rounded(points: Floats) -> Floats:
    return np.asarray(np.round(points / UNIT) * UNIT)


def star(rng: np.random.Generator, corners: int, radii: tuple[float, float]) -> Floats:
    """A polygon around 0, counter-clockwise, whose corners lie at random distances: spikes and notches."""
    turn = 2.0 * np.pi * (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) / corners
    radius = rng.uniform(*radii, corners)[:, None]
    return rounded(radius * np.column_stack((np.cos(turn), np.sin(turn))))


def random_walls(rng: np.random.Generator) -> Floats:
    """Edges (E, 2, 2) of a fluid around a solid and a folded plate."""
    outer, inner = star(rng, 10, (1.0, 1.6)), star(rng, 7, (0.05, 0.3))[::-1] - [0.375, 0.0]
    folds = np.column_stack((np.sort(rng.uniform(0.25, 0.6, 4)), rng.uniform(-0.35, 0.35, 4)))
    plate = rounded(folds)
    both = np.vstack((plate, plate[-2:0:-1]))
    rings = [np.stack((line, np.roll(line, -1, axis=0)), axis=1) for line in (outer, inner, both)]
    ends = np.concatenate(rings)
    return np.asarray(ends[(ends[:, 0] != ends[:, 1]).any(axis=1)])


def cross(a: Exact, b: Exact) -> Fraction:
    return a[0] * b[1] - a[1] * b[0]


def exact(vector: Floats) -> Exact:
    return Fraction(float(vector[0])), Fraction(float(vector[1]))


def first_hit(
    walls: list[tuple[Exact, Exact]], place: Exact, velocity: Exact
) -> tuple[Fraction, int]:
    """The time until the way meets a wall from its own side, and which; -1 for none."""
    soonest, found = Fraction(10**9), -1
    for e, (start, stop) in enumerate(walls):
        along = stop[0] - start[0], stop[1] - start[1]
        to = place[0] - start[0], place[1] - start[1]
        approach, above = cross(along, velocity), cross(along, to)
        # What has just been reflected is on the line of its wall, and of the back of a plate.
        if approach >= 0 or above <= 0:
            continue
        time, part = -above / approach, cross(to, velocity) / approach
        if 0 <= part <= 1 and time < soonest:
            soonest, found = time, e
    return soonest, found


def exact_way(ends: Floats, place: Floats, velocity: Floats) -> Way:
    """A straight way for the time END, off all edges that it meets."""
    walls = [(exact(start), exact(stop)) for start, stop in ends]
    at, speed = exact(place), exact(velocity)
    left, count, delicate = Fraction(END), 0, False
    while True:
        time, edge = first_hit(walls, at, speed)
        step = min(time, left)
        beyond = at[0] + step * speed[0], at[1] + step * speed[1]
        delicate |= passes_a_corner(ends, at, beyond)
        at, left = beyond, left - step
        if left == 0:
            return Way(at, count, delicate)
        (ax, ay), (bx, by) = walls[edge]
        nx, ny = ay - by, bx - ax
        turned = 2 * (speed[0] * nx + speed[1] * ny) / (nx * nx + ny * ny)
        graze = abs(float(turned)) * math.hypot(nx, ny) / math.hypot(*map(float, speed))
        delicate |= graze < CLOSE
        speed = speed[0] - turned * nx, speed[1] - turned * ny
        count += 1


def passes_a_corner(ends: Floats, start: Exact, stop: Exact) -> bool:
    """Whether the way between two places comes close to the end of an edge."""
    a, b = np.array([float(c) for c in start]), np.array([float(c) for c in stop])
    way, to = b - a, ends.reshape(-1, 2) - a
    part = np.clip(to @ way / max(float(way @ way), 1e-300), 0.0, 1.0)
    return bool(np.hypot(*(to - part[:, None] * way).T).min() < CLOSE)


def random_starts(rng: np.random.Generator, ends: Floats) -> Floats:
    """Places (2, n) in the fluid, away from all edges."""
    places = rounded(rng.uniform(-1.2, 1.2, (200, 2))) + 0.5 * UNIT
    way, to = ends[:, 1] - ends[:, 0], places[:, None] - ends[None, :, 0]
    part = np.clip((to * way).sum(axis=2) / (way**2).sum(axis=1), 0.0, 1.0)
    apart = np.hypot(*np.moveaxis(to - part[..., None] * way, 2, 0)).min(axis=1)
    fluid = in_fluid(ends, places[:, 0], places[:, 1]) & (apart > UNIT / 8.0)
    return np.ascontiguousarray(places[fluid][:PARTICLES].T)


def grid_of(ends: Floats) -> EdgeGrid:
    nothing = np.zeros(len(ends), np.int64)
    acts, shifts = np.full(len(ends), REFLECTS), np.zeros((len(ends), 2))
    low, high = ends.reshape(-1, 2).min(axis=0), ends.reshape(-1, 2).max(axis=0)
    return edge_grid(Edges(ends, shifts, acts, nothing), (low[0], high[0]), (low[1], high[1]))


def stepped(edges: EdgeGrid, place: Floats, velocity: Floats, scheme: str, dt: float) -> Floats:
    """Places (2, n) at END, by steps of a stepper, without any force."""
    state = ParticleState(
        place[None].copy(),
        velocity[None].copy(),
        np.zeros((1, *place.shape)),
        new_clock(1, dt, GIVEN),
        None,
    )
    limits = Limits(dt, 1e30, np.ones(2), None, edges=edges)
    rates = Rates(np.zeros(2), np.zeros(2), 2, 2)
    for n in range(round(END / dt)):
        forces = BlockForces(Drift(External()), None)
        advance_own_clocks(STEPPERS[scheme], state, forces, rates, limits, (n + 1) * dt, 10)
    return np.asarray(state.position[0])


def compare(seed: int, steps: int, scheme: str) -> int:
    """Compare the ways of some particles; returns how many reflections were compared."""
    rng = np.random.default_rng(seed)
    ends = random_walls(rng)
    place = random_starts(rng, ends)
    velocity = rounded(rng.normal(size=place.shape) * 10.0 ** rng.uniform(-0.5, 1.0))
    found = stepped(grid_of(ends), place, velocity, scheme, END / steps)
    assert in_fluid(ends, found[0], found[1]).all()
    compared = 0
    for i in range(place.shape[1]):
        way = exact_way(ends, place[:, i], velocity[:, i])
        if not way.delicate:
            assert found[:, i] == pytest.approx([float(c) for c in way.position], abs=1e-9)
            compared += way.reflections
    return compared


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([1, 3, 40]), st.sampled_from(sorted(STEPPERS)))
def test_ways_end_where_exact_reflection_leads(seed: int, steps: int, scheme: str) -> None:
    """To 1e-9: ways end some 1e-13 before an edge, which tens of reflections off plane edges add up."""
    compare(seed, steps, scheme)


def test_the_random_walls_are_met() -> None:
    """The ways that are compared have reflections: with few, the test above would show nothing."""
    assert sum(compare(seed, 3, "accurate") for seed in range(4)) > 40


@pytest.mark.heavy
@settings(max_examples=2000, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([1, 2, 7, 100]), st.sampled_from(sorted(STEPPERS)))
def test_many_ways_end_where_exact_reflection_leads(seed: int, steps: int, scheme: str) -> None:
    compare(seed, steps, scheme)

"""Transport along x and y in one pass: that of two sweeps, bit for bit, however it is shared."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move, sweep_planes
from ellipsoid_coupling.finite_volume.q_grid import NORMAL, inside, occupied_extents
from ellipsoid_coupling.finite_volume.q_transport import transport, transport_in_plane
from ellipsoid_coupling.finite_volume.strips import Plane, strips_of, whole_plane
from ellipsoid_coupling.finite_volume.sweep import Runs
from ellipsoid_coupling.geometry.boundaries import (
    Boundaries,
    Periodic,
    Reflect,
    Remove,
    everywhere,
)
from tests.finite_volume.whole import fill, ghosts_of, sweep

Floats = NDArray[np.float64]

BALLISTIC = Ballistic((0.05, *(0.1,) * 3))
ORDERS = pytest.mark.parametrize("x_first", [True, False])
REFLECTING, OPEN, PERIODIC = (everywhere(kind) for kind in (Reflect(), Remove(), Periodic()))
# With a seam, too, and each kind at some side.
MIXED = Boundaries(Reflect(), Remove(), Periodic(), Periodic())
BOUNDARIES = pytest.mark.parametrize("kinds", [REFLECTING, OPEN, PERIODIC])
# A flux and kinds are compiled together, 15 s a pair. Neither looks at the other: each flux meets closed
# sides, open ones, and a seam.
SWEPT = pytest.mark.parametrize(
    ("flux", "kinds"),
    [(BALLISTIC, kinds) for kinds in (REFLECTING, OPEN, PERIODIC)]
    + [(Force(pressure), kinds) for pressure in (0.0, 1.0) for kinds in (REFLECTING, OPEN, MIXED)],
)


def some_fields(shape: tuple[int, ...], seed: int, part: float = 0.7) -> Floats:
    """A `part` of all cells holds mass, |v| <= 1, and a carried quantity; padded."""
    rng = np.random.default_rng(seed)
    fields = np.zeros((4, *(n + 4 for n in shape)))
    inner = fields[(slice(None), *[slice(2, -2)] * len(shape))]
    inner[0] = rng.random(shape) * (rng.random(shape) < part)
    inner[1:] = inner[0] * rng.uniform(-1.0, 1.0, (3, *shape))
    return fields


def swept_twice(
    flux: Any, fields: Floats, ratio: float, x_first: bool, kinds: Boundaries
) -> tuple[Floats, float]:
    """An r-grid after a sweep along one axis and one along the other, and what has left."""
    fields, left = fields.copy(), np.zeros(1)
    for axis in (-1, -2) if x_first else (-2, -1):
        fill(fields, axis, kinds)
        sweep(flux, fields, axis, -axis, ratio, left)
    return fields[:, 2:-2, 2:-2], float(left[0])


@SWEPT
@ORDERS
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (3, 2), (5, 17), (40, 9), (130, 37)])
def test_a_whole_plane(flux: Any, x_first: bool, kinds: Boundaries, shape: tuple[int, int]) -> None:
    """Cut into strips for one thread, two and many, of which the mass that leaves knows nothing."""
    if shape == (1, 1) and kinds.wraps(-2):
        pytest.skip("a periodic direction has two cells at least")
    start = some_fields(shape, 3)
    expected, left = swept_twice(flux, start, 0.4, x_first, kinds)
    gone = []
    for threads in (1, numba.get_num_threads()):
        fields = start.copy()
        before = numba.get_num_threads()
        numba.set_num_threads(threads)
        try:
            whole = whole_plane((shape[0] + 4, shape[1] + 4), kinds.wraps(-2), threads)
            move, table = Move(x_first, 0.4, 0.0), ghosts_of(fields, kinds)
            gone.append(sweep_planes(flux, fields.reshape(4, -1), *whole, move, table))
        finally:
            numba.set_num_threads(before)
        np.testing.assert_array_equal(fields[:, 2:-2, 2:-2], expected)
    assert gone[0] == gone[1]
    # Sums of some hundred numbers of order 1.
    assert gone[0] == pytest.approx(left, abs=1e-12)


@ORDERS
@BOUNDARIES
def test_many_short_strips(
    monkeypatch: pytest.MonkeyPatch, x_first: bool, kinds: Boundaries
) -> None:
    """Cuts after every second to third row, as on a machine with very many threads."""
    start = some_fields((23, 12), 5)
    expected, _ = swept_twice(BALLISTIC, start, 0.4, x_first, kinds)
    monkeypatch.setattr("ellipsoid_coupling.finite_volume.strips.SHORTEST_STRIP", 3)
    monkeypatch.setattr("ellipsoid_coupling.finite_volume.strips.STRIPS_PER_THREAD", 10)
    whole_plane.cache_clear()
    plane, strips, spans = whole_plane((27, 16), kinds.wraps(-2), numba.get_num_threads())
    whole_plane.cache_clear()
    assert strips.above.size >= 7
    fields = start.copy()
    here = plane, strips, spans, Move(x_first, 0.4, 0.0), ghosts_of(fields, kinds)
    sweep_planes(BALLISTIC, fields.reshape(4, -1), *here)
    np.testing.assert_array_equal(fields[:, 2:-2, 2:-2], expected)


@SWEPT
@ORDERS
@pytest.mark.parametrize("part", [0.02, 0.2, 1.0])
def test_where_mass_is(flux: Any, x_first: bool, kinds: Boundaries, part: float) -> None:
    """Scattered mass on planes of angles, over four steps; the extents are those of two transports."""
    fields = some_fields((6, 21, 40), 7, part)
    twin, left, twins_left = fields.copy(), np.zeros(1), np.zeros(1)
    table = ghosts_of(fields, kinds)
    extents = twins_extents = occupied_extents(fields)
    for _ in range(4):
        move = Move(x_first, 0.4, 0.0)
        extents = transport_in_plane(flux, fields, move, extents, table, left)
        for axis in (-1, -2) if x_first else (-2, -1):
            twins_extents = transport(flux, twin, axis, 0.4, twins_extents, table, 0.0, twins_left)
        np.testing.assert_array_equal(inside(fields), inside(twin))
        np.testing.assert_array_equal(extents, twins_extents)
    assert left[0] == pytest.approx(twins_left[0], abs=1e-12)
    assert (left[0] == 0.0) == (kinds.closed or twins_left[0] == 0.0)


def test_two_clouds_in_a_plane() -> None:
    """What leaves is told by the one that it leaves: the other one, swept elsewhere, adds nothing."""
    fields = np.zeros((4, 5, 24, 10))
    inner = inside(fields)
    inner[0, 0, :3], inner[0, 0, -8:-4] = 1.0, 2.0
    inner[2, 0, :3] = -0.5
    for x_first in (True, False):
        moved, left = fields.copy(), np.zeros(1)
        extents = occupied_extents(moved)
        flux, table = BALLISTIC, ghosts_of(moved, Remove())
        transport_in_plane(flux, moved, Move(x_first, 0.4, 0.0), extents, table, left)
        # A fifth of each of six cells at the lower edge.
        assert left[0] == pytest.approx(6 * 0.2, rel=1e-13)
        assert inside(moved)[0].sum() == pytest.approx(inner[0].sum() - left[0], rel=1e-13)


def test_no_mass_goes_nowhere() -> None:
    fields = np.zeros((4, 10, 9, 12))
    extents = occupied_extents(fields)
    after = transport_in_plane(
        Force(0.0), fields, Move(True, 0.4, 0.0), extents, ghosts_of(fields, Remove())
    )
    assert not fields.any()
    np.testing.assert_array_equal(after, extents)


def test_strips_follow_one_another() -> None:
    """Every row of every run in one strip; a cut has one strip below it and one above."""
    plane = Plane(20, 2000, 16, 96, 42)
    row = plane.row
    runs = Runs(
        np.array([42, 1000, 3001]), np.array([100, 1, 37]), np.array([16, 3, 5], dtype=np.int64)
    )
    strips = strips_of(runs, plane, False, 2)
    rows = np.concatenate([f + row * np.arange(n) for f, n in zip(*strips[:2], strict=True)])
    expected = [f + row * np.arange(n) for f, n in zip(*runs[:2], strict=True)]
    np.testing.assert_array_equal(rows, np.concatenate(expected))
    assert sorted(strips.low[strips.low >= 0]) == list(range(strips.above.size))
    assert sorted(strips.high[strips.high >= 0]) == list(range(strips.above.size))
    for k, above in enumerate(strips.above):
        lower, upper = (int(np.flatnonzero(ends == k)[0]) for ends in (strips.high, strips.low))
        assert strips.first[upper] == above
        assert strips.first[lower] + row * strips.length[lower] == above
    np.testing.assert_array_equal(np.unique(strips.width), [3, 5, 16])


def test_a_seam_is_one_more_cut() -> None:
    """Of both planes with a strip at an end, between the last row and the first; the others keep theirs."""
    plane = Plane(20, 2000, 16, 96, 42)
    first = np.array([42, 42 + 90 * 20, 2042 + 90 * 20, 4042 + 300])
    runs = Runs(first, np.array([3, 6, 6, 5]), np.full(4, 16))
    strips = strips_of(runs, plane, True, 2)
    assert strips.low.tolist() == [0, -1, -1, -1]
    assert strips.high.tolist() == [-1, 0, 1, -1]
    assert strips.below.tolist() == [42 + 95 * 20, 2042 + 95 * 20]
    assert strips.above.tolist() == [42, 2042]


@pytest.mark.parametrize("axis", [-1, -2])
def test_walls_are_swept_like_mirrors(axis: int) -> None:
    """A reflecting edge is the middle of a doubled, mirrored state: to rounding, both orders."""
    start = some_fields((12, 10), 11)
    inner = start[:, 2:-2, 2:-2]
    image = np.flip(inner, axis).copy()
    image[NORMAL[axis]] *= -1.0
    doubled = np.concatenate([image, inner], axis=axis)
    for x_first in (True, False):
        single, double = start.copy(), np.zeros((4, *(n + 4 for n in doubled.shape[1:])))
        double[:, 2:-2, 2:-2] = doubled
        for fields in (single, double):
            whole = whole_plane(fields.shape[1:], False, numba.get_num_threads())
            sweep_planes(
                BALLISTIC,
                fields.reshape(4, -1),
                *whole,
                Move(x_first, 0.4, 0.0),
                ghosts_of(fields, Reflect()),
            )
        half = np.split(double[:, 2:-2, 2:-2], 2, axis=axis)[1]
        np.testing.assert_allclose(single[:, 2:-2, 2:-2], half, atol=1e-15)

"""The (angle, y, x) grid: start angles, the window that holds mass, transport within it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.boundary import fill_periodic
from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force
from ellipsoid_coupling.finite_volume.fluxes.kinetic import Kinetic
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.finite_volume.q_grid import (
    NORMAL,
    Q,
    QGrid,
    check_angles,
    grown,
    inside,
    occupied_extents,
    start_angles,
)
from ellipsoid_coupling.finite_volume.q_transport import column_runs, transport
from ellipsoid_coupling.geometry.boundaries import Remove
from tests.finite_volume.whole import fill, ghosts_of, sweep

Floats = NDArray[np.float64]

GRID = QGrid(Grid(0.0, 0.0, 0.1, 9, 7), 12)
FLUXES = pytest.mark.parametrize("flux", [Ballistic((0.05, *(0.1,) * 3)), Force(0.0), Force(1.0)])
AXES = pytest.mark.parametrize("axis", [-1, -2, -3])


def some_fields(planes: list[int], seed: int = 4) -> Floats:
    """Mass in some planes, away from the edges in x and y but for one cell; |v| <= 1."""
    rng = np.random.default_rng(seed)
    fields = np.zeros((4, *GRID.padded))
    inner = inside(fields)
    inner[Q, planes, 2:5, 0:4] = rng.random((len(planes), 3, 4))
    for k in range(1, 4):
        inner[k] = inner[Q] * rng.uniform(-1.0, 1.0, GRID.shape)
    return fields


@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, 0.3, -0.1, 6.2, 7.0])
def test_the_start_angle_is_the_mean(angle: float) -> None:
    """Exact: at most two cells share the mass so that the mean direction is the angle."""
    parts = start_angles(GRID, angle)
    held = np.flatnonzero(parts)
    assert parts.sum() == pytest.approx(1.0, abs=1e-15)
    assert held.size <= 2
    from_angle = (GRID.angle[held] - angle + np.pi) % (2 * np.pi) - np.pi
    assert (parts[held] * from_angle).sum() == pytest.approx(0.0, abs=1e-14)


def test_a_centred_start_angle_has_one_cell() -> None:
    assert np.flatnonzero(start_angles(GRID, 0.5 * np.pi)).tolist() == [3]
    assert start_angles(QGrid(GRID.plane, 1), 1.2).tolist() == [1.0]


def test_the_extents_are_what_holds_mass() -> None:
    extents = occupied_extents(some_fields([0, 1, 11]))
    held = extents[..., 1] > 0
    assert np.argwhere(held).tolist() == [[a, j] for a in (0, 1, 11) for j in (2, 3, 4)]
    assert np.all(extents[held] == [0, 4])
    assert not np.any(occupied_extents(np.zeros((4, *GRID.padded)))[..., 1])


def test_extents_grow_periodically_in_angle_and_end_in_space() -> None:
    """Equal to one cell more on both sides of every filled cell, row by row made convex."""
    extents = occupied_extents(some_fields([0, 1, 11]))
    for axis, rows in ((-3, [0, 1, 2, 10, 11]), (-2, [0, 1, 11]), (-1, [0, 1, 11])):
        wider = grown(extents, 9, axis)
        held = wider[..., 1] > 0
        assert np.flatnonzero(held.any(axis=1)).tolist() == rows
        assert np.flatnonzero(held.any(axis=0)).tolist() == list(
            range(1, 6) if axis == -2 else range(2, 5)
        )
        assert np.all(wider[held] == ([0, 5] if axis == -1 else [0, 4]))


def test_extents_of_periodic_rows_are_whole_where_mass_comes_to_an_end() -> None:
    """Across y to the other side; along x an interval cannot go on at the other end."""
    fields = np.zeros((4, 5, 9, 12))
    inside(fields)[Q, 0, 0, 2:4] = inside(fields)[Q, 0, 2, 5:] = inside(fields)[Q, 0, 3, :1] = 1.0
    extents = occupied_extents(fields)
    assert grown(extents, 8, -1, True)[0].tolist() == [[1, 5], [8, 0], [0, 8], [0, 8], [8, 0]]
    assert grown(extents, 8, -2, True)[0].tolist() == [[2, 4], [2, 8], [0, 8], [0, 8], [0, 4]]


@pytest.mark.parametrize("axis", [-2, -3])
def test_runs_cover_every_extent_once(axis: int) -> None:
    """Random rows: every cell of an extent in one run, runs with vacuum at both ends."""
    rng = np.random.default_rng(8)
    shape = (7, 9, 150)
    ends = np.sort(rng.integers(0, 151, (*shape[:2], 2)), axis=-1)
    extents = np.where(
        (ends[..., :1] < ends[..., 1:]) & (rng.random((*shape[:2], 1)) < 0.6), ends, [150, 0]
    )
    row, plane = shape[2] + 4, (shape[1] + 4) * (shape[2] + 4)
    stride = row if axis == -2 else plane
    visits = np.zeros(11 * plane, np.int64)
    for first, count, width in zip(*column_runs(extents, row, plane, axis), strict=True):
        cells = first + stride * np.arange(count)[:, None] + np.arange(width)
        if axis == -3:
            # The angle's runs go on from the last row to the first one.
            cells = np.where(cells < 9 * plane, cells, cells - 7 * plane)
        visits[cells] += 1
    inner = visits.reshape(11, 13, 154)[2:-2, 2:-2, 2:-2]
    columns = np.arange(150)
    held = (columns >= extents[..., :1]) & (columns < extents[..., 1:])
    assert visits.max() == 1
    assert visits.sum() == inner.sum()
    assert np.all(inner[held] == 1)


@pytest.mark.parametrize("planes", [[0, 1, 11], [0, 2, 3, 4, 5, 6, 7, 8, 9, 11], list(range(12))])
@FLUXES
@AXES
def test_transport_in_the_window_is_the_whole_sweep(
    flux: Any, axis: int, planes: list[int]
) -> None:
    """Bit for bit, over three steps, with mass on both sides of angle 0 and all round."""
    fields = some_fields(planes)
    whole = fields.copy()
    extents = occupied_extents(fields)
    for _ in range(3):
        extents = transport(flux, fields, axis, 0.4, extents, ghosts_of(fields, Remove()), 0.0)
        if axis == -3:
            fill_periodic(whole, 1)
        else:
            fill(whole, axis, Remove())
        sweep(flux, whole, axis, NORMAL[axis], 0.4)
        np.testing.assert_array_equal(inside(fields), inside(whole))


@FLUXES
def test_long_rows_go_round_piece_by_piece(flux: Any) -> None:
    """As a sweep with ghosts does them at once: bit for bit, rows of three pieces and a rest."""
    rng = np.random.default_rng(6)
    fields = np.zeros((4, 9, 6, 255))
    inside(fields)[Q] = rng.random((5, 2, 251))
    inside(fields)[1:] = inside(fields)[Q] * rng.uniform(-1.0, 1.0, (3, 5, 2, 251))
    whole = fields.copy()
    fill_periodic(whole, 1)
    sweep(flux, whole, -3, 3, 0.4)
    transport(flux, fields, -3, 0.4, occupied_extents(fields), ghosts_of(fields, Remove()), 0.0)
    np.testing.assert_array_equal(inside(fields), inside(whole))


@pytest.mark.parametrize(
    "flux", [Ballistic((0.05, *(0.1,) * 3)), Force(1.0), Kinetic(np.zeros(0), 0.05)]
)
@pytest.mark.parametrize("angles", [3, 4, 5, 6])
def test_short_rings(flux: Any, angles: int) -> None:
    """Without a look at the angle's ghosts: bit for bit, all planes with mass, some, or all but one."""
    rng = np.random.default_rng(angles)
    whole = list(range(angles))
    for held in (whole, whole[1:], whole[:-1], whole[:1], [0, angles - 1]):
        fields = np.zeros((4, angles + 4, 6, 9))
        inside(fields)[Q, held] = rng.random((len(held), 2, 5))
        inside(fields)[1:] = inside(fields)[Q] * rng.uniform(-1.0, 1.0, (3, angles, 2, 5))
        here = flux
        if isinstance(flux, Kinetic):
            tilt = np.zeros(fields.shape[1:])
            tilt[2:-2] = rng.uniform(0.9, 1.1, (angles, 6, 9))
            fill_periodic(tilt[None], 1)
            here = Kinetic(tilt.ravel(), 0.05)
        twin = fields.copy()
        fill_periodic(twin, 1)
        sweep(here, twin, -3, 3, 0.3)
        fields[:, :2] = fields[:, -2:] = np.nan
        transport(here, fields, -3, 0.3, occupied_extents(fields), ghosts_of(fields, Remove()), 0.0)
        np.testing.assert_array_equal(inside(fields), inside(twin))


@FLUXES
def test_the_angle_is_swept_like_x(flux: Any) -> None:
    """Axes and momenta exchanged, both as rings: the same numbers to rounding."""
    rng = np.random.default_rng(5)
    fields = np.zeros((4, 10, 9, 12))
    inside(fields)[Q] = rng.random((6, 5, 8))
    for k in range(1, 4):
        inside(fields)[k] = inside(fields)[Q] * rng.uniform(-1.0, 1.0, (6, 5, 8))
    turned = np.ascontiguousarray(fields.transpose(0, 3, 2, 1)[[0, 3, 2, 1]])
    fill_periodic(fields, 1)
    fill_periodic(turned, 3)
    sweep(flux, fields, -3, 3, 0.4)
    sweep(flux, turned, -1, 1, 0.4)
    back = turned.transpose(0, 3, 2, 1)[[0, 3, 2, 1]]
    np.testing.assert_allclose(inside(fields), inside(back), atol=1e-15)


@FLUXES
def test_mass_goes_round_the_angle_and_is_kept(flux: Any) -> None:
    """A block that turns at speed 0.8 from angle 0 on, 15 steps at CFL 0.8 go once round.

    Limited slopes at the block's ends cost its mean place up to 0.05 cells.
    """
    fields = np.zeros((4, *GRID.padded))
    inside(fields)[Q, :2] = 1.0
    inside(fields)[3] = 0.8 * inside(fields)[Q]
    before = inside(fields)[Q].sum()
    extents = occupied_extents(fields)
    ratio = 1.0 if isinstance(flux, Ballistic) else 0.2
    for _ in range(15):
        extents = transport(flux, fields, -3, ratio, extents, ghosts_of(fields, Remove()), 0.0)
    assert inside(fields)[Q].sum() == pytest.approx(before, rel=1e-13)
    if isinstance(flux, Ballistic):
        from_start = (np.arange(12) - 0.5 + 6.0) % 12 - 6.0
        mean = (inside(fields)[Q].sum(axis=(1, 2)) * from_start).sum() / before
        assert mean == pytest.approx(0.0, abs=0.05)


def test_too_few_angles_are_refused() -> None:
    with pytest.raises(InputError, match="at least 3 angle cells"):
        check_angles("a scene", 2)

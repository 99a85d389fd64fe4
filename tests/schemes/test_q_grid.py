"""The (angle, y, x) grid: start angles, the window that holds mass, transport within it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.schemes.boundary import fill_ghosts, fill_periodic
from ellipsoid_coupling.schemes.fluxes import Ballistic, Force
from ellipsoid_coupling.schemes.grid import Grid
from ellipsoid_coupling.schemes.q_grid import (
    NORMAL,
    Q,
    QGrid,
    Window,
    check_angles,
    grown,
    inside,
    occupied_window,
    runs,
    start_angles,
)
from ellipsoid_coupling.schemes.q_transport import transport
from ellipsoid_coupling.schemes.sweeps import sweep

Floats = NDArray[np.float64]

GRID = QGrid(Grid(0.0, 0.0, 0.1, 9, 7), 12)
FLUXES = pytest.mark.parametrize("flux", [Ballistic(), Force(0.0), Force(1.0)])
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


def test_the_window_is_what_holds_mass() -> None:
    window = occupied_window(some_fields([0, 1, 11]))
    assert window.planes.tolist() == [0, 1, 11]
    assert window.extent.tolist() == [2, 5, 0, 4]
    assert occupied_window(np.zeros((4, *GRID.padded))).planes.size == 0


def test_the_window_grows_periodically_in_angle_and_ends_in_space() -> None:
    window = Window(np.array([0, 1, 11]), np.array([2, 7, 0, 4]))
    assert grown(window, GRID.shape, -3).planes.tolist() == [0, 1, 2, 10, 11]
    assert grown(window, GRID.shape, -2).extent.tolist() == [1, 7, 0, 4]
    assert grown(window, GRID.shape, -1).extent.tolist() == [2, 7, 0, 5]
    assert runs(np.array([0, 1, 2, 10, 11])) == [(0, 3), (10, 2)]
    assert runs(np.array([], dtype=np.int64)) == []


@FLUXES
@AXES
def test_transport_in_the_window_is_the_whole_sweep(flux: Any, axis: int) -> None:
    """Bit for bit, over three steps, with mass on both sides of angle 0."""
    fields = some_fields([0, 1, 11])
    whole = fields.copy()
    window = occupied_window(fields)
    for _ in range(3):
        window = transport(flux, fields, axis, 0.4, window, False)
        if axis == -3:
            fill_periodic(whole, 1)
        else:
            fill_ghosts(whole, axis + 4, False, NORMAL[axis])
        sweep(flux, whole, axis, NORMAL[axis], 0.4)
        np.testing.assert_array_equal(inside(fields), inside(whole))


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
    window = occupied_window(fields)
    ratio = 1.0 if isinstance(flux, Ballistic) else 0.2
    for _ in range(15):
        window = transport(flux, fields, -3, ratio, window, False)
    assert inside(fields)[Q].sum() == pytest.approx(before, rel=1e-13)
    if isinstance(flux, Ballistic):
        from_start = (np.arange(12) - 0.5 + 6.0) % 12 - 6.0
        mean = (inside(fields)[Q].sum(axis=(1, 2)) * from_start).sum() / before
        assert mean == pytest.approx(0.0, abs=0.05)


def test_too_few_angles_are_refused() -> None:
    with pytest.raises(InputError, match="at least 3 angle cells"):
        check_angles("a scene", 2)

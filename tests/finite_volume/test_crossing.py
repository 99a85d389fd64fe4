"""The crossing of characteristics, detected from velocities on a grid."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.crossing import CrossingDetector, largest_compression
from ellipsoid_coupling.finite_volume.grid import interior

Floats = NDArray[np.float64]

H = 0.1


def collapsing(now: float, axis: int, damped: bool = False) -> Floats:
    """A strip of half-width 1 that moves with v = -x/(1 - t), or v = -x if damped."""
    x = H * (np.arange(24) - 11.5)
    width = math.exp(-now) if damped else max(1.0 - now, H)
    fields = np.zeros((3, 28, 28))
    lines = interior(fields) if axis == -1 else interior(fields).swapaxes(1, 2)
    lines[0] = np.where(np.abs(x) < width, 1.0 / width, 0.0)
    lines[-axis] = lines[0] * -x * (1.0 if damped else 1.0 / max(1.0 - now, H))
    return fields


@pytest.mark.parametrize("axis", [-1, -2])
def test_compression_of_a_linear_velocity_is_its_slope(axis: int) -> None:
    """Exact to rounding; the ghosts and thin cells do not count, whatever they hold."""
    fields = collapsing(0.0, axis)
    assert largest_compression(fields, H) == pytest.approx(1.0, rel=1e-12)
    fields[:, :2], fields[:, :, -2:] = 7.0, -7.0
    interior(fields)[0, 0, 0] = 1e-6
    interior(fields)[1, 0, 0] = 1.0
    assert largest_compression(fields, H) == pytest.approx(1.0, rel=1e-12)
    ghost, empty = np.full_like(fields, 7.0), np.zeros_like(fields)
    stacked = np.stack([ghost, ghost, empty, fields, ghost, ghost], axis=1)
    assert largest_compression(stacked, H) == pytest.approx(1.0, rel=1e-12)
    extents = np.zeros((2, 24, 2), np.int64)
    extents[1] = 0, 24
    assert largest_compression(stacked, H, extents) == pytest.approx(1.0, rel=1e-12)
    assert largest_compression(stacked, H, extents[::-1].copy()) == 0.0
    # Columns that hold no mass need not be looked at.
    held = interior(fields)[0] > 0.0
    extents[1, :, 0], extents[1, :, 1] = held.argmax(axis=1), 24 - held[:, ::-1].argmax(axis=1)
    extents[1, ~held.any(axis=1)] = 24, 0
    assert largest_compression(stacked, H, extents) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("axis", [-1, -2])
def test_the_largest_jump_is_found_wherever_it_is(axis: int) -> None:
    """One jump of 5 among others up to 1, at the ends of rows and of the pieces they are gone through."""
    rng = np.random.default_rng(1)
    density, speed = 1.0 + rng.random((5, 230)), 0.5 * rng.random((2, 5, 230))
    for column in (0, 103, 104, 207, 208, 228):
        v = speed.copy()
        here, beside = (2, column), (2, column + 1) if axis == -1 else (3, column)
        v[-1 - axis][here], v[-1 - axis][beside] = 5.0, 0.0
        fields = np.zeros((3, 9, 234))
        interior(fields)[0], interior(fields)[1:] = density, density * v
        assert largest_compression(fields, H) == pytest.approx(5.0 / H, rel=1e-12)


def test_expansion_and_vacuum_are_no_compression() -> None:
    fields = collapsing(0.0, -1)
    fields[1] *= -1.0
    assert largest_compression(fields, H) == 0.0
    assert largest_compression(np.zeros_like(fields), H) == 0.0


@pytest.mark.parametrize("axis", [-1, -2])
def test_free_flight_to_a_line_crosses_at_its_time(axis: int) -> None:
    """At t = 1, up to the time H in which the last cells meet at speed 1."""
    detector = CrossingDetector(0.0)
    for now in np.arange(0.0, 1.2, 0.05):
        detector.look(collapsing(now, axis), H, now)
    assert detector.time == pytest.approx(1.0, abs=1.01 * H)


def test_a_damped_collapse_never_crosses() -> None:
    """Under damping 2, v = -x stays so: the strip thins out exponentially, without crossing."""
    detector = CrossingDetector(2.0)
    for now in np.arange(0.0, 5.0, 0.1):
        detector.look(collapsing(now, -1, damped=True), H, now)
    assert math.isnan(detector.time)


def test_a_compression_that_ends_is_no_crossing() -> None:
    detector = CrossingDetector(0.0)
    detector.look(collapsing(0.0, -1), H, 0.0)
    still = collapsing(0.0, -1)
    still[1] *= 0.2
    for now in np.arange(0.5, 3.0, 0.5):
        detector.look(still, H, now)
    assert math.isnan(detector.time)


def test_memory_is_all_that_a_restart_needs() -> None:
    first, second = CrossingDetector(0.0), CrossingDetector(0.0)
    for now in (0.0, 0.5):
        first.look(collapsing(now, -1), H, now)
    second.memory[:] = first.memory
    for detector in (first, second):
        detector.look(collapsing(1.0, -1), H, 1.0)
    assert first.time == second.time

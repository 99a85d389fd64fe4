"""One look over all cells or particles: the numbers that numpy finds."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.finite_volume.diagnostics import survey_cells, survey_particles


@pytest.mark.parametrize("shape", [(1, 3, 7), (5, 3, 300), (3, 2, 41), (40, 3, 2500)])
def test_particles(shape: tuple[int, int, int]) -> None:
    """Few and, shared by threads, many realisations; a hundred coordinates outside the box."""
    rng = np.random.default_rng(2)
    place, velocity, force = rng.standard_normal((3, *shape))
    box = np.array([[-1.0, 1.5], [-0.5, 2.0]])
    v, omega, pull, torque, outside = survey_particles(place, velocity, force, box)
    count = shape[0] * shape[2]
    assert v == pytest.approx(np.sqrt((velocity[:, :2] ** 2).sum() / count), rel=1e-12)
    assert omega == pytest.approx(np.sqrt((velocity[:, 2:] ** 2).sum() / count), rel=1e-12)
    assert pull == np.abs(force[:, :2]).max()
    assert torque == np.abs(force[:, 2:]).max(initial=0.0)
    low, high = box[:, :1], box[:, 1:]
    assert outside == ((place[:, :2] < low) | (place[:, :2] > high)).sum()
    assert survey_particles(place, velocity, force, None)[4] == 0


def test_a_place_that_is_no_number_is_outside() -> None:
    place = np.full((2, 2, 3), 0.5)
    place[1, 0, 2] = np.nan
    box = np.array([[0.0, 1.0], [0.0, 1.0]])
    assert survey_particles(place, np.zeros_like(place), np.zeros_like(place), box)[4] == 1


@pytest.mark.parametrize("shape", [(9, 14), (3, 9, 14)])
def test_cells(shape: tuple[int, ...]) -> None:
    """Ghosts, whatever they hold, are left out, and so is vacuum in the means."""
    rng = np.random.default_rng(3)
    fields = rng.random((4, *(n + 4 for n in shape)))
    inner = fields[(slice(None), *[slice(2, -2)] * len(shape))]
    inner[:, ..., 3] = 0.0
    mass, least, (v, omega) = survey_cells(fields)
    held = inner[:, inner[0] > 0.0]
    assert mass == pytest.approx(inner[0].sum(), rel=1e-13)
    assert least == 0.0
    square = ((held[1] ** 2 + held[2] ** 2) / held[0]).sum() / held[0].sum()
    assert v == pytest.approx(np.sqrt(square), rel=1e-12)
    assert omega == pytest.approx(
        np.sqrt((held[3] ** 2 / held[0]).sum() / held[0].sum()), rel=1e-12
    )

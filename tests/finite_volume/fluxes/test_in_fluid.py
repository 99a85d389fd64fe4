"""Fluxes in a fluid: the plain ones where nothing follows it, and even densities where all does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.finite_volume.fluxes.ballistic import Ballistic, ballistic_outflow
from ellipsoid_coupling.finite_volume.fluxes.contract import Stencil
from ellipsoid_coupling.finite_volume.fluxes.force import Force, force_flux
from ellipsoid_coupling.finite_volume.fluxes.in_fluid import (
    BallisticInFluid,
    FluidMotion,
    ForceInFluid,
    ballistic_outflow_in_fluid,
    force_flux_in_fluid,
)

RATIO, BENDS = 0.4, (0.01, 0.01, 0.01, 0.01)


def stencil(cells: np.ndarray, cell: int = 2) -> Stencil:
    """Of three cells (3, K) side by side."""
    below, here, above = (tuple(map(float, one)) for one in cells)
    inverse = tuple(1.0 / one[0] for one in (below, here, above))
    return Stencil(below, here, above, inverse, cell, 1)  # type: ignore[arg-type]


def motion(seed: int, follows: float, second: float) -> FluidMotion:
    faces = np.random.default_rng(seed).uniform(-1.0, 1.0, 6)
    return FluidMotion(faces[:-1].copy(), faces[1:].copy(), follows, second)


@pytest.mark.parametrize("seed", range(5))
def test_where_nothing_follows_the_fluid_both_are_the_plain_fluxes(seed: int) -> None:
    """To rounding."""
    rng = np.random.default_rng(seed)
    cells = rng.uniform(0.5, 1.5, (3, 4)) * np.array([1.0, 0.8, 0.5, 0.3])
    fluid = motion(seed, 0.0, 1.0)
    moved: Any = plain(ballistic_outflow_in_fluid)(
        BallisticInFluid(BENDS, fluid), stencil(cells), RATIO
    )
    expected: Any = plain(ballistic_outflow)(Ballistic(BENDS), stencil(cells), RATIO)
    np.testing.assert_allclose(np.array(moved), np.array(expected), rtol=1e-13, atol=1e-15)
    force = plain(force_flux_in_fluid)(ForceInFluid(0.0, fluid), stencil(cells), RATIO)
    np.testing.assert_allclose(
        force, plain(force_flux)(Force(0.0), stencil(cells), RATIO), rtol=1e-13
    )


@pytest.mark.parametrize("second", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_particles_of_the_fluid_cross_a_face_with_it(seed: int, second: float) -> None:
    """Density J, the fluid's own velocities: what goes through a face is c U, whatever the slopes of J."""
    fluid = motion(seed, 1.0, second)
    cells = np.zeros((3, 4))
    for k in range(3):
        lower, upper = fluid.lower[1 + k], fluid.upper[1 + k]
        density = 1.0 + second * RATIO * (upper - lower)
        cells[k] = density * np.array([1.0, 0.5 * (lower + upper), 0.3, 0.2])
    up, down = plain(ballistic_outflow_in_fluid)(
        BallisticInFluid(BENDS, fluid), stencil(cells), RATIO
    )
    lower, upper = fluid.lower[2], fluid.upper[2]
    assert up[0] == pytest.approx(max(RATIO * upper, 0.0), abs=1e-14)
    assert down[0] == pytest.approx(max(-RATIO * lower, 0.0), abs=1e-14)
    face = plain(force_flux_in_fluid)(ForceInFluid(0.0, fluid), stencil(cells), RATIO)
    assert face[0] == pytest.approx(RATIO * lower, abs=1e-14)

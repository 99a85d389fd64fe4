"""Steppers as such: one family for both kinds of grids, further components, fluxes from outside."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.boundary import grid_ghosts
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.fluxes import flux_named
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.finite_volume.q_grid import QGrid, RGrid
from ellipsoid_coupling.finite_volume.splitting import Godunov, KickDriftKick, Stepper
from ellipsoid_coupling.finite_volume.system import Source, System, q_system, rho_system
from ellipsoid_coupling.geometry.boundaries import Remove, everywhere

Floats = NDArray[np.float64]

PLANE = Grid(-1.0, -0.5, 0.05, 40, 20)
BOTH = pytest.mark.parametrize("stepper", [Godunov, KickDriftKick])


def no_forces(_cells: CellFields) -> None:
    """Of no interaction and no walls."""


def some_cells(grid: QGrid, system: System) -> CellFields:
    """All cells hold mass, which moves at random, in a steady force, damped."""
    rng = np.random.default_rng(3)
    steady = rng.standard_normal((2, *PLANE.shape))
    terms = CellTerms(steady, None, None, 0.7, 0.0, 1.0, 1.0)
    cells = CellFields(
        system, grid, terms, grid_ghosts(PLANE, everywhere(Remove())), 0.9, no_forces
    )
    inner = cells.inside
    inner[0] = 1.0 + rng.random(inner[0].shape)
    inner[1:] = 0.3 * inner[0] * rng.standard_normal(inner[1:].shape)
    cells.look_for_mass()
    return cells


def stepped(stepper: type[Stepper], cells: CellFields, steps: int = 3) -> list[float]:
    """Take the longest steps that are allowed; returns these."""
    one = stepper(cells, flux_named(stepper.flux, 0.0, stepper.balances, "here"))
    one.start()
    taken = []
    for count in range(steps):
        taken.append(0.5 * one.largest_step[0])
        one.step(taken[-1], count)
    return taken


@BOTH
def test_a_plane_of_the_angle_is_an_r_grid(stepper: type[Stepper]) -> None:
    """Bit for bit, where nothing turns: one system, one stepper, two layouts of the same numbers."""
    system = rho_system(turns=False)
    assert system == q_system(turns=False, resolved=False, pressure=0.0)
    plane, angles = (some_cells(grid, system) for grid in (RGrid(PLANE), QGrid(PLANE, 1)))
    for cells in (plane, angles):
        one = stepper(cells, flux_named(stepper.flux, 0.0, stepper.balances, "here"))
        one.start()
        for count in range(4):
            assert one.step(0.02, count)
    assert np.array_equal(plane.inside, angles.inside)
    assert plane.outflow[0] == pytest.approx(angles.outflow[0], rel=1e-14)


def cooling(rate: float) -> Source:
    """The exact solution of T' = -rate T."""

    def cool(cells: CellFields, dt: float) -> None:
        cells.fields[cells.system.components.index("temperature")] *= np.exp(-rate * dt)

    return cool


@BOTH
@pytest.mark.parametrize("grid", [RGrid(PLANE), QGrid(PLANE, 1)], ids=["rho", "q"])
def test_a_further_component_is_carried_and_has_its_own_source(
    grid: QGrid, stepper: type[Stepper]
) -> None:
    """An even temperature stays even wherever mass goes, and cools at its rate: to rounding."""
    base = rho_system(turns=False)
    system = base._replace(components=(*base.components, "temperature"), source=cooling(2.0))
    cells = some_cells(grid, system)
    cells.inside[3] = 5.0 * cells.inside[0]
    taken = stepped(stepper, cells)
    expected = 5.0 * np.exp(-2.0 * sum(taken))
    np.testing.assert_allclose(cells.inside[3] / cells.inside[0], expected, rtol=1e-13)

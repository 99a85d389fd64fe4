"""The measurement of stairs and cut cells at tiny size: its exact solutions, its grids, what they keep."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.workflows.test_workflows import WORKFLOWS, workflow

FLOWS = pytest.mark.parametrize("name", ["Ring", "Cylinder"])


@pytest.fixture(autouse=True)
def cut_cells(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Workflows import one another by name."""
    monkeypatch.syspath_prepend(str(WORKFLOWS))
    return workflow("cut_cells")


@FLOWS
def test_characteristics_follow_the_flow(cut_cells: ModuleType, name: str) -> None:
    """Psi stays along them to the accuracy of steps of 0.02, order 4; they begin with u from psi.

    Central differences over 1e-5: 1e-9 is a part 1e-4 of the way, for curvature and rounding.
    """
    flow, tiny = getattr(cut_cells, name)(), 1e-5
    angle, r = np.linspace(0.1, 6.0, 20), np.linspace(1.1, 1.9, 20)
    points = r * np.stack((np.cos(angle), np.sin(angle)))
    np.testing.assert_allclose(flow.psi(flow.origin(points, 1.0)), flow.psi(points), atol=1e-7)
    x, y = (np.array(way)[:, None] for way in ([tiny, 0.0], [0.0, tiny]))
    along_x = flow.psi(points + y) - flow.psi(points - y)
    along_y = flow.psi(points - x) - flow.psi(points + x)
    moved = flow.origin(points, -tiny) - flow.origin(points, tiny)
    np.testing.assert_allclose(moved, np.stack((along_x, along_y)), atol=1e-9)


@FLOWS
@pytest.mark.parametrize("cells", [20, 40, 80])
def test_cut_areas_are_those_of_the_fluid_but_for_arcs(
    cut_cells: ModuleType, name: str, cells: int
) -> None:
    """A chord s cuts s^3/(12 R) off a circle to leading order, and none is longer than sqrt(2) h."""
    flow = getattr(cut_cells, name)()
    exact = {"Ring": 3.0 * math.pi, "Cylinder": 16.0 - 0.25 * math.pi}[name]
    grid = cut_cells.cut_grid(flow, cells)
    assert abs(grid.area.sum() - exact) < math.pi / 3.0 * grid.width**2


@FLOWS
@pytest.mark.parametrize("grid", ["stairs", "areas", "cut"])
@pytest.mark.parametrize("order", [1, 2])
def test_an_even_density_stays_even_and_mass_is_kept(
    cut_cells: ModuleType, name: str, grid: str, order: int
) -> None:
    """To rounding, of 20 steps; mass in the ring, which nothing leaves."""
    cells = cut_cells.GRIDS[grid](getattr(cut_cells, name)(), 20)
    even = cut_cells.Transport(cells, order, carried=1.0)
    uneven = cut_cells.Transport(cells, order)
    density, held = 1.0 * cells.fluid, cells.fluid * np.exp(cells.centre[0])
    mass = (held * cells.area).sum()
    for _ in range(20):
        density = even.step(density, even.largest_step)
        held = uneven.step(held, even.largest_step)
    np.testing.assert_allclose(density[cells.fluid], 1.0, rtol=1e-12)
    assert not held[~cells.fluid].any()
    if name == "Ring":
        assert (held * cells.area).sum() == pytest.approx(mass, rel=1e-13)


def test_the_table_has_the_grids_side_by_side(
    cut_cells: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four starts, two times, two orders; the second order is nearer to the exact solution."""
    assert cut_cells.main(["--cells", "20", "--fine", "40", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + 4 * 2 * 2
    assert all(line.count(" / ") == 2 * 4 for line in lines[2:])
    with (tmp_path / "cut_cells.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    errors = {tuple(row.values())[:5]: float(row["l1"]) for row in rows}
    assert len(errors) == 3 * 4 * 2 * 2
    for flow, start, t, order, grid in errors:
        if order == "1":
            assert errors[flow, start, t, "2", grid] < errors[flow, start, t, "1", grid]

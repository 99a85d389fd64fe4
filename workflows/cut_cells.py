"""Stairs against cut cells: the errors of a density that known flows carry along curved walls.

    .venv/bin/python workflows/cut_cells.py [--cells 20 40 80 160] [--fine 640] [--out DIR]

Tracers: d rho/dt + div(rho u) = 0, u from psi, exact along characteristics. All grids have the same width,
steps and scheme off the walls: upwind and Euler's step (order 1), or the package's limited slopes and
Heun's step (order 2). Psi at the corners tells what flows through faces, so an even density stays even.

    stairs   a cell is whole or none, by its centre; psi at corners of stairs is that of the wall
    areas    the same cells and faces; a cell has the area of the fluid in it and in solid cells beside it
    cut      a cell is what the walls leave of it; small ones by state redistribution (M. Berger and
             A. Giuliani, J. Comput. Phys. 428, 2021)

In the latter two, slopes beside walls are those of planes fitted to the cells around (order 2).

L1 distances are parts of the mass (2 is no overlap): cell by cell, its share of cells nearer to a wall than
two cells, and of masses in 20 x 20 bins, as everywhere in the package. `largest` is that of a cell, as a
part of the largest exact density. The table goes to standard output, in Markdown, with --out to a CSV file.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from cut_cells_flows import Cylinder, Floats, Flow, Ring
from cut_cells_grids import Cells, areas_grid, cut_grid, stairs_grid
from cut_cells_scheme import Transport

from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.progress import ProgressReporter

BINS = 20
GRIDS: dict[str, Callable[[Flow, int], Cells]] = {
    "stairs": stairs_grid,
    "areas": areas_grid,
    "cut": cut_grid,
}


class Exact:
    """The exact density at points of the fluid, fine x fine, which any coarser grid takes means of."""

    def __init__(self, flow: Flow, fine: int) -> None:
        self.flow, self.spacing = flow, 2.0 * flow.half / fine
        at = (np.arange(fine) + 0.5) * self.spacing - flow.half
        self._points = np.stack(np.meshgrid(at, at))
        self._fluid = flow.level(self._points) > 0.0
        self._origins = {t: flow.origin(self._points, t) for t in (0.0, *flow.times)}

    def density(self, start: str, t: float) -> Floats:
        """(fine, fine), 0 in solids."""
        return self.flow.starts[start](self._origins[t]) * self._fluid

    def means(self, density: Floats, number: int) -> Floats:
        """Of the fluid in cells, (number, number); NaN where none of the points lies in it."""
        held, count = blocks(density, number), blocks(np.where(self._fluid, 1.0, 0.0), number)
        return np.where(count > 0.0, held / np.where(count > 0.0, count, 1.0), np.nan)


def blocks(values: Floats, number: int) -> Floats:
    """Sums over number x number blocks."""
    each = values.shape[0] // number
    return np.asarray(values.reshape(number, each, number, each).sum(axis=(1, 3)))


class Row(NamedTuple):
    """What one grid comes to at one time; see the module. L1, `near` and `bins` are parts of the mass."""

    flow: str
    start: str
    time: float
    order: int
    grid: str
    cells: int
    l1: float
    near: float
    largest: float
    bins: float
    cpu: float


def marched(
    transport: Transport, density: Floats, times: Sequence[float], dt: float
) -> Iterator[Floats]:
    """The densities at the times, by steps of at most dt."""
    before = 0.0
    for t in times:
        count = math.ceil((t - before) / dt)
        for _ in range(count):
            density = transport.step(density, (t - before) / count)
        before = t
        yield density


def measured(exact: Exact, start: str, order: int, grid: str, number: int) -> Iterator[Row]:
    """The rows of one start on one grid."""
    flow = exact.flow
    cells = GRIDS[grid](flow, number)
    truth = exact.density(start, 0.0)
    mass = float(truth.sum()) * exact.spacing**2
    means = exact.means(truth, number)
    density = np.where(np.isnan(means), flow.starts[start](cells.centre), means)
    density = density * cells.fluid
    density = density * (mass / float((density * cells.area).sum()))
    near = flow.level(cells.centre) < 2.0 * cells.width
    # All grids take the same steps.
    dt = Transport(stairs_grid(flow, number), order).largest_step
    began = time.process_time()
    for t, found in zip(
        flow.times, marched(Transport(cells, order), density, flow.times, dt), strict=True
    ):
        cpu = time.process_time() - began
        truth = exact.density(start, t)
        means = exact.means(truth, number)
        off = np.where(np.isnan(means) | ~cells.fluid, 0.0, np.abs(found - means))
        lost = off * cells.area / mass
        binned = blocks(found * cells.area, BINS) - blocks(truth, BINS) * exact.spacing**2
        yield Row(
            flow.name, start, t, order, grid, number, float(lost.sum()), float(lost[near].sum()),
            float(off.max() / np.nanmax(means)), float(np.abs(binned).sum() / mass), cpu,
        )  # fmt: skip


def all_rows(numbers: Sequence[int], fine: int, report: Callable[[str, float], None]) -> list[Row]:
    """All flows, starts, orders and grids."""
    rows: list[Row] = []
    flows: tuple[Flow, ...] = Ring(), Cylinder()
    for flow in flows:
        report(f"{flow.name}, characteristics", 0.0)
        exact = Exact(flow, fine)
        chosen = list(product(flow.starts, (1, 2), GRIDS, numbers))
        for done, (start, order, grid, number) in enumerate(chosen):
            report(f"{flow.name}, {start}, order {order}, {grid}", done / len(chosen))
            rows += measured(exact, start, order, grid, number)
    return rows


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of Markdown, the grids beside one another: stairs / areas / cut."""
    yield "| flow, start | t | order | cells | L1 | near walls | largest | bins |"
    yield "|" + "---|" * 8
    by_grid = [[row for row in rows if row.grid == grid] for grid in GRIDS]
    for same in zip(*by_grid, strict=True):
        one = same[0]
        yield (
            f"| {one.flow}, {one.start} | {one.time:.3g} | {one.order} | {one.cells} | "
            + " | ".join(
                " / ".join(f"{x:.2g}" for x in each) for each in list(zip(*same, strict=True))[6:10]
            )
            + " |"
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 0."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cells", type=int, nargs="+", default=[20, 40, 80, 160])
    parser.add_argument("--fine", type=int, default=640, help="a multiple of all of them")
    parser.add_argument("--out", type=Path, help="folder of cut_cells.csv")
    options = parser.parse_args(arguments)
    with ProgressReporter("cut cells") as report:
        rows = all_rows(options.cells, options.fine, report)
    print("\n".join(table(rows)))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        with (
            whole_file(options.out / "cut_cells.csv") as beside,
            beside.open("w", newline="", encoding="utf-8") as file,
        ):
            csv.writer(file).writerows([Row._fields, *rows])
    return 0


if __name__ == "__main__":
    run_in_words(main)

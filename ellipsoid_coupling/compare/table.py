"""errors.csv: every row of a comparison at every saved time, its error parts beside it."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import Parts
from ellipsoid_coupling.compare.frontier import Frontier, FrontierRow
from ellipsoid_coupling.files.writing import whole_file

PARTS = (
    "discretisation",
    "closure",
    "finite_n",
    "sampling",
    "discretisation_spread",
    "offset_spread",
)
COLUMNS = (
    "scene",
    "model",
    "scheme",
    "resolution",
    "time",
    "density_error",
    "angle_error",
    *(f"{part}_{kind}" for part in PARTS for kind in ("density", "angle")),
    "sampling_error_density",
    "sampling_error_angle",
    "reference",
    "wall_seconds",
    "best_seconds",
    "median_seconds",
    "repeats",
    "status",
)


def write_table(frontiers: Sequence[Frontier], folder: Path) -> Path:
    """errors.csv: one line per row and saved time; a part that does not exist is empty.

    sampling_error_* are the reference's own, wall_seconds equals best_seconds.
    """
    path = folder / "errors.csv"
    with whole_file(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for frontier in frontiers:
            for row in frontier.rows:
                writer.writerows(_lines(frontier, row))
    return path


def part_of(parts: Parts | None, name: str) -> Errors | None:
    """The part of that name of `PARTS`."""
    if parts is None:
        return None
    known = dict(
        zip(
            PARTS,
            (
                parts.discretisation,
                parts.closure,
                parts.finite_n,
                parts.sampling,
                parts.discretisation_spread,
                parts.offset_spread,
            ),
            strict=True,
        )
    )
    return known[name]


def _lines(frontier: Frontier, row: FrontierRow) -> list[list[str]]:
    lines = []
    for i, time in enumerate(frontier.reference.times):
        split: list[str] = []
        for name in PARTS:
            part = part_of(row.parts, name)
            split += (
                ["", ""] if part is None else [f"{part.density[i]:.6g}", f"{part.angle[i]:.6g}"]
            )
        numbers = (float(frontier.sampling.density[i]), float(frontier.sampling.angle[i]))
        seconds = f"{row.wall_seconds:.6g}"
        lines.append(
            [row.scene, row.model, row.scheme, row.resolution, f"{time:g}"]
            + [f"{row.density_errors[i]:.6g}", f"{row.angle_errors[i]:.6g}", *split]
            + [f"{number:.6g}" for number in numbers]
            + [frontier.reference_name, seconds, seconds, f"{row.median_seconds:.6g}"]
            + [str(row.repeats), row.status]
        )
    return lines

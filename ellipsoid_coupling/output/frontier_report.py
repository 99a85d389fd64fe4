"""Error against run time as a printed table, a CSV and a text file, and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ellipsoid_coupling.compare.cheapest import KINDS, TARGETS, Choice, Kind, choose, largest_error
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import UNRESOLVED
from ellipsoid_coupling.compare.frontier import Frontier, FrontierRow
from ellipsoid_coupling.compare.table import part_of, write_table
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.models import find_kind
from ellipsoid_coupling.output.figures import (
    UNRESOLVED_CLOSURE,
    PartBars,
    draw_frontier,
    draw_parts,
)
from ellipsoid_coupling.output.labels import model_name
from ellipsoid_coupling.output.tables import print_table, table_text

# Parts in words, and their names in `compare.table`.
_PARTS = {
    "discretisation": "discretisation",
    "closure": "closure",
    "finite N": "finite_n",
    "sampling": "sampling",
}
_RESOLVED = 3.0
# In standard errors of eight folds. For equal ensembles the largest over four times exceeds three in 16 of
# 280 comparisons, and four in one.
_OUT_OF_NOISE = 4.0
CHOICE_COLUMNS = ("error of", "at most", "cheapest", "scheme", "resolution", "seconds", "error")
_WARNINGS = "Warnings of these runs"
_WARNING_COLUMNS = ("model", "scheme", "resolution", "")
_ROW_COLUMNS = ("model", "scheme", "resolution", "density L1", "angle L1", "best s", "median s")
_LEGEND = """\
Errors are L1 distances (2 is no overlap at all) on 20 x 20 density bins and 60 angle bins; the largest
over the saved times. Parts: discretisation, against the same model refined; closure, the refined model
against the reference; finite N, likewise for microscopic; sampling, expected from the spread over
realisations. total <= sum of the parts. +- is the uncertainty of the refined grid solution (how far its
finest levels still move), or a standard error; above {unresolved:g} the refined solution means little. A
closure with a question mark is less than three times it: that much may be discretisation still. A finite
N with a question mark is less than four times its standard error: it may be 0, because the largest of
several noisy zeros is above 0.
"""


def report_frontiers(frontiers: Sequence[Frontier], folder: Path) -> None:
    """Write errors.csv, errors.txt and the figures of each scene into `folder`, and print the tables."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(frontiers, folder)
    with whole_file(folder / "errors.txt") as file:
        file.write_text("\n\n".join(map(frontier_text, frontiers)), encoding="utf-8")
    for frontier in frontiers:
        _draw(frontier, folder)
        _print_frontier(frontier)


def _against(frontier: Frontier) -> str:
    name = frontier.reference_name
    if name == "exact":
        return "exact solution"
    kind = find_kind(name)
    return name if kind is None else f"refined {kind.label} limit"


def _draw(frontier: Frontier, folder: Path) -> None:
    scene = frontier.reference.scene
    done = [row for row in frontier.rows if row.status == "completed"]
    if done:
        sampling = frontier.sampling
        draw_frontier(
            done,
            folder / f"error_against_run_time_{scene.name}.png",
            noise=(float(sampling.density.max()), float(sampling.angle.max())),
            title=f"{scene.title}: largest L1 error against the {_against(frontier)}",
        )
    groups = part_bars(frontier)
    if groups:
        path = folder / f"error_parts_{scene.name}.png"
        draw_parts(groups, path, title=f"{scene.title}: what the error is made of, finest runs")


def _largest(errors: Errors, kind: Kind) -> float:
    return float(np.max(errors.density if kind == "density" else errors.angle))


def part_bars(frontier: Frontier) -> list[PartBars]:
    """The finest run of each model and scheme that has parts."""
    finest = {
        (row.model, row.scheme): row
        for row in frontier.rows
        if row.status == "completed" and row.parts
    }
    return [
        PartBars(
            f"{model_name(model)}\n{scheme}",
            _part_numbers(row, "density"),
            _part_numbers(row, "angle"),
        )
        for (model, scheme), row in finest.items()
    ]


def is_resolved(row: FrontierRow, kind: Kind) -> bool:
    """Whether the closure part is larger than three times the refined solution's uncertainty."""
    closure = part_of(row.parts, "closure")
    spread = part_of(row.parts, "discretisation_spread")
    if closure is None:
        return True
    return spread is not None and _largest(closure, kind) > _RESOLVED * _largest(spread, kind)


def exceeds_noise(row: FrontierRow, kind: Kind) -> bool:
    """Whether the finite-N part is larger than four times its own standard error, or has none."""
    found, spread = part_of(row.parts, "finite_n"), part_of(row.parts, "offset_spread")
    if found is None or spread is None:
        return True
    return _largest(found, kind) > _OUT_OF_NOISE * _largest(spread, kind)


def _part_numbers(row: FrontierRow, kind: Kind) -> dict[str, float]:
    numbers = {"total": largest_error(row, kind)}
    for words, name in _PARTS.items():
        part = part_of(row.parts, name)
        if part is not None:
            known = name != "closure" or is_resolved(row, kind)
            numbers[words if known else UNRESOLVED_CLOSURE] = _largest(part, kind)
    return numbers


def choice_rows(frontier: Frontier) -> list[tuple[str, ...]]:
    """The cheapest run below each target, for density and angle; `CHOICE_COLUMNS`."""
    return [_choice_row(choice) for kind in KINDS for choice in choose(frontier.rows, kind)]


def _choice_row(choice: Choice[FrontierRow]) -> tuple[str, ...]:
    target = f"{choice.target:.0%}"
    if choice.row is not None:
        row, name = choice.row, model_name(choice.row.model)
    elif choice.best is not None:
        row, name = choice.best, f"none; best: {model_name(choice.best.model)}"
    else:
        return (choice.kind, target, "none", "", "", "", "")
    error = f"{largest_error(row, choice.kind):.4f}"
    seconds = f"{row.wall_seconds:.3g}"
    return (choice.kind, target, name, row.scheme, row.resolution, seconds, error)


def frontier_text(frontier: Frontier) -> str:
    """The tables of a scene as plain text: which run to choose, and all runs with their parts."""
    scene = frontier.reference.scene
    times = ", ".join(f"{time:g}" for time in frontier.reference.times)
    pieces = [f"{scene.name}: {scene.title}, against the {_against(frontier)} at t = {times}\n"]
    pieces += [_LEGEND.format(unresolved=UNRESOLVED), _reference_text(frontier)]
    if frontier.left_out:
        pieces += [f"{model} is left out: {why}\n" for model, why in frontier.left_out]
    targets = ", ".join(f"{target:.0%}" for target in TARGETS)
    pieces += [f"Cheapest for {targets}\n", table_text(CHOICE_COLUMNS, choice_rows(frontier))]
    for kind in KINDS:
        columns = ("model", "scheme", "resolution", "best s", "median s", "total", *_PARTS, "+-")
        rows = [_part_row(row, kind) for row in frontier.rows]
        pieces += [f"All runs, {kind}\n", table_text(columns, rows)]
    warnings = warning_rows(frontier)
    if warnings:
        pieces += [f"{_WARNINGS}\n", table_text(_WARNING_COLUMNS, warnings)]
    return "\n".join(pieces)


def warning_rows(frontier: Frontier) -> list[tuple[str, ...]]:
    """The warnings of the runs, `_WARNING_COLUMNS`; one row for equal ones of a model and scheme."""
    resolutions: dict[tuple[str, str, str], list[str]] = {}
    for row in frontier.rows:
        for line in row.warnings:
            resolutions.setdefault((row.model, row.scheme, line), []).append(row.resolution)
    return [(*run, "; ".join(levels), line) for (*run, line), levels in resolutions.items()]


def _reference_text(frontier: Frontier) -> str:
    origin = str(frontier.reference.attributes.get("origin", ""))
    text, moved = f"Stored yardstick: {origin}\n", "it may be off by"
    if not origin:
        text, moved = "", "its distance to a coarser one"
    for kind in KINDS:
        own = _largest(frontier.sampling, kind)
        text += f"The reference's own sampling error, {kind}: {own:.4f}"
        if frontier.reference_spread is not None:
            text += f"; {moved}: {_largest(frontier.reference_spread, kind):.4f}"
        text += "\n"
    return text


def _part_row(row: FrontierRow, kind: Kind) -> tuple[str, ...]:
    head = (row.model, row.scheme, row.resolution)
    if row.status != "completed":
        return (*head, "", "", row.status, *("" for _ in _PARTS), "")
    cells = []
    for name in (*_PARTS.values(), "discretisation_spread"):
        part = part_of(row.parts, name)
        known = {"closure": is_resolved, "finite_n": exceeds_noise}.get(name)
        doubt = "?" if known is not None and not known(row, kind) else ""
        cells.append("" if part is None else f"{_largest(part, kind):.4f}{doubt}")
    seconds = (f"{row.wall_seconds:.3g}", f"{row.median_seconds:.3g}")
    return (*head, *seconds, f"{largest_error(row, kind):.4f}", *cells)


def _number(value: float, form: str) -> str:
    """The number, or a dash for the missing numbers of a level that was not run."""
    return "-" if math.isnan(value) else format(value, form)


def _print_frontier(frontier: Frontier) -> None:
    def numbers(values: Sequence[float]) -> str:
        return "  ".join(_number(value, ".3f") for value in values)

    times = ", ".join(f"{time:g}" for time in frontier.reference.times)
    rows = [
        (
            row.model,
            row.scheme,
            row.resolution if row.status == "completed" else f"{row.resolution} {row.status}",
            numbers(row.density_errors),
            numbers(row.angle_errors),
            _number(row.wall_seconds, ".3g"),
            _number(row.median_seconds, ".3g"),
        )
        for row in frontier.rows
    ]
    sampling = frontier.sampling
    if sampling.density.max() > 0.0:
        whose = "of an ensemble" if frontier.exact else "of the reference"
        errors = (numbers(tuple(sampling.density)), numbers(tuple(sampling.angle)))
        rows.append(("sampling error", "", whose, *errors, "", ""))
    against = _against(frontier)
    title = f"{frontier.reference.scene.title}: error against the {against} at t = {times}"
    print_table(title, _ROW_COLUMNS, rows)
    for model, why in frontier.left_out:
        print_table("Left out", ("model", "why"), [(model, why)])
    print_table("Cheapest, by the largest error", CHOICE_COLUMNS, choice_rows(frontier))
    warnings = warning_rows(frontier)
    if warnings:
        print_table(_WARNINGS, _WARNING_COLUMNS, warnings)

"""Error against run time as a printed table, a CSV file and a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.compare.frontier import Frontier, write_table
from ellipsoid_coupling.output.figures import draw_frontier
from ellipsoid_coupling.output.tables import print_table


def report_frontiers(frontiers: Sequence[Frontier], folder: Path) -> None:
    """Write errors.csv and one figure a scene into `folder`, and print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(frontiers, folder)
    for frontier in frontiers:
        scene = frontier.reference.scene
        against = "exact solution" if frontier.exact else "microscopic ensemble"
        draw_frontier(
            [row for row in frontier.rows if row.status == "completed"],
            folder / f"error_against_run_time_{scene.name}.png",
            noise=(float(frontier.sampling.density[-1]), float(frontier.sampling.angle[-1])),
            title=f"{scene.title}: L1 error against the {against}",
        )
        _print_frontier(frontier, against)


def _print_frontier(frontier: Frontier, against: str) -> None:
    def numbers(values: Sequence[float]) -> str:
        return "  ".join(f"{value:.3f}" for value in values)

    times = ", ".join(f"{time:g}" for time in frontier.reference.times)
    columns = ("model", "scheme", "resolution", "density L1", "angle L1", "wall s")
    rows = [
        (
            row.model,
            row.scheme,
            row.resolution if row.status == "completed" else row.status,
            numbers(row.density_errors),
            numbers(row.angle_errors),
            f"{row.wall_seconds:.2f}",
        )
        for row in frontier.rows
    ]
    sampling = frontier.sampling
    rows.append(
        (
            "sampling error",
            "",
            "of an ensemble",
            numbers(tuple(sampling.density)),
            numbers(tuple(sampling.angle)),
            "",
        )
    )
    title = f"{frontier.reference.scene.title}: error against the {against} at t = {times}"
    print_table(title, columns, rows)

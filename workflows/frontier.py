"""Error against run time on the paper's scenes: which model to choose for which error.

    .venv/bin/python workflows/frontier.py [--quick] [--scenes NAME ...] [--longest S] [--out DIR]

Runs every model that fits each scene with both schemes from coarse to fine, holds them against the
exact solution or the refined McKean-Vlasov limit, and leaves tables, pictures and frontier.md (the
cheapest run for errors of 10 %, 3 % and 1 %) in one folder. `--quick` takes tiny ensembles and a
second a run.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ellipsoid_coupling import load_scene
from ellipsoid_coupling.compare import Frontier, run_frontier
from ellipsoid_coupling.compare.frontier import LONGEST
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.frontier_report import CHOICE_COLUMNS, choice_rows, report_frontiers
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.simulation import scene_flow

# The paper's.
PAPERS = ["cavity", "cavity_free", "rotation", "stationary", "top_bottom"]
QUICK: dict[str, Any] = {
    "particles.number": 100,
    "particles.realisations": 8,
    "numerics.harmonics_tolerance": 0.2,
}
# Large particles and wide cells are less work, and so are short times.
LARGE = {"particles.length": 0.3, "particles.width": 0.15, "numerics.cell": 0.1}
QUICK_SCENES: dict[str, dict[str, Any]] = {
    "stationary": {"times": [0.5]},
    "top_bottom": LARGE | {"times": [0.5]},
    "rotation": LARGE | {"times": [0.5]},
    "cavity": {"particles.length": 0.1, "particles.width": 0.05},
}
QUICK_LONGEST = 1.0


def main(arguments: Sequence[str] | None = None) -> Path:
    """Compare the scenes; returns the folder with the results."""
    parser = argparse.ArgumentParser(description="error against run time of all models")
    parser.add_argument("--quick", action="store_true", help="tiny ensembles, a second a run")
    parser.add_argument("--scenes", nargs="+", default=PAPERS, metavar="NAME")
    parser.add_argument("--longest", type=float, help="seconds that one run may take")
    parser.add_argument("--out", type=Path, help="folder of the results")
    options = parser.parse_args(arguments)
    longest = options.longest or (QUICK_LONGEST if options.quick else LONGEST)
    folder = options.out or Path("results") / time.strftime("frontier-%Y%m%d-%H%M%S")
    folder.mkdir(parents=True, exist_ok=True)
    frontiers: list[Frontier] = []
    with ProgressReporter() as report:
        for name in options.scenes:
            scene = load_scene(name, quick_settings(name) if options.quick else {})
            flow = scene_flow(scene, None, report)
            frontiers.append(run_frontier(scene, flow, longest=longest, report=report))
            # After each scene, so that its results survive an interruption.
            write_choices(frontiers, folder)
    report_frontiers(frontiers, folder)
    sys.stdout.write(f"{folder}\n")
    return folder


def quick_settings(name: str) -> dict[str, Any]:
    """Tiny ensembles, and the other settings that make the scene quick."""
    return QUICK | QUICK_SCENES.get(name, {})


def write_choices(frontiers: Sequence[Frontier], folder: Path) -> Path:
    """frontier.md: a line for each scene, kind and error, for the README."""
    columns = ("scene", *CHOICE_COLUMNS)
    lines = [columns, ["---"] * len(columns)]
    for frontier in frontiers:
        name = frontier.reference.scene.name
        lines += [(f"`{name}`", *row) for row in choice_rows(frontier)]
    text = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    path = folder / "frontier.md"
    with whole_file(path) as file:
        file.write_text(text, encoding="utf-8")
    return path


if __name__ == "__main__":
    run_in_words(main)

"""The results of the documentation anew: tables and pictures, with date, machine and commit.

    bash workflows/results.sh [--only PART ...] [--quick] [--out DIR] [--pages DIR]

Runs the main job, ellipses in two flows, the paper again, the frontier, the advice, the stability map, the
benchmark and the table of cases, one after another, each into a folder of its own below --out. Then it
replaces the tables that the pages include and the pictures that they and the README show, which it stamps:
those of the checkout, or with --pages those below another folder.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import advice
import benchmark
import case_table
import cavity
import flow_pictures
import frontier
import paper
from stamps import stamp_pictures

from ellipsoid_coupling.compare.stability import chosen_cases, map_stability
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.output.stability_report import (
    SUMMARY_COLUMNS,
    report_stability,
    summary_rows,
)

TOP = Path(__file__).parents[1]
# What --quick gives to the main job, whose own small version takes a minute.
TINY = ["particles.number=40", "particles.realisations=2", "numerics.cell=0.05", "flow.cells=16"]
TINY += ["particles.length=0.1", "particles.width=0.05", "times=[0.4,0.8,1.2]"]


class Told(NamedTuple):
    """What a part leaves for the pages: lines of a table, what stands before it, and pictures."""

    table: Sequence[Iterable[str]] = ()
    before: str = ""
    pictures: tuple[str, ...] = ()


def told_by_cavity(folder: Path, *, quick: bool) -> Told:
    """The main job at the paper's numbers: pictures alone."""
    cavity.main(["--out", str(folder), *(["--set", *TINY] if quick else ["--full"])])
    names = ["density_cavity", "density_cavity_free", "ellipses_cavity", "angles_cavity_free"]
    names += ["directors_cavity", "flow", "walls", "error_against_run_time_cavity_free"]
    return Told(pictures=tuple(f"{name}.png" for name in names))


def told_by_flows(folder: Path, *, quick: bool) -> Told:
    """Ellipses in the vortex street and in the elbow: pictures alone."""
    flow_pictures.main(["--out", str(folder), *_quick(quick)])
    return Told(pictures=tuple(f"{picture.scene}.png" for picture in flow_pictures.PICTURES))


def told_by_paper(folder: Path, *, quick: bool) -> Told:
    """The verdicts on the paper's statements."""
    paper.main(["--out", str(folder), *_quick(quick)])
    with (folder / "verdicts.csv").open(encoding="utf-8", newline="") as file:
        return Told(list(csv.reader(file)))


def told_by_frontier(folder: Path, *, quick: bool) -> Told:
    """The cheapest runs for three errors."""
    frontier.main(["--out", str(folder), "--longest", "0.05" if quick else "5", *_quick(quick)])
    lines = (folder / "frontier.md").read_text("utf-8").splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    # Without the rule below the head, which every table gets.
    return Told([rows[0], *rows[2:]], "", ("error_parts_cavity_free.png",))


def told_by_advice(folder: Path, *, quick: bool) -> Told:
    """Whether advice holds, against full comparisons."""
    advice.main(["--out", str(folder), *_quick(quick)])
    lines = (folder / "advice.md").read_text("utf-8").splitlines()
    rows = [[c.strip() for c in line.strip("|").split(" | ")] for line in lines if line[:1] == "|"]
    pictures = ("advice.png",) if (folder / "advice.png").is_file() else ()
    return Told([rows[0], *rows[2:]], lines[-1], pictures)


def told_by_stability(folder: Path, *, quick: bool) -> Told:
    """How many runs of each model and scheme hold."""
    cases = chosen_cases(quick=True)[:2] if quick else chosen_cases(quick=False)
    with ProgressReporter("stability") as report:
        entries = map_stability(cases, report=report)
    report_stability(entries, cases, folder)
    return Told([SUMMARY_COLUMNS, *summary_rows(entries)], "", ("stability.png",))


def told_by_benchmark(folder: Path, *, quick: bool) -> Told:
    """Each number beside its rival."""
    told = json.loads(benchmark.main(["--out", str(folder), *_quick(quick)]).read_text("utf-8"))
    columns = ("work", "aim", "measured", "beside")
    rows = [[row[name] for name in columns] for row in told["rows"]]
    limits = ", ".join(f"{name} {value:.3g}" for name, value in told["limits"].items())
    return Told([columns, *rows], f"Limits of the machine: {limits}.")


def told_by_cases(folder: Path, *, quick: bool) -> Told:
    """What is made of solved cases: each read or refused, and each model's run on it."""
    folder.mkdir(parents=True, exist_ok=True)
    cases: Iterable[Path] = case_table.known_cases(folder)
    if quick:
        cases = [case_table.DATA / "cylinder_8"]
    models = case_table.all_models()
    rows = list(case_table.table(cases, models[:1] if quick else models, 300.0))
    return Told(case_table.narrow(rows))


PARTS: dict[str, Callable[..., Told]] = {
    "cavity": told_by_cavity,
    "flows": told_by_flows,
    "paper": told_by_paper,
    "frontier": told_by_frontier,
    "advice": told_by_advice,
    "stability": told_by_stability,
    "benchmark": told_by_benchmark,
    "cases": told_by_cases,
}
# Pictures that the pages show under another name than the part gives them.
RENAMED = {"frontier": ("error_against_run_time_cavity_free.png", "frontier_cavity_free.png")}


def _quick(quick: bool) -> list[str]:
    return ["--quick"] if quick else []


def main(arguments: Sequence[str] | None = None) -> Path:
    """Measure, and replace tables and pictures; returns the folder of all results."""
    parser = argparse.ArgumentParser(description="the documentation's results anew")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--quick", action="store_true", help="tiny sizes, which mean nothing")
    parser.add_argument("--out", type=Path, help="folder of all results")
    parser.add_argument("--pages", type=Path, default=TOP / "workflows", help="what is replaced")
    options = parser.parse_args(arguments)
    out = options.out or TOP / "results" / time.strftime("all-%Y%m%d-%H%M%S")
    for name in options.only:
        told = PARTS[name](out / name, quick=options.quick)
        replace(name, out / name, told, options.pages)
    sys.stdout.write(f"{out}\n")
    return Path(out)


def replace(name: str, folder: Path, told: Told, pages: Path) -> None:
    """The part's table below pages/docs/pages/results/tables, its pictures below pages/pictures."""
    tables, pictures = pages / "docs" / "pages" / "results" / "tables", pages / "pictures"
    tables.mkdir(parents=True, exist_ok=True)
    pictures.mkdir(parents=True, exist_ok=True)
    copies = [(picture, picture) for picture in told.pictures]
    copies += [RENAMED[name]] if name in RENAMED else []
    for made, shown in copies:
        shutil.copyfile(folder / made, pictures / shown)
    stamp_pictures(pictures, [shown for _, shown in copies], stamp())
    if told.table:
        text = "\n\n".join(part for part in (stamp(), told.before, table(told.table)) if part)
        with whole_file(tables / f"{name}.md") as beside:
            beside.write_text(text + "\n", encoding="utf-8")


def table(rows: Sequence[Iterable[str]]) -> str:
    """Rows as a table of Markdown, the first of them its head."""
    lines = [[cell.replace("|", r"\|") for cell in row] for row in rows]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def stamp() -> str:
    """One sentence: the day, the processor and the commit."""
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    return f"Measured on {day}, {processor()}, {os.cpu_count()} cores, at commit {commit()}."


def processor() -> str:
    """The processor's name as Linux tells it, else its kind."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text("utf-8").splitlines() if told.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def commit() -> str:
    """The checkout's commit, and whether files differ from it; "unknown" where git does not tell."""
    try:
        head = _git("rev-parse", "--short", "HEAD").strip()
        # But for what earlier parts have replaced.
        kept = [f":!workflows/{name}" for name in ("docs/pages/results/tables", "pictures")]
        changed = _git("status", "--porcelain", "--untracked-files=no", "--", ":/", *kept).strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{head} with changes" if changed else head


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(TOP), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    run_in_words(main)

"""The page of workflows/paper.py: pictures with captions, run times, verdicts, as one HTML file."""

from __future__ import annotations

import csv
import html
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ellipsoid_coupling import Result
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.progress import ProgressReporter

_STYLE = """
body { font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222; }
figure { margin: 2em 0; } img { max-width: 100%; border: 1px solid #ddd; }
table { border-collapse: collapse; }
td, th { border: 1px solid #ccc; padding: 0.3em 0.6em; text-align: left; }
.yes { background: #d9f0d3; } .no { background: #fddbc7; }
"""


_STATEMENTS = ("statement", "scheme", "", "evidence")
_DIFFERENCE = ("scene", "model", "of", "t", "scheme", "closure", "finite N")
_RUN = ("scene", "model", "scheme", "resolution", "seconds", "")
_JUDGED = (
    "Each part of a statement is judged by itself, with the paper's own scheme, cells and steps "
    "(paper) and with the package's (accurate). Its bound follows from its words and stands at the top "
    "of workflows/paper.py."
)
_PARTS = (
    "L1 distances, 2 is no overlap. Scheme: the model with the paper's scheme to itself with accurate. "
    "Closure: the model with accurate to the mean-field limit (mckean_vlasov). Finite N: the "
    "microscopic ensemble to that limit, its sampling error included."
)


@dataclass(frozen=True)
class Verdict:
    """A statement of the paper, whether it reproduces, and the number that decides it.

    scheme : of the runs: "paper", "accurate", or "" if there is one kind of runs
    """

    statement: str
    holds: bool
    evidence: str
    scheme: str = ""


@dataclass(frozen=True)
class Difference:
    """The parts of a grid model's L1 distance to the microscopic ensemble at one time.

    scheme : the model with the paper's scheme to itself with `accurate`
    closure : the model with `accurate` to `mckean_vlasov`
    finite_n : `microscopic` to `mckean_vlasov`, its sampling included
    """

    scene: str
    model: str
    kind: str
    time: float
    scheme: float
    closure: float
    finite_n: float


@dataclass
class Page:
    """The contents of the page so far."""

    folder: Path
    quick: bool
    report: ProgressReporter
    pictures: list[tuple[str, str]] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)
    differences: list[Difference] = field(default_factory=list)
    runs: list[tuple[str, ...]] = field(default_factory=list)
    started: float = field(default_factory=time.perf_counter)

    def add(self, picture: Path, caption: str) -> None:
        """A picture with its caption."""
        self.pictures.append((picture.name, caption))

    def judge(self, verdict: Verdict) -> None:
        """A verdict."""
        self.verdicts.append(verdict)

    def tell_run(self, result: Result) -> None:
        """Add a finished run: its resolution, its steps and its seconds."""
        attributes = result.attributes
        crossing = (
            f", characteristics crossed at {attributes['crossing_time']:.3g}"
            if "crossing_time" in attributes
            else ""
        )
        self.runs.append(
            (
                result.scene.name,
                result.model,
                result.scheme,
                str(attributes["resolution"]),
                f"{attributes['wall_seconds']:.1f}",
                f"{attributes['steps']:.0f} steps{crossing}",
            )
        )

    def tell_failure(self, scene: str, model: str, scheme: str, message: str) -> None:
        """A run that did not come to its end."""
        self.runs.append((scene, model, scheme, "", "", f"failed: {message}"))

    def write(self) -> Path:
        """index.html and verdicts.csv, written beside and renamed."""
        verdicts = [
            (v.statement, v.scheme, "reproduces" if v.holds else "does not reproduce", v.evidence)
            for v in sorted(self.verdicts, key=lambda v: (v.statement, v.scheme != "paper"))
        ]
        parts = [
            (
                *(d.scene, d.model, d.kind, f"{d.time:g}"),
                *(f"{part:.3f}" for part in (d.scheme, d.closure, d.finite_n)),
            )
            for d in self.differences
        ]
        figures = "".join(
            f'<figure><img src="{name}" alt="{html.escape(caption)}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            for name, caption in self.pictures
        )
        size = (
            "tiny sizes, whose verdicts mean nothing" if self.quick else "the paper's resolutions"
        )
        minutes = (time.perf_counter() - self.started) / 60.0
        running = sum(float(run[4]) for run in self.runs if run[4]) / 60.0
        text = (
            f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>The paper again</title>'
            f"<style>{_STYLE}</style></head><body><h1>The paper again</h1><p>At {size}. "
            f"Made in {minutes:.1f} minutes, {running:.1f} of them the runs below.</p>"
            f"<h2>Statements</h2><p>{_JUDGED}</p>{_table(_STATEMENTS, verdicts, 2)}"
            f"<h2>What differences are made of</h2><p>{_PARTS}</p>{_table(_DIFFERENCE, parts)}"
            f"<h2>Runs</h2>{_table(_RUN, self.runs)}<h2>Figures</h2>{figures}</body></html>\n"
        )
        path = self.folder / "index.html"
        with whole_file(path) as beside:
            beside.write_text(text, encoding="utf-8")
        with (
            whole_file(self.folder / "verdicts.csv") as beside,
            beside.open("w", newline="") as file,
        ):
            csv.writer(file).writerows([("statement", "scheme", "verdict", "evidence"), *verdicts])
        return path


def _table(
    head: tuple[str, ...], rows: Sequence[tuple[str, ...]], verdict: int | None = None
) -> str:
    """An HTML table; where one column holds verdicts, they colour their rows."""
    cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    lines = [f"<tr>{cells}</tr>"]
    for row in rows:
        kind = "" if verdict is None else f' class="{"no" if "not" in row[verdict] else "yes"}"'
        cells = "".join(f"<td>{html.escape(cell)}</td>" for cell in row)
        lines.append(f"<tr{kind}>{cells}</tr>")
    return f"<table>{''.join(lines)}</table>"

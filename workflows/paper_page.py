"""The page of workflows/paper.py: pictures with captions, run times, verdicts, as one HTML file."""

from __future__ import annotations

import html
import time
from dataclasses import dataclass, field
from pathlib import Path

from ellipsoid_coupling import Result
from ellipsoid_coupling.files import whole_file
from ellipsoid_coupling.progress import ProgressReporter

_STYLE = """
body { font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222; }
figure { margin: 2em 0; } img { max-width: 100%; border: 1px solid #ddd; }
table { border-collapse: collapse; }
td, th { border: 1px solid #ccc; padding: 0.3em 0.6em; text-align: left; }
.yes { background: #d9f0d3; } .no { background: #fddbc7; }
"""


@dataclass(frozen=True)
class Verdict:
    """A statement of the paper, whether it reproduces, and the number that decides it."""

    statement: str
    holds: bool
    evidence: str


@dataclass
class Page:
    """What has been gathered so far."""

    folder: Path
    quick: bool
    report: ProgressReporter
    pictures: list[tuple[str, str]] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)
    runs: list[tuple[str, ...]] = field(default_factory=list)
    started: float = field(default_factory=time.perf_counter)

    def add(self, picture: Path, caption: str) -> None:
        """A picture with its caption."""
        self.pictures.append((picture.name, caption))

    def judge(self, verdict: Verdict) -> None:
        """A verdict."""
        self.verdicts.append(verdict)

    def tell_run(self, result: Result) -> None:
        """A finished run: what it was and what it took."""
        told = result.attributes
        crossing = (
            f", characteristics crossed at {told['crossing_time']:.3g}"
            if "crossing_time" in told
            else ""
        )
        self.runs.append(
            (
                result.scene.name,
                result.model,
                result.scheme,
                str(told["resolution"]),
                f"{told['wall_seconds']:.1f}",
                f"{told['steps']:.0f} steps{crossing}",
            )
        )

    def tell_failure(self, scene: str, model: str, message: str) -> None:
        """A run that did not come to its end."""
        self.runs.append((scene, model, "accurate", "", "", f"failed: {message}"))

    def write(self) -> Path:
        """index.html, written beside and renamed."""
        rows = "".join(
            f'<tr class="{"yes" if v.holds else "no"}"><td>{html.escape(v.statement)}</td>'
            f"<td>{'reproduces' if v.holds else 'does not reproduce'}</td>"
            f"<td>{html.escape(v.evidence)}</td></tr>"
            for v in sorted(self.verdicts, key=lambda verdict: verdict.statement)
        )
        runs = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in run) + "</tr>"
            for run in self.runs
        )
        figures = "".join(
            f'<figure><img src="{name}" alt="{html.escape(caption)}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            for name, caption in self.pictures
        )
        size = "small ensembles and wide cells" if self.quick else "the paper's resolutions"
        minutes = (time.perf_counter() - self.started) / 60.0
        running = sum(float(run[4]) for run in self.runs if run[4]) / 60.0
        text = (
            f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>The paper again</title>'
            f"<style>{_STYLE}</style></head><body><h1>The paper again</h1><p>At {size}. "
            f"Made in {minutes:.1f} minutes, {running:.1f} of them the runs below.</p>"
            f"<h2>Statements</h2><table>"
            f"<tr><th>statement</th><th></th><th>evidence</th></tr>{rows}</table>"
            "<h2>Runs</h2><table><tr><th>scene</th><th>model</th><th>scheme</th><th>resolution</th>"
            f"<th>seconds</th><th></th></tr>{runs}</table><h2>Figures</h2>{figures}</body></html>\n"
        )
        path = self.folder / "index.html"
        with whole_file(path) as beside:
            beside.write_text(text, encoding="utf-8")
        return path

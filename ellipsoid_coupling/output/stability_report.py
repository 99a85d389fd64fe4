"""The stability map as a page: the picture, a summary, and the runs that did not complete."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.compare.stability import Case, MapEntry, write_stability
from ellipsoid_coupling.compare.stability.run_case import REFERENCE_OF_PRESSURE
from ellipsoid_coupling.compare.stability.watched_run import LARGEST_DRIFT, MOST_STEPS
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.figures import draw_stability
from ellipsoid_coupling.output.labels import model_name

SUMMARY_COLUMNS = (
    "model",
    "scheme",
    "runs",
    "completed",
    "stopped",
    "broken",
    "refused",
    "error: median",
    "largest",
    "mass drift",
    "seconds",
)

_STYLE = """
body { font-family: sans-serif; max-width: 75em; margin: 2em auto; padding: 0 1em; color: #222; }
img { max-width: 100%; } table { border-collapse: collapse; font-size: 90%; }
td, th { border: 1px solid #ccc; padding: 0.2em 0.5em; text-align: left; vertical-align: top; }
.stopped, .broken { background: #fddbc7; } .refused { background: #eee; }
"""
_EXPLANATION = f"""
<p>The first map has one row for all cases that vary the same thing: their largest error, or how many
of them did not hold. Every case changes one thing of a small scene, some two: a box with walls in a
rigid rotation, 40
particles, 12 x 12 cells, 16 angles. Every model runs it with both schemes. An entry shows the error:
the larger of the mean distance by which mass lies off along x or y (in widths of the domain) and of
the difference of &lt;e<sup>2 i theta</sup>&gt; (0 to 2), against the reference that the table below
names: the model's own scheme <code>accurate</code> with half as many cells and angles again, or
a hundredth of the tolerance; with noise, more realisations of other noise, so that the error is
mostly the sampling error of a few hundred particles.</p>
<ul><li><b>stop</b>, <b>dt</b>: the run ended with a reason, and would need the step after dt. It may take
{", ".join(f"{steps} steps ({kind})" for kind, steps in MOST_STEPS.items())}, repeated ones included;
no clock takes part, so that the map is the same on any machine.</li>
<li><b>broken</b>: it came to its end, but mass drifted by more than {LARGEST_DRIFT:g} (mass that
left through open edges counted), a density was negative or a particle outside the walls.</li>
<li><b>bad in.</b>: refused as bad input, before anything was computed.</li>
<li><b>-</b>: the model lacks the quantity that the case varies. <b>?</b>: the run held, but its error is
not known, as the reference took more steps than a run may ({REFERENCE_OF_PRESSURE:g} of that under
pressure) or is left out (100 000 particles that all touch one another: minutes an evaluation). Other models
have the same case with a reference.</li>
</ul>
<p>Large errors of <code>accurate</code> say that the small scene does not resolve the case (a needle
of a hundredth of a cell) or that its paths are chaotic, not that the scheme failed. Where
<code>paper</code> did not hold, the table gives the largest step tried with which it does.</p>
"""


def report_stability(entries: Sequence[MapEntry], cases: Sequence[Case], folder: Path) -> None:
    """Write stability.csv, index.html and the two maps in `folder`, which is made.

    stability.png is the one in groups, stability_cases.png that of all cases.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_stability(entries, folder)
    draw_stability(entries, folder / "stability.png", grouped=True)
    draw_stability(entries, folder / "stability_cases.png")
    text = (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Stability map</title>'
        f"<style>{_STYLE}</style></head><body><h1>Stability map</h1>{_EXPLANATION}"
        f"<h2>Summary</h2>{_table(SUMMARY_COLUMNS, summary_rows(entries))}"
        '<p><img src="stability.png" alt="groups of cases against models and schemes"></p>'
        '<h2>Case by case</h2><p><img src="stability_cases.png" alt="all cases"></p>'
        f"<h2>Runs that did not hold</h2>{_failures(entries)}"
        f"<h2>The cases</h2>{_table(('case', 'changes'), _case_rows(cases))}"
        f"<h2>All runs</h2>{_runs(entries)}</body></html>\n"
    )
    with whole_file(folder / "index.html") as beside:
        beside.write_text(text, encoding="utf-8")


def summary_rows(entries: Sequence[MapEntry]) -> list[tuple[str, ...]]:
    """One line a model and scheme, and one for each scheme in all."""
    groups: dict[tuple[str, str], list[MapEntry]] = {}
    for entry in entries:
        if entry.outcome != "not applicable":
            groups.setdefault((model_name(entry.model), entry.scheme), []).append(entry)
            groups.setdefault(("all", entry.scheme), []).append(entry)
    order = sorted(groups, key=lambda group: group[0] == "all")
    return [(*group, *_summary(groups[group])) for group in order]


def _summary(entries: Sequence[MapEntry]) -> tuple[str, ...]:
    counts = [
        sum(entry.outcome == outcome for entry in entries)
        for outcome in ("completed", "stopped", "broken", "refused")
    ]
    errors = sorted(entry.error for entry in entries if math.isfinite(entry.error))
    drifts = [entry.mass_drift for entry in entries if math.isfinite(entry.mass_drift)]
    seconds = sum(entry.seconds for entry in entries if math.isfinite(entry.seconds))
    return (
        str(len(entries)),
        *map(str, counts),
        _number(errors[len(errors) // 2] if errors else math.nan),
        _number(errors[-1] if errors else math.nan),
        _number(max(drifts, default=math.nan)),
        f"{seconds:.1f}",
    )


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}"


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]], kinds: Sequence[str] = ()) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in columns)
    body = "".join(
        f'<tr class="{kind}">' + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row, kind in zip(rows, kinds or [""] * len(rows), strict=True)
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _failures(entries: Sequence[MapEntry]) -> str:
    failed = [
        f for f in entries if f.outcome in ("stopped", "broken", "refused") or f.needed_step > 0
    ]
    columns = ("case", "model", "scheme", "outcome", "error", "step it would need", "reason")
    rows = [
        (
            entry.case,
            model_name(entry.model),
            entry.scheme,
            entry.outcome,
            _number(entry.error),
            _number(entry.needed_step),
            entry.reason,
        )
        for entry in failed
    ]
    return _table(columns, rows, [entry.outcome for entry in failed])


def _case_rows(cases: Sequence[Case]) -> list[tuple[str, str]]:
    def changes_of(case: Case) -> str:
        changes = [f"{key} = {value}" for key, value in case.settings.items()]
        return "; ".join(changes + [f"the flow times {case.gradient:g}"] * (case.gradient != 1.0))

    return [(case.name, changes_of(case)) for case in cases]


def _runs(entries: Sequence[MapEntry]) -> str:
    columns = (
        "case",
        "model",
        "scheme",
        "outcome",
        "place error",
        "angle error",
        "reference",
        "mass drift",
        "least density",
        "steps",
        "repeated",
        "seconds",
    )
    shown = [entry for entry in entries if entry.outcome != "not applicable"]
    rows = [
        (
            entry.case,
            model_name(entry.model),
            entry.scheme,
            entry.outcome,
            _number(entry.place_error),
            _number(entry.angle_error),
            entry.reference,
            _number(entry.mass_drift),
            _number(entry.least_density),
            f"{entry.steps:.0f}".replace("nan", ""),
            f"{entry.rejected:.0f}".replace("nan", ""),
            f"{entry.seconds:.2f}".replace("nan", ""),
        )
        for entry in shown
    ]
    return _table(columns, rows, [entry.outcome for entry in shown])

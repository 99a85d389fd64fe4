"""The tables of finished runs, one column a run: what ran, what was left out, steps, fates."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models import find_kind, plan_terms
from ellipsoid_coupling.output.labels import model_name
from ellipsoid_coupling.output.report import markup
from ellipsoid_coupling.output.report.sources import Run
from ellipsoid_coupling.output.series import time_series
from ellipsoid_coupling.scenes import Term, explain_terms, scene_to_toml

NOTHING = "–"

# What each of `step_control.REASONS` means for a reader; tests/output/report holds the two together.
LIMITS = {
    "save times": "the step was cut to meet a saved time",
    "given step": "numerics.time_step",
    "CFL number": "numerics.cfl: nothing may cross more than this part of a cell in a step",
    "force": "the force on what is at rest may not carry it further than the CFL number allows",
    "rotation": "numerics.cfl, of the cells of the angle",
    "position error": "numerics.tolerance, of places",
    "angle error": "numerics.tolerance, of angles",
    "repeated step": "a step that failed was taken again at half its length, and may grow from there",
    "collision": "two particles came close, which takes short steps",
}


def run_names(runs: Sequence[Run]) -> list[str]:
    """The heads of the columns: a number, the model and the scheme."""
    return [
        f"{number}. {model_name(run.result.model)}, {run.result.scheme}"
        for number, run in enumerate(runs, 1)
    ]


def _table(runs: Sequence[Run], facts: Mapping[str, Sequence[str]], title: str = "") -> str:
    """Facts by name, a cell a run; those that no run has are left out."""
    rows = [(name, *cells) for name, cells in facts.items() if any(c != NOTHING for c in cells)]
    return markup.table(("", *run_names(runs)), rows, title) if rows else ""


def overview(runs: Sequence[Run]) -> str:
    """What ran, and how it ended."""
    facts = {
        "folder": [str(run.path) for run in runs],
        "status": [run.result.status or NOTHING for run in runs],
        "scene": [run.result.scene.name for run in runs],
        "title": [run.result.scene.title or NOTHING for run in runs],
        "model": [run.result.model for run in runs],
        "scheme": [run.result.scheme for run in runs],
        "resolution": _attribute(runs, "resolution"),
        "seed": _attribute(runs, "seed"),
        "saved times": [_times(run) for run in runs],
        "flow": _attribute(runs, "flow"),
        "mass at the start": _attribute(runs, "mass_start"),
        "mass at the end": _attribute(runs, "mass_end"),
        "mass that left": _attribute(runs, "mass_left"),
        "mass that came in": _attribute(runs, "mass_came_in"),
        "seconds of running": _attribute(runs, "wall_seconds"),
        "seconds of compiling": _attribute(runs, "compile_seconds"),
        "package version": _attribute(runs, "package_version"),
    }
    names = list(dict.fromkeys(name for run in runs for name in run.versions))
    for name in names:
        facts[f"version of {name}"] = [run.versions.get(name, NOTHING) for run in runs]
    return _table(runs, facts)


def _times(run: Run) -> str:
    reached, asked = run.result.times, run.result.scene.times
    text = ", ".join(f"{time:g}" for time in reached[:12]) or "none"
    more = f", ... ({reached.size})" if reached.size > 12 else ""
    return text + more + ("" if reached.size == len(asked) else f", of {len(asked)}")


def _attribute(runs: Sequence[Run], name: str) -> list[str]:
    return [number_text(run.result.attributes.get(name)) for run in runs]


def number_text(value: object) -> str:
    """A number of an attribute, or a text, for a reader; a dash for what is not there."""
    if value is None or value == "":
        return NOTHING
    if isinstance(value, float):
        return f"{value:.0f}" if value.is_integer() and abs(value) < 1e15 else f"{value:.5g}"
    return str(value)


def terms(runs: Sequence[Run]) -> str:
    """Every term of the equations: whether it ran, and why."""
    planned = [{term.name: term for term in _planned(run)} for run in runs]
    names = list(dict.fromkeys(name for one in planned for name in one))
    rows, classes = [], {}
    for i, name in enumerate(names):
        cells = []
        for j, one in enumerate(planned, 1):
            term = one[name]
            cells.append(f"{'runs' if term.runs else 'left out'}: {term.why}")
            if not term.runs:
                classes[i, j] = "out"
        rows.append((name, *cells))
    return markup.table(("term", *run_names(runs)), rows, classes=classes)


def _planned(run: Run) -> list[Term]:
    """The terms as `ellipsoid plan` has them; of a model that is not registered, those of its scene."""
    scene, model = run.result.scene, run.result.model
    if find_kind(model) is None:
        return explain_terms(scene)
    try:
        return plan_terms(scene, model)
    except InputError:
        return explain_terms(scene)


def warnings(runs: Sequence[Run]) -> str:
    """Warnings, and the reasons of failures."""
    lines = []
    for name, run in zip(run_names(runs), runs, strict=True):
        failed = [] if run.result.status == "completed" else [run.result.status or "no status"]
        lines += [f"{name}: {line}" for line in (*failed, *run.result.warnings)]
    return markup.bullets(lines) if lines else markup.paragraph("None.")


def steps(runs: Sequence[Run]) -> str:
    """How many steps there were, and what bounded their length."""
    limits = _attribute(runs, "step_limits")
    facts = {
        "bounded by": limits,
        "steps": _attribute(runs, "steps"),
        "repeated steps": _attribute(runs, "rejected_steps"),
        "shortest step": _attribute(runs, "shortest_step"),
        "which was at t": _attribute(runs, "shortest_step_time"),
        "longest step": _attribute(runs, "longest_step"),
    }
    table = _table(runs, facts)
    told = [
        f"{name}: {text}" for name, text in LIMITS.items() if any(name in one for one in limits)
    ]
    return table + (markup.bullets(told) if table and told else "")


def fates(runs: Sequence[Run]) -> str:
    """What became of particles by patch, and the mass that left by patch."""
    counts = [_by_name(run, "fates") for run in runs]
    left = [_by_name(run, "mass_left_by_patch") for run in runs]
    pieces = (("particles, at the end", counts), ("mass that left, of 1", left))
    return "".join(
        _table(
            runs,
            {
                name: [one.get(name, NOTHING) for one in column]
                for name in dict.fromkeys(name for one in column for name in one)
            },
            title,
        )
        for title, column in pieces
    )


def _by_name(run: Run, attribute: str) -> dict[str, str]:
    """The numbers of an attribute by name, "outlet 25, cylinder 0", as `models.base.listed` has it."""
    text = str(run.result.attributes.get(attribute, ""))
    parts = (part.rpartition(" ") for part in text.split(", ") if part)
    return {name or number: number for name, _, number in parts}


def series(runs: Sequence[Run]) -> str:
    """The numbers of the figure over time, a table a run."""
    tables = []
    for name, run in zip(run_names(runs), runs, strict=True):
        one = time_series(run.result)
        if not one.times.size:
            continue
        columns = one.by_name()
        rows = [
            (f"{time:g}", *(_short(values[k]) for values in columns.values()))
            for k, time in enumerate(one.times)
        ]
        tables.append(markup.table(("t", *columns), rows, name))
    return markup.folded("The numbers", "".join(tables)) if tables else ""


def _short(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else NOTHING


def repeating(runs: Sequence[Run]) -> str:
    """The command and the file that repeat each run."""
    pieces = []
    for name, run in zip(run_names(runs), runs, strict=True):
        pieces.append(markup.subheading(name))
        result = run.result
        if run.run_file:
            folder = run.path if run.path.suffix != ".nc" else run.path.parent
            command = f"ellipsoid run {shlex.quote(str(folder / 'run.toml'))} --out NEW_FOLDER"
            pieces += [
                markup.verbatim(command),
                markup.folded("run.toml", markup.verbatim(run.run_file)),
            ]
            continue
        told = f"--model {shlex.quote(result.model)} --scheme {shlex.quote(result.scheme)}"
        command = (
            f"ellipsoid run scene.toml {told} --seed {number_text(result.attributes.get('seed'))}"
        )
        scene = markup.verbatim(scene_to_toml(result.scene))
        pieces += [markup.verbatim(command), markup.folded("scene.toml", scene)]
    return "".join(pieces)

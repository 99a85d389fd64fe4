"""The page of a report, put together and written."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.figures import draw_all, draw_time_series
from ellipsoid_coupling.output.figures.ellipses import thinned
from ellipsoid_coupling.output.report import comparisons as compared
from ellipsoid_coupling.output.report import markup, runs
from ellipsoid_coupling.output.report.sources import Comparison, Run
from ellipsoid_coupling.result import Result

Report = Callable[[str, float], None]

PAGE_FILE = "report.html"
# Saved times that pictures show.
MOST_TIMES = 6
# The beginnings of the names of `figures`' files, in words.
_KINDS = {
    "density": "Density at the saved times, rows by run",
    "angles": "Distribution of the angle at the saved times",
    "ellipses": "Particles as ellipses to scale, one realisation",
    "flow": "The flow",
    "directors": "Mean axes at the saved times, as lines over the density",
    "axes": "Mean axes at the saved times, as colours",
    "order": "The order parameter over time",
}


def write_report(
    made: Sequence[Run],
    comparisons: Sequence[Comparison],
    folder: Path,
    report: Report | None = None,
) -> Path:
    """Write report.html, which holds all that it shows, and return its path.

    Parameters
    ----------
    made : runs, side by side in the order given
    comparisons : folders of `ellipsoid compare`
    folder : made where it is missing
    report : called with the stage and its finished part

    Raises
    ------
    WriteError
        If it cannot be written; an older page stays.
    """
    tell = report or (lambda _stage, _part: None)
    sections = []
    if made:
        tell("drawing", 0.0)
        drawn, over_time = _pictures(made)
        tell("planning", 0.0)
        sections += _run_sections(made, drawn, over_time)
    sections.append(("Comparisons", "comparisons", compared.section(comparisons)))
    text = markup.page(_title(made, comparisons), sections)
    path = folder / PAGE_FILE
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")
    tell("writing", 1.0)
    return path


def _title(made: Sequence[Run], comparisons: Sequence[Comparison]) -> str:
    scenes = [run.result.scene.title or run.result.scene.name for run in made]
    scenes += [row["scene"] for comparison in comparisons for row in comparison.rows]
    return f"Report: {', '.join(dict.fromkeys(scenes))}"


def _run_sections(made: Sequence[Run], drawn: str, over_time: str) -> list[tuple[str, str, str]]:
    """(title, anchor, HTML) of everything about runs."""
    return [
        ("What ran", "runs", runs.overview(made)),
        ("Warnings", "warnings", runs.warnings(made)),
        ("Terms: what ran, what was left out, and why", "terms", runs.terms(made)),
        ("Pictures", "pictures", drawn),
        ("Over time", "series", over_time + runs.series(made)),
        ("Steps, and what bounded them", "steps", runs.steps(made)),
        ("Fates by patch", "fates", runs.fates(made)),
        ("How to repeat it", "repeat", runs.repeating(made)),
    ]


def _pictures(made: Sequence[Run]) -> tuple[str, str]:
    """The pictures of `ellipsoid figures`, and that of the numbers over time."""
    flows = [run.flow for run in made]
    results, count = few_times([run.result for run in made])
    if not count:
        return markup.paragraph("No run has reached a saved time."), ""
    told = f"At {MOST_TIMES} of {count} saved times." if count > MOST_TIMES else ""
    with tempfile.TemporaryDirectory(prefix="ellipsoid-report-") as name:
        folder = Path(name)
        paths = draw_all(results, folder, flows)
        drawn = "".join(markup.picture(path.read_bytes(), _caption(path)) for path in paths)
        path = draw_time_series([run.result for run in made], folder / "over_time.png")
        caption = "Mass, root mean square speeds and alignment at the saved times"
        above = markup.paragraph(told) if told else ""
        return above + drawn, markup.picture(path.read_bytes(), caption)


def few_times(results: Sequence[Result]) -> tuple[list[Result], int]:
    """The results at `MOST_TIMES` of their saved times, first and last among them, and how many there are.

    A panel a time: figures of a run that was saved for a film would be a strip of hundreds of panels.
    """
    times = np.unique(np.concatenate([result.times for result in results]))
    chosen = times[thinned(times.size, MOST_TIMES)] if times.size else times
    kept = [np.isin(result.times, chosen) for result in results]
    few = [
        replace(
            result,
            times=result.times[here],
            variables={name: values[here] for name, values in result.variables.items()},
        )
        for result, here in zip(results, kept, strict=True)
    ]
    return few, times.size


def _caption(path: Path) -> str:
    kind, _, rest = path.stem.partition("_")
    return f"{_KINDS.get(kind, kind)} ({rest})"

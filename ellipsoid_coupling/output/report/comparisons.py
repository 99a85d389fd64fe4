"""The error tables and pictures of comparisons."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ellipsoid_coupling.output.report import markup
from ellipsoid_coupling.output.report.sources import Comparison, Rows

# Parts of errors in words, and the beginnings of their columns.
_PARTS = {
    "discretisation": "discretisation",
    "closure": "closure",
    "finite N": "finite_n",
    "sampling": "sampling",
}
_HEAD = ("model", "scheme", "resolution", "seconds", "error", *_PARTS)
_LEGEND = (
    "L1 distances to the reference, the largest over the saved times, of the density and of the angle's "
    "distribution (density / angle); 2 is no overlap at all. The parts say where an error comes from: "
    "discretisation, the same model refined; closure, the refined model against the reference; finite N, "
    "likewise for particles; sampling, expected from the spread over realisations."
)


def error_tables(comparison: Comparison) -> str:
    """One table a scene; what could not be run is told with its status."""
    scenes = dict.fromkeys(row["scene"] for row in comparison.rows)
    return markup.paragraph(_LEGEND, "note") + "".join(
        _scene_table(name, [row for row in comparison.rows if row["scene"] == name])
        for name in scenes
    )


def _scene_table(scene: str, rows: Rows) -> str:
    reference = rows[0].get("reference", "")
    title = f"{scene}, against {reference}" if reference else scene
    lines, classes = [], {}
    for number, levels in enumerate(_runs(rows)):
        first = levels[0]
        done = first["status"] == "completed"
        parts = [_pair(levels, f"{part}_density", f"{part}_angle") for part in _PARTS.values()]
        cells = [_pair(levels, "density_error", "angle_error"), *parts]
        if not done:
            cells = [first["status"], *("" for _ in _PARTS)]
            failed = first["status"].startswith("failed")
            classes[number, _HEAD.index("error")] = "bad" if failed else "out"
        head = (
            first["model"],
            first["scheme"],
            first["resolution"],
            _number(first["wall_seconds"], ".3g"),
        )
        lines.append((*head, *cells))
    return markup.table(_HEAD, lines, title, classes)


def _runs(rows: Rows) -> Iterator[Rows]:
    """The rows of each run, those of its saved times, in the order of the file."""
    runs: dict[tuple[str, ...], Rows] = {}
    for row in rows:
        key = row["model"], row["scheme"], row["resolution"]
        runs.setdefault(key, []).append(row)
    yield from runs.values()


def _pair(levels: Rows, density: str, angle: str) -> str:
    """The largest of two columns over the saved times, "0.12 / 0.03"; "" where neither is known."""
    cells = [_number(_largest(levels, name), ".4f") for name in (density, angle)]
    return " / ".join(cells) if any(cells) else ""


def _largest(levels: Rows, column: str) -> str:
    known = [row.get(column, "") for row in levels]
    numbers = [value for value in map(_value, known) if math.isfinite(value)]
    return str(max(numbers)) if numbers else ""


def _value(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _number(text: str, form: str) -> str:
    value = _value(text)
    return format(value, form) if math.isfinite(value) else ""


def pictures(comparison: Comparison) -> str:
    """The pictures of the folder."""
    return "".join(
        markup.picture(data, name.removesuffix(".png").replace("_", " "))
        for name, data in comparison.pictures.items()
    )


def section(comparisons: Sequence[Comparison]) -> str:
    """All comparisons: tables, pictures, and the text that the command has written."""
    pieces = []
    for comparison in comparisons:
        pieces += [markup.subheading(str(comparison.path)), error_tables(comparison)]
        pieces.append(pictures(comparison))
        if comparison.text:
            pieces.append(markup.folded("errors.txt: the cheapest run for each error, and all parts",
                                        markup.verbatim(comparison.text)))  # fmt: skip
    return "".join(pieces)

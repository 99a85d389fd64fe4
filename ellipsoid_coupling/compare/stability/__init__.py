"""A map of stability: which models and schemes hold in stiff and extreme cases."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.compare.stability.case import Case
from ellipsoid_coupling.compare.stability.cases import CASES
from ellipsoid_coupling.compare.stability.run_case import MapEntry, examine
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.models import SCHEMES, model_names
from ellipsoid_coupling.simulation import Report

__all__ = [
    "CASES",
    "Case",
    "MapEntry",
    "chosen_cases",
    "examine",
    "map_stability",
    "write_stability",
]


def chosen_cases(*, quick: bool) -> tuple[Case, ...]:
    """All cases, or (`quick`) those of the short map."""
    return tuple(case for case in CASES if case.quick or not quick)


def map_stability(
    cases: Sequence[Case] = CASES,
    models: Sequence[str] | None = None,
    *,
    report: Report | None = None,
) -> list[MapEntry]:
    """Every case with every model (or these) and both schemes."""
    names = model_names() if models is None else models
    entries: list[MapEntry] = []
    for number, case in enumerate(cases):
        for index, model in enumerate(names):
            if report is not None:
                report("stability map", (number + index / len(names)) / len(cases))
            entries += examine(case, model, SCHEMES)
    if report is not None:
        report("stability map", 1.0)
    return entries


def write_stability(entries: Sequence[MapEntry], folder: Path) -> Path:
    """stability.csv, one line a run; the error is the larger of the two before it."""
    path = folder / "stability.csv"
    with whole_file(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*MapEntry.__dataclass_fields__, "error"])
        writer.writerows([[*vars(entry).values(), entry.error] for entry in entries])
    return path

"""Whether advice holds: `ellipsoid advise` against full comparisons of ten scenes.

    .venv/bin/python workflows/advice.py [--quick] [--cases NAME ...] [--longest S] [--seconds S]

Every scene is compared as by `ellipsoid compare` (all models, schemes and resolutions), then asked for
advice for errors of 10 % and 3 % of density and angle. advice.csv, advice.md and advice.png say whether the
promised errors are kept, and how much longer the advised run takes than the cheapest that keeps the error.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ellipsoid_coupling import Scene, advise, load_scene
from ellipsoid_coupling.compare import Frontier, FrontierRow, run_frontier
from ellipsoid_coupling.compare.cheapest import KINDS, Kind, largest_error
from ellipsoid_coupling.errors import RunError, run_in_words
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures import AdviceMark, draw_advice
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.simulation import scene_flow

ERRORS, QUICK_ERRORS = (0.10, 0.03), (0.5, 0.3)
LONGEST, SECONDS = 4.0, 40.0
# Large particles and wide cells are less work, and so are short times.
LARGE: dict[str, Any] = {
    "particles.length": 0.3, "particles.width": 0.15, "particles.number": 200, "numerics.cell": 0.1,
    "times": [0.5, 1.0],
}  # fmt: skip
# The scene of each case, and what is changed in it: the paper's five, and five more.
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "cavity": ("cavity", {}),
    "cavity_free": ("cavity_free", {}),
    "rotation": ("rotation", {}),
    "stationary": ("stationary", {}),
    "top_bottom": ("top_bottom", {}),
    "cylinder": ("cylinder", {}),
    "noise_and_drag": ("rotation", LARGE | {"noise.noise": 0.3, "noise.angular_noise": 0.3}),
    "top_bottom_free": ("top_bottom", {"interaction": None}),
    "channel": ("channel", {"interaction.strength": 0.1}),
    "weak_drag": ("cavity_free", {"flow.drag": 1.0, "flow.angular_drag": 1.0}),
}
QUICK: dict[str, tuple[str, dict[str, Any]]] = {
    "rotation_free": (
        "rotation",
        {
            "interaction": None, "particles.number": 100, "particles.realisations": 16,
            "numerics.cell": 0.05, "times": [0.5],
        },
    ),
}  # fmt: skip
COLUMNS = (
    "case", "quantity", "error", "model", "scheme", "resolution", "promised", "expected", "expected_high",
    "found", "kept", "seconds", "expected_seconds", "cheapest", "cheapest_seconds", "cost_ratio", "spent",
    "reason",
)  # fmt: skip


class Verdict(NamedTuple):
    """One question and what became of its answer.

    Attributes
    ----------
    case, quantity, error : what was asked
    model, scheme, resolution : what was advised; "" without advice
    promised : bool
    expected, expected_high : float
        The error that was told.
    found : float
        Of the same run in the comparison; NaN where that did not run it.
    seconds, cheapest_seconds : float
        In the comparison: of the advised run, and of the cheapest that keeps the error.
    expected_seconds, spent : float
    cheapest, reason : str
    """

    case: str
    quantity: Kind
    error: float
    model: str
    scheme: str
    resolution: str
    promised: bool
    expected: float
    expected_high: float
    found: float
    seconds: float
    expected_seconds: float
    cheapest: str
    cheapest_seconds: float
    spent: float
    reason: str

    @property
    def kept(self) -> bool:
        """Whether a promise was kept."""
        return self.promised and self.found <= self.error

    @property
    def cost_ratio(self) -> float:
        """Seconds of the advised run over those of the cheapest that keeps the error."""
        return self.seconds / self.cheapest_seconds


def judged(
    case: str,
    scene: Scene,
    flow: FlowField | None,
    frontier: Frontier,
    errors: Sequence[float] = ERRORS,
    **options: Any,
) -> Iterator[Verdict]:
    """All questions of one case.

    options : seconds and report, for `advise`
    """
    for quantity in KINDS:
        for error in errors:
            advice = advise(scene, error=error, quantity=quantity, flow=flow, **options)
            best, cheapest = advice.best, cheapest_of(frontier, quantity, error)
            found = (
                None if best is None else row_like(frontier, best.model, best.scheme, best.scene)
            )
            nan = math.nan
            yield Verdict(
                case=case,
                quantity=quantity,
                error=error,
                model=best.model if best else "",
                scheme=best.scheme if best else "",
                resolution=best.resolution if best else "",
                promised=advice.promised,
                expected=best.error.value if best else nan,
                expected_high=best.error.high if best else nan,
                found=largest_error(found, quantity) if found else nan,
                seconds=found.wall_seconds if found else nan,
                expected_seconds=best.seconds.value if best else nan,
                cheapest="" if cheapest is None else named(cheapest),
                cheapest_seconds=nan if cheapest is None else cheapest.wall_seconds,
                spent=advice.spent,
                reason=advice.reason,
            )


def named(row: FrontierRow) -> str:
    """A run in words."""
    return f"{row.model}, {row.scheme}, {row.resolution}"


def row_like(frontier: Frontier, model: str, scheme: str, scene: Scene) -> FrontierRow | None:
    """The comparison's row of the run that was advised; None where it has none."""
    from ellipsoid_coupling.models import resolution_text

    text = resolution_text(model, scheme, scene, scene.particles.realisations)
    same = [row for row in frontier.rows if (row.model, row.scheme) == (model, scheme)]
    return next((row for row in same if row.resolution == text), None)


def cheapest_of(frontier: Frontier, quantity: Kind, error: float) -> FrontierRow | None:
    """The cheapest run of a comparison that keeps an error; None without one."""
    below = [row for row in frontier.rows if largest_error(row, quantity) <= error]
    return min(below, key=lambda row: row.wall_seconds, default=None)


def main(arguments: Sequence[str] | None = None) -> Path:
    """Ask and compare; returns the folder with the results."""
    parser = argparse.ArgumentParser(description="advice against full comparisons")
    parser.add_argument("--quick", action="store_true", help="one tiny scene")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), metavar="NAME")
    parser.add_argument("--longest", type=float, default=LONGEST, help="seconds of a compared run")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="budget of the advice")
    parser.add_argument("--out", type=Path, help="folder of the results")
    options = parser.parse_args(arguments)
    folder = options.out or Path("results") / time.strftime("advice-%Y%m%d-%H%M%S")
    folder.mkdir(parents=True, exist_ok=True)
    cases = QUICK if options.quick else {name: CASES[name] for name in options.cases}
    verdicts: list[Verdict] = []
    with ProgressReporter("advice") as report:
        for case, (name, settings) in cases.items():
            scene = load_scene(name, settings)
            flow = scene_flow(scene, None, report)
            try:
                frontier = run_frontier(scene, flow, longest=options.longest, report=report)
            except RunError as error:
                sys.stderr.write(f"{case} is left out: {error}\n")
                continue
            asked = {"seconds": options.seconds, "report": report}
            errors = QUICK_ERRORS if options.quick else ERRORS
            verdicts += judged(case, scene, flow, frontier, errors, **asked)
            # After each case, so that its results survive an interruption.
            write(verdicts, folder)
    sys.stdout.write(f"{summary(verdicts)}\n{folder}\n")
    return Path(folder)


def summary(verdicts: Sequence[Verdict]) -> str:
    """How many promises were kept, and what they cost, in a sentence."""
    checked = [one for one in verdicts if one.promised and not math.isnan(one.found)]
    kept = sum(one.kept for one in checked)
    ratios = [one.cost_ratio for one in checked if not math.isnan(one.cost_ratio)]
    within = sum(ratio <= 2.0 for ratio in ratios)
    missed = sum(not one.promised and bool(one.cheapest) for one in verdicts)
    return (
        f"{len(verdicts)} questions, {len(checked)} promises that were checked, {kept} of them kept; "
        f"{within} of {len(ratios)} cost at most twice the cheapest, the largest ratio is "
        f"{max(ratios, default=math.nan):.2g}; {missed} times nothing was promised though some run keeps "
        "the error."
    )


def write(verdicts: Sequence[Verdict], folder: Path) -> None:
    """advice.csv, advice.md and advice.png."""
    with (
        whole_file(folder / "advice.csv") as beside,
        beside.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for one in verdicts:
            further = {"kept": one.kept, "cost_ratio": one.cost_ratio}
            numbers = {
                k: f"{v:.4g}" if isinstance(v, float) else v for k, v in one._asdict().items()
            }
            writer.writerow(numbers | further)
    with whole_file(folder / "advice.md") as beside:
        beside.write_text(markdown(verdicts), encoding="utf-8")
    marks = [
        AdviceMark(one.error, one.expected, one.found, one.cost_ratio, one.case, one.quantity)
        for one in verdicts
        if one.promised and not math.isnan(one.found)
    ]
    if marks:
        draw_advice(marks, folder / "advice.png", title="Promised errors, and what they cost")


MARKDOWN = (
    "case",
    "error of",
    "at most",
    "advised",
    "expected",
    "found",
    "s",
    "cheapest s",
    "ratio",
)


def rows(verdicts: Sequence[Verdict]) -> list[tuple[str, ...]]:
    """Texts under `MARKDOWN`."""
    return [
        (
            f"`{one.case}`",
            one.quantity,
            f"{one.error:.0%}",
            f"{one.model}, {one.scheme}, {one.resolution}"
            if one.promised
            else f"no promise: {one.reason}",
            f"{one.expected:.2g}" if one.promised else "",
            f"{one.found:.2g}" if one.promised else "",
            f"{one.seconds:.2g}" if one.promised else "",
            f"{one.cheapest_seconds:.2g}" if one.cheapest else "none",
            f"{one.cost_ratio:.2g}" if one.promised and one.cheapest else "",
        )
        for one in verdicts
    ]


def markdown(verdicts: Sequence[Verdict]) -> str:
    """The table and the summary."""
    lines = [MARKDOWN, ["---"] * len(MARKDOWN), *rows(verdicts)]
    text = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    return f"{text}\n{summary(verdicts)}\n"


if __name__ == "__main__":
    run_in_words(main)

"""`advise`: probe every model and scheme, the cheapest runs first, and recommend one.

The levels are those of `compare` (`compare.resolutions`). The next run is always the one that is expected
to take least, over all models and schemes: what first keeps the error is then about the cheapest that does,
and all runs before it together cost a few times as much as it does. A model is left behind as soon as
none of its levels can keep the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.compare.advice.answer import Advice, AdviceRow, row_of, why_not
from ellipsoid_coupling.compare.advice.budget import Budget
from ellipsoid_coupling.compare.advice.command import Asked, asked_for
from ellipsoid_coupling.compare.advice.expected import Course, Judge
from ellipsoid_coupling.compare.advice.reference import find_reference, noise_group
from ellipsoid_coupling.compare.cheapest import KINDS, Kind
from ellipsoid_coupling.compare.error_budget import bin_result
from ellipsoid_coupling.compare.frontier import (
    LevelRun,
    fitting_refinements,
    frontier_models,
    group_size,
)
from ellipsoid_coupling.compare.timing import Bench, Stopped
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.scenes import Scene, load_scene
from ellipsoid_coupling.simulation import Report, scene_flow

SECONDS = 60.0
# Errors are below 2; below this one nothing is told apart on the bins.
_LEAST_ERROR, _NO_OVERLAP = 1e-6, 2.0
# Probing goes on to runs that are expected to take so much longer than the cheapest that keeps the error:
# predictions from coarse runs are rough.
_FURTHER = 2.0
# A run may take so many times what it was expected to, the first of a course this part of what is left.
_LATE, _FIRST_PART = 4.0, 0.125
# So many runs tell whether a course can keep the error at all.
_TELLING = 3


def advise(
    scene: Scene | str | Path,
    *,
    error: float,
    quantity: Kind = "density",
    seconds: float = SECONDS,
    flow: FlowField | str | Path | None = None,
    asked: Asked | None = None,
    report: Report | None = None,
) -> Advice:
    """Which model, scheme and resolution keep an error at the least cost, by short runs.

    Parameters
    ----------
    scene : Scene, name or file
    error : float
        The largest L1 distance over the saved times, to the exact solution or the limit of infinitely many
        particles, on 20 x 20 cells or 60 angles; 2 is no overlap.
    quantity : "density" or "angle"
    seconds : float
        What all short runs together may take, compiling aside.
    flow : FlowField, path or None
        Replaces the scene's own.
    asked : Asked, optional
        How the command line of the answer names the scene.
    report : callable, optional
        Called with the stage and its finished part.

    Raises
    ------
    InputError
        For numbers out of range, or if no model fits the scene.
    RunError
        If not even the coarsest reference comes to its end within the seconds.
    """
    check_asked(error, quantity, seconds)
    if not isinstance(scene, Scene):
        asked = asked or Asked(str(scene))
        scene = load_scene(scene)
    bench = Bench(scene_flow(scene, flow, report), 0, seconds, report)
    budget = Budget(seconds)
    refinements, left_out = fitting_refinements(scene, frontier_models(), bench)
    reference = find_reference(scene, error, quantity, bench, budget)
    judge = Judge(reference, quantity)
    courses = [Course(refinement) for refinement in refinements]
    probe(courses, judge, error, bench, budget)
    rows, silent = _rows(courses, judge, error)
    best = rows[0] if rows else None
    promised = best is not None and best.promised
    return Advice(
        scene=scene,
        error=error,
        quantity=quantity,
        seconds=seconds,
        spent=budget.spent,
        reference=f"{reference.name}, {reference.resolution}",
        reference_error=judge.doubt,
        rows=rows,
        left_out=(*left_out, *silent),
        best=best,
        reason="" if promised else why_not(rows, judge, error, seconds),
        asked=asked or asked_for(scene),
    )


def check_asked(error: float, quantity: str, seconds: float) -> None:
    """InputError for an error, a quantity or seconds out of range; no flow is needed for that."""
    if not _LEAST_ERROR <= error < _NO_OVERLAP:
        expected = f"from {_LEAST_ERROR:g} to below 2, an L1 distance"
        raise InputError("--error", expected, f"{error:g}", "Example: --error 0.03.")
    if quantity not in KINDS:
        raise InputError("--quantity", " or ".join(KINDS), repr(quantity), "Change it.")
    if not 0.0 < seconds < math.inf:
        raise InputError("--seconds", "finite seconds above 0", f"{seconds:g}", "Change it.")


def _rows(
    courses: Sequence[Course], judge: Judge, error: float
) -> tuple[tuple[AdviceRow, ...], list[tuple[str, str]]]:
    """The rows, the best first; and the courses that told nothing, with the reason."""
    rows: list[AdviceRow] = []
    silent: list[tuple[str, str]] = []
    for course in courses:
        row = row_of(course, judge, error)
        if row is None:
            name = f"{course.refinement.model}, {course.refinement.scheme}"
            silent.append((name, course.ended or "not reached within the seconds"))
        else:
            rows.append(row)

    def place(row: AdviceRow) -> tuple[bool, float]:
        return not row.promised, row.seconds.value if row.promised else row.error.value

    return tuple(sorted(rows, key=place)), silent


def probe(
    courses: Sequence[Course], judge: Judge, error: float, bench: Bench, budget: Budget
) -> None:
    """Run levels of the courses, the cheapest first, until more would not help or the budget is used.

    courses : are carried on in place
    """
    while waiting := [course for course in courses if course.next_level is not None]:
        course = min(waiting, key=_predicted)
        predicted = _predicted(course)
        cheapest = _cheapest(courses, judge, error)
        if cheapest is not None and predicted > _FURTHER * cheapest:
            return
        if predicted > budget.left or budget.left == 0.0:
            # All others take longer still.
            for one in waiting:
                one.ended = "finer resolutions take more than the seconds that are left"
            return
        _run_next(course, bench, budget)
        with budget.counting():
            _end_if_hopeless(course, judge, error)


def _predicted(course: Course) -> float:
    """Seconds of the next level; 0 where nothing was run yet."""
    found = course.seconds(len(course.runs))
    return 0.0 if found is None else found.value


def _cheapest(courses: Sequence[Course], judge: Judge, error: float) -> float | None:
    """Seconds of the cheapest run so far that keeps the error."""
    found = []
    for course in courses:
        for number in range(len(course.runs)):
            expected, seconds = judge.error(course, number), course.seconds(number)
            if expected is not None and seconds is not None and expected.high <= error:
                found.append(seconds.value)
    return min(found, default=None)


def _run_next(course: Course, bench: Bench, budget: Budget) -> None:
    level, refinement = course.next_level, course.refinement
    assert level is not None
    predicted = _predicted(course)
    allowed = _LATE * predicted if predicted > 0.0 else _FIRST_PART * budget.left
    try:
        timed = budget.run(bench, refinement, level, allowed, once=False)
    except InputError as failure:
        course.ended = str(failure)
        return
    except Stopped as failure:
        course.ended = f"takes too long: {failure}"
        return
    except RunError as failure:
        course.runs.append(LevelRun(level, None, None, f"failed: {failure}"))
        if course.finest is None and len(course.runs) == _TELLING:
            course.ended = f"failed: {failure}"
        return
    group = group_size(refinement.kind, level.scene, noise_group(level.scene))
    with budget.counting():
        bins = bin_result(timed.result, group)
    course.runs.append(LevelRun(level, timed.without_arrays(), bins, "completed"))


def _end_if_hopeless(course: Course, judge: Judge, error: float) -> None:
    """End a course whose levels, those to come included, are all expected to miss the error."""
    done = [run for run in course.runs if run.bins is not None]
    if len(done) < _TELLING or course.ended:
        return
    expected = [judge.error(course, k) for k in range(len(course.refinement.levels))]
    if all(one is None or one.low > error for one in expected):
        course.ended = "no resolution keeps it"

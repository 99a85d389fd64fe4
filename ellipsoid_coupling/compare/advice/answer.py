"""What the adviser answers: a row for each model and scheme, and the one that it recommends."""

from __future__ import annotations

from dataclasses import dataclass

from ellipsoid_coupling.compare.advice.command import Asked, command_line, differences
from ellipsoid_coupling.compare.advice.expected import Course, Interval, Judge
from ellipsoid_coupling.compare.cheapest import Kind
from ellipsoid_coupling.models import resolution_text
from ellipsoid_coupling.scenes import Scene

_OFF = "no: modelling error of"


@dataclass(frozen=True)
class AdviceRow:
    """One model and scheme at the resolution that serves best.

    Attributes
    ----------
    model, scheme, resolution : str
    scene : Scene
        With that resolution.
    error, seconds : Interval
        Expected; of what was run itself the seconds are measured, and the error is, but for the reference.
    measured : bool
        Whether this very resolution was run.
    promised : bool
        Whether the whole interval of the error is at most the error asked for.
    verdict : str
    """

    model: str
    scheme: str
    resolution: str
    scene: Scene
    error: Interval
    seconds: Interval
    measured: bool
    promised: bool
    verdict: str


@dataclass(frozen=True)
class Advice:
    """Which model, scheme and resolution to take for an error.

    Attributes
    ----------
    scene : Scene
        As it was given.
    error : float
        Asked for: the largest L1 distance over the saved times.
    quantity : "density" or "angle"
    seconds, spent : float
        The budget of the probing, and what of it was used.
    reference : str
        What errors were measured against.
    reference_error : float
        How far that may be off.
    rows : tuple of AdviceRow
        One for each model and scheme that could be run, those that are promised first, the cheapest first.
    left_out : tuple of (model, why)
        Models that refuse the scene, and those that told nothing.
    best : AdviceRow or None
        The cheapest of those that are promised; else the one that comes closest, if there is one.
    reason : str
        Why `best` is no promise; "" where it is one.
    asked : Asked
        How the command names the scene.
    """

    scene: Scene
    error: float
    quantity: Kind
    seconds: float
    spent: float
    reference: str
    reference_error: float
    rows: tuple[AdviceRow, ...]
    left_out: tuple[tuple[str, str], ...]
    best: AdviceRow | None
    reason: str
    asked: Asked

    @property
    def promised(self) -> bool:
        """Whether `best` keeps the error, as far as the probing tells."""
        return self.best is not None and self.best.promised

    @property
    def command(self) -> str:
        """The command line that runs `best`; "" without one."""
        if self.best is None:
            return ""
        best = self.best
        values = differences(self.scene, best.scene)
        realisations = best.scene.particles.realisations
        return command_line(self.asked, best.model, best.scheme, values, realisations)


def row_of(course: Course, judge: Judge, error: float) -> AdviceRow | None:
    """The cheapest level that can be promised, else the one with the least expected error."""
    known = []
    for number in range(len(course.refinement.levels)):
        expected, seconds = judge.error(course, number), course.seconds(number)
        if expected is not None and seconds is not None:
            known.append((number, expected, seconds))
    promised = [one for one in known if one[1].high <= error]
    if promised:
        chosen = min(promised, key=lambda one: one[2].value)
    elif known:
        chosen = min(known, key=lambda one: (one[1].value, one[2].value))
    else:
        return None
    number, expected, seconds = chosen
    refinement, level = course.refinement, course.refinement.levels[number]
    text = resolution_text(
        refinement.model, refinement.scheme, level.scene, level.scene.particles.realisations
    )
    measured = number < len(course.runs)
    return AdviceRow(
        model=refinement.model,
        scheme=refinement.scheme,
        resolution=text,
        scene=level.scene,
        error=expected,
        seconds=seconds,
        measured=measured,
        promised=bool(promised),
        verdict=_verdict(course, judge, error, expected, measured),
    )


def _verdict(course: Course, judge: Judge, error: float, expected: Interval, measured: bool) -> str:
    """In words: whether the error is kept, and why not."""
    if expected.high <= error:
        return "keeps it" if measured else "will keep it, extrapolated"
    if judge.doubt >= error:
        return f"unknown: so is the reference, to {judge.doubt:.2g}"
    floor = judge.floor(course)
    if floor is not None and floor.low > error:
        return f"{_OFF} {floor.value:.2g}"
    if expected.low > error:
        return f"no: {course.ended or 'not even its finest resolution'}"
    return "may keep it"


def why_not(rows: tuple[AdviceRow, ...], judge: Judge, error: float, seconds: float) -> str:
    """Why none of some rows can be promised."""
    doubt = judge.doubt
    if doubt >= error:
        return (
            f"within {seconds:g} s the reference itself is only known to {doubt:.2g}: "
            f"ask for more than that, or give more --seconds"
        )
    may = [row for row in rows if row.error.low <= error]
    if may:
        return "what may keep it is not certain to: more --seconds tell more"
    off = {row.model for row in rows if row.verdict.startswith(_OFF)}
    if rows and off == {row.model for row in rows}:
        return "every model that was probed has a modelling error above it"
    return "no resolution that was looked at keeps it"

"""Which run to choose: the Pareto front of error and run time, and the cheapest below an error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar

Kind = Literal["density", "angle"]
KINDS: tuple[Kind, ...] = ("density", "angle")
TARGETS = (0.10, 0.03, 0.01)


class ErrorRow(Protocol):
    """One run: its model and resolution, its seconds, and its errors at the saved times."""

    @property
    def model(self) -> str:
        """Name of the model."""

    @property
    def scheme(self) -> str:
        """Name of the scheme."""

    @property
    def resolution(self) -> str:
        """In words, such as "h = 0.01"."""

    @property
    def density_errors(self) -> tuple[float, ...]:
        """One a saved time, NaN for a failed run."""

    @property
    def angle_errors(self) -> tuple[float, ...]:
        """One a saved time, NaN for a failed run."""

    @property
    def wall_seconds(self) -> float:
        """Without compiling."""


Row = TypeVar("Row", bound=ErrorRow)


class Choice(NamedTuple, Generic[Row]):
    """The cheapest run with an error of at most `target`.

    row : None where nothing reaches it
    best : the run with the least error of all; None where no run came to its end
    """

    kind: Kind
    target: float
    row: Row | None
    best: Row | None


def largest_error(row: ErrorRow, kind: Kind) -> float:
    """The largest L1 error over the saved times; NaN for a run without one."""
    errors = row.density_errors if kind == "density" else row.angle_errors
    return float("nan") if any(map(math.isnan, errors)) else max(errors)


def pareto_front(rows: Sequence[Row], kind: Kind) -> list[Row]:
    """The runs that no other one beats in both time and error, by rising time."""
    done = [row for row in rows if not math.isnan(largest_error(row, kind))]
    front: list[Row] = []
    for row in sorted(done, key=lambda row: (row.wall_seconds, largest_error(row, kind))):
        if not front or largest_error(row, kind) < largest_error(front[-1], kind):
            front.append(row)
    return front


def choose(rows: Sequence[Row], kind: Kind) -> list[Choice[Row]]:
    """The cheapest run for each of `TARGETS`: the first of the Pareto front below it."""
    front = pareto_front(rows, kind)
    best = front[-1] if front else None
    choices: list[Choice[Row]] = []
    for target in TARGETS:
        below = (row for row in front if largest_error(row, kind) <= target)
        choices.append(Choice(kind, target, next(below, None), best))
    return choices

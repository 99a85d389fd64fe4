"""What a value of a scene file may be: numbers in range, intervals, points, names and paths."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
)

from ellipsoid_coupling.files.limits import (
    LARGEST_NUMBER,
    MOST_COUNT,
    MOST_LINE,
    MOST_NAME,
    MOST_PATH,
    SMALLEST_NUMBER,
)

_JOINERS = dict.fromkeys(map(ord, "\u200c\u200d"))


def _in_range(value: float) -> float:
    """Refuse numbers whose products leave double precision."""
    if value != 0.0 and not SMALLEST_NUMBER <= abs(value) <= LARGEST_NUMBER:
        raise ValueError(f"a size between {SMALLEST_NUMBER:g} and {LARGEST_NUMBER:g}, or 0")
    return value


def _one_line(text: str) -> str:
    # Letters may be joined (emoji, Persian) by characters that are not printable alone.
    if not text.translate(_JOINERS).isprintable():
        raise ValueError("one line of printable characters")
    return text


def _no_zero(path: str) -> str:
    if "\0" in path:
        raise ValueError("a path without zero bytes")
    return path


def file_name(name: str) -> str:
    """Refuse names that would lead a folder named after them elsewhere, or nowhere."""
    if not re.fullmatch(r"\w[\w .+()=-]*", name) or len(name.encode()) > MOST_NAME:
        raise ValueError(
            f"a name of at most {MOST_NAME} letters, digits, '_', '-', '.' or spaces "
            "that starts with a letter or digit, as folders are named after it"
        )
    return name


def _listed(value: object) -> object:
    """A single number stands for the list of it."""
    return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _flow_time(value: object) -> object:
    """Refuse in one line what is none of several kinds; each of them is checked behind this."""
    pair = isinstance(value, list | tuple) and len(value) == 2
    parts = list(value) if isinstance(value, list | tuple) else [value]
    numbers = all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts)
    if value not in ("latest", "all") and not (numbers and (pair or parts == [value])):
        raise ValueError('"latest", "all", a time, or [t_0, t_1]')
    return value


Number = Annotated[float, AfterValidator(_in_range)]
Positive = Annotated[float, Field(gt=0), AfterValidator(_in_range)]
NotNegative = Annotated[float, Field(ge=0), AfterValidator(_in_range)]
Count = Annotated[int, Field(ge=1, le=MOST_COUNT)]
Interval = Annotated[tuple[Number, Number], Strict(False)]
FlowTime = Annotated[Literal["latest", "all"] | Number | Interval, BeforeValidator(_flow_time)]
Line = Annotated[str, Field(max_length=MOST_LINE), AfterValidator(_one_line)]
# As systems allow them: letters of any kind, tabs and line ends included.
PathText = Annotated[str, Field(min_length=1, max_length=MOST_PATH), AfterValidator(_no_zero)]
Point = Annotated[tuple[Number, ...], Strict(False), Field(min_length=2, max_length=3)]
Points = Annotated[tuple[Point, ...], Strict(False), Field(min_length=1)]
Times = Annotated[
    tuple[Positive, ...], Strict(False), Field(min_length=1), BeforeValidator(_listed)
]
Names = Annotated[tuple[Line, ...], Strict(False), Field(min_length=1)]


def require_interval(name: str, interval: Interval) -> None:
    """Refuse, with ValueError, an interval that is empty or as narrow as rounding."""
    low, high = interval
    if not low < high:
        raise ValueError(f"{name} = [low, high] with low < high")
    # Else cells and particles would have no room between the numbers that there are.
    if not high - low > 1e-9 * max(abs(low), abs(high)):
        raise ValueError(f"{name} = [low, high] that differ by more than rounding")


class Part(BaseModel):
    """Common rules: unknown keys, wrong types, NaN and infinity are errors; nothing changes later."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

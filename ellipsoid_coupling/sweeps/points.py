"""The points of a sweep: one run each, at one value of every parameter."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes import parse_setting
from ellipsoid_coupling.scenes.files import table_to_toml

# Longer lists name their runs by the number alone, so that folders have names that systems allow.
_LONGEST_LABEL = 60
_OPENING, _CLOSING = "[{", "]}"


class Point(NamedTuple):
    """One run of a sweep.

    Attributes
    ----------
    number : int
        In the sweep, from 0 on.
    name : str
        Of its run folder.
    place : tuple of int
        Its index along each dimension of results.nc.
    model : str
    settings : dict
        Values of the scene that the sweep changes, by dotted key.
    seed : int
    numbers : range or None
        Of its realisations; None for the scene's own.
    """

    number: int
    name: str
    place: tuple[int, ...]
    model: str
    settings: dict[str, object]
    seed: int
    numbers: range | None


def split_values(text: str) -> tuple[str, tuple[str, ...]]:
    """Split ``key=a,b,c`` at the commas that stand in no brackets or quotes.

    Raises
    ------
    InputError
        Without a key or a value.
    """
    key, equals, values = text.partition("=")
    parts = [part.strip() for part in _at_commas(values)]
    if not equals or not key.strip() or "" in parts:
        raise InputError(
            "--set", "key=value,value,...", repr(text), "Example: --set noise.noise=0,0.5,1."
        )
    return key.strip(), tuple(parts)


def _at_commas(text: str) -> list[str]:
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        else:
            depth += (letter in _OPENING) - (letter in _CLOSING)
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def value_text(value: object) -> str:
    """A value as `parse_setting` reads it back: TOML, or none for a part that is taken out."""
    if value is None:
        return "none"
    if hasattr(value, "tolist"):  # numpy's numbers and arrays
        value = value.tolist()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{value_text(k)} = {value_text(v)}" for k, v in value.items())
        return f"{{{inner}}}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(value_text, value))}]"
    return table_to_toml({"value": value}).strip().partition(" = ")[2]


def parsed(key: str, text: str) -> object:
    """The value of a text of `value_text`, or of the command line."""
    return parse_setting(f"{key}={text}")[1]


def coordinate(key: str, texts: Sequence[str]) -> list[float] | list[str]:
    """The values of a parameter for an axis: numbers where all of them are, else their texts."""
    values = [parsed(key, text) for text in texts]
    numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    if len(numbers) == len(values):
        return list(numbers)
    return [v if isinstance(v, str) else text for v, text in zip(values, texts, strict=True)]


def run_name(index: int, count: int, model: str, labels: Sequence[tuple[str, str]]) -> str:
    """The name of a point's run folder: number, model, and what it has of its own, if that is short."""
    number = f"{index:0{len(str(count - 1))}d}-{model}"
    label = "".join(f"-{key.rpartition('.')[2]}={text}" for key, text in labels)
    label = re.sub(r"[^\w.+=-]", "_", label, flags=re.ASCII)
    return number + label if len(label) <= _LONGEST_LABEL else number

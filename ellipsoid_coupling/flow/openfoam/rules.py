"""Rules that a dictionary's entries must meet; each writes its entry anew from the values read.

    RULES = {"solver": choice("PCG", "GAMG"), "tolerance": real(0.0, 1.0)}
    entries(section, RULES)  ->  ["solver PCG;", "tolerance 1e-06;"]

A rule gets a section and the name of an entry, and returns the entry's value as text. That text is made
of the rule's own words and of numbers: nothing of a file is copied.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TypeVar

from ellipsoid_coupling.flow.openfoam.dictionary import (
    Column,
    Group,
    Item,
    Number,
    Section,
    Text,
    Units,
    Word,
)
from ellipsoid_coupling.flow.openfoam.patterns import matches

# Gives the value's text; None for an entry that is known, but of no use to the solver.
Rule = Callable[[Section, str], str | None]
Rules = Mapping[str, "Rule | Rules"]

Kind = TypeVar("Kind", bound=Item)

# A patch or zone is called as the case calls it; such a word stands for nothing but itself.
PATCH_NAME = re.compile(r"[A-Za-z_][\w.:+-]*", re.ASCII)
_SHOWN = 20


def entries(section: Section, rules: Rules) -> list[str]:
    """All entries of a section as lines of text; InputError for an unknown one.

    Of the numbers of system/parameters, where the file includes that, those that are entries here.
    """
    lines: list[str] = []
    included = {key: (n,) for key, n in section.included.items() if callable(rules.get(key))}
    for key, value in (included | section.entries).items():
        rule = rules.get(key)
        if rule is None:
            raise section.error(section.places[key], one_of(rules, "an entry"), f"the entry {key}")
        if not callable(rule):
            inner = entries(subsection(section, key), rule)
            lines += braces(key, inner) if rule is not HEADER else []
        elif isinstance(value, Section):
            raise section.error(section.places[key], f"a value of {key}", "a dictionary")
        else:
            text = rule(section, key)
            lines += [] if text is None else [f"{key} {text};"]
    return lines


def one_of(known: Mapping[str, object] | frozenset[str], what: str) -> str:
    """Words for a message: "an entry of those known (a, b, c)"."""
    names = sorted(known)
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"{what} of those known ({', '.join(names[:_SHOWN])}{more})"


def braces(name: str, lines: list[str]) -> list[str]:
    """Lines of a dictionary of that name."""
    return [name, "{", *(f"    {line}" for line in lines), "}"]


def subsection(section: Section, key: str) -> Section:
    """The dictionary that an entry is; InputError for another value, or none."""
    value = section.entries.get(key)
    if not isinstance(value, Section):
        found = "none" if value is None else "a value"
        raise section.error(section.places.get(key, section.at), f"a dictionary {key}", found)
    return value


def without_patterns(
    section: Section, names: Iterable[str], settled: frozenset[str] = frozenset()
) -> Section:
    """The section, and those in it, with names for patterns: "(U|k)" stands for U and k.

    As in OpenFOAM, a name's own entry counts before all patterns, and the last pattern that fits counts.

    names : those that matter
    settled : those that no pattern may stand for

    Raises InputError for a pattern that is not read here.
    """
    names = tuple(names)
    inner = {
        key: without_patterns(value, names, settled) if isinstance(value, Section) else value
        for key, value in section.entries.items()
    }
    places, own = dict(section.places), inner.keys() | settled
    for pattern in [key for key in inner if key.startswith('"')]:
        value = inner.pop(pattern)
        for name in names:
            try:
                fits = name not in own and matches(pattern.strip('"'), name)
            except ValueError as error:
                expected = "a pattern that is read here"
                raise section.error(places[pattern], expected, f"{pattern} ({error})") from None
            if fits:
                inner[name], places[name] = value, places[pattern]
    return replace(section, entries=inner, places=places)


def items_of(section: Section, key: str) -> tuple[Item, ...]:
    """The values of an entry, taken from system/parameters where the file includes that."""
    value = section.entries.get(key, ())
    if not value and key in section.included:
        return (section.included[key],)
    if not value or isinstance(value, Section):
        raise section.error(section.places.get(key, section.at), f"an entry '{key} VALUE;'", "none")
    return value


def one(section: Section, key: str, kind: type[Kind], what: str) -> Kind:
    """The single value of an entry, which must be of that kind."""
    items = items_of(section, key)
    if len(items) == 1 and isinstance(items[0], kind):
        return items[0]
    raise section.error(items[0].at, what, _shown(items))


def _shown(items: tuple[Item, ...]) -> str:
    texts = [item.text for item in items if isinstance(item, (Word, Text))]
    texts += [f"{item.value:g}" for item in items if isinstance(item, Number)]
    return " ".join(texts[:_SHOWN]) or "another value"


def figure(value: float) -> str:
    """A number as text that gives the same number again; whole ones stay whole."""
    return str(value) if isinstance(value, int) else repr(float(value))


def name_of(section: Section, text: str, at: int) -> str:
    """A name that the case has chosen; InputError for other than letters, digits and _ . : + -."""
    if not PATCH_NAME.fullmatch(text):
        raise section.error(at, "a name of letters, digits and _.:+-, a letter first", repr(text))
    return text


def choice(*known: str) -> Rule:
    """One of these words."""

    def rule(section: Section, key: str) -> str:
        word = one(section, key, Word, f"{key} {' or '.join(known)}")
        if word.text not in known:
            raise section.error(word.at, f"{key} {' or '.join(known)}", word.text)
        return word.text

    return rule


switch = choice("yes", "no", "on", "off", "true", "false")


def real(low: float, high: float) -> Rule:
    """A number from `low` to `high`."""

    def rule(section: Section, key: str) -> str:
        return figure(real_of(section, key, low, high))

    return rule


def real_of(section: Section, key: str, low: float, high: float) -> float:
    """The number of an entry; InputError for one that is not from `low` to `high`."""
    expected = f"a number {key} from {low:g} to {high:g}"
    number = one(section, key, Number, expected)
    if not low <= number.value <= high:
        raise section.error(number.at, expected, f"{number.value:g}")
    return number.value


def whole(low: int, high: int) -> Rule:
    """A whole number from `low` to `high`."""

    def rule(section: Section, key: str) -> str:
        return str(whole_of(section, key, low, high))

    return rule


def whole_of(section: Section, key: str, low: int, high: int) -> int:
    """The whole number of an entry; InputError for another."""
    value = real_of(section, key, low, high)
    if value != int(value):
        raise section.error(items_of(section, key)[0].at, f"a whole number {key}", f"{value:g}")
    return int(value)


def words_of(known: frozenset[str], what: str) -> Rule:
    """Some of these words, and numbers: Gauss limitedLinear 1."""

    def rule(section: Section, key: str) -> str:
        parts: list[str] = []
        for item in items_of(section, key):
            if isinstance(item, Word) and item.text in known:
                parts.append(item.text)
            elif isinstance(item, Number):
                parts.append(figure(item.value))
            else:
                raise section.error(item.at, one_of(known, what), _shown((item,)))
        return " ".join(parts)

    return rule


def words(*known: str) -> Rule:
    """A list of exactly these words."""

    def rule(section: Section, key: str) -> str:
        expected = f"({' '.join(known)})"
        group = one(section, key, Group, expected)
        if [item.text if isinstance(item, Word) else "" for item in group.items] != list(known):
            raise section.error(group.at, expected, _shown(group.items))
        return expected

    return rule


def dropped(_section: Section, _key: str) -> None:
    """Known, and of no use to the solver: it is left out."""


# Every file gets a header of the package's own.
HEADER: Rules = {
    "format": choice("ascii", "binary"),
    **dict.fromkeys(("version", "class", "location", "object", "note", "arch"), dropped),
}


def require_units(section: Section, units: Units, exponents: tuple[float, ...]) -> None:
    """InputError unless dimensions are these."""
    if units.exponents[:3] != exponents or any(units.exponents[3:]):
        found = " ".join(f"{part:g}" for part in units.exponents)
        expected = " ".join(f"{part:g}" for part in exponents)
        raise section.error(units.at, f"dimensions [{expected} 0 0 0 0]", f"[{found}]")


def triple(section: Section, item: Item, low: float, high: float) -> list[float]:
    """(x y z), each from `low` to `high`."""
    parts = item.items if isinstance(item, Group) else ()
    numbers = [part.value for part in parts if isinstance(part, Number)]
    if len(parts) != 3 or len(numbers) != 3 or not all(low <= x <= high for x in numbers):
        raise section.error(
            item.at, f"three numbers (x y z) from {low:g} to {high:g}", "another value"
        )
    return numbers


def listed(values: Column) -> str:
    """A list of numbers or of triples as text."""
    width = values.values.shape[1]
    rows = (" ".join(map(repr, row)) for row in values.values.tolist())
    inner = "\n".join(f"({row})" if width > 1 else row for row in rows)
    kind = "scalar" if width == 1 else "vector"
    return f"nonuniform List<{kind}> {len(values.values)}\n(\n{inner}\n)"

"""A strict parser of OpenFOAM's dictionaries: plain values, or a refusal with file and line.

    nu      [0 2 -1 0 0 0 0] 0.1;  // comment    ->  nu: (Units, Number 0.1)
    solver  PCG;                                 ->  solver: (Word PCG,)
    faces   ((0 4 7 3));                         ->  faces: (Group (Group (Number 0, ...)),)
    lid     { type noSlip; }                     ->  lid: Section
    value   nonuniform List<scalar> 2 (1 2);     ->  value: (Word nonuniform, Column (2, 1))

A text that one parser of OpenFOAM's grammar reads as harmless may be code for another. So this parser
accepts very little and refuses all else, and its values are written anew for the solver (`trust`): the
solver gets the values as they were read here.

Three things are worked out while they are read, as the package's own cases need them: the inclusion of
system/parameters, ``$name`` for a number (or ``$name;`` for the entries of a dictionary) read before,
and ``#eval "arithmetic"``.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_NESTING, MOST_PARTS
from ellipsoid_coupling.flow.openfoam import arithmetic
from ellipsoid_coupling.flow.openfoam.scanner import Scanner, Source

_VARIABLE = re.compile(r"\$[A-Za-z]\w*", re.ASCII)
_EVAL = re.compile(r'#eval[ \t]+(?=")')
_INCLUSION = re.compile(r'#include[ \t]+"(?:\.\./system/|system/)?parameters"')
_EXPONENT = re.compile(r"[+-]?[0-9]{1,2}(?:\.[0-9]{0,3})?")
_UNIT = re.compile(r"(?:kg|m|s|K|mol|A|cd)(?:\^[+-]?[0-9]{1,2})?")
_UNITS = ("kg", "m", "s", "K", "mol", "A", "cd")
_LONGEST_UNITS = 100
# A solver's entries are a dozen, with one value each; copies of more would multiply a file.
_MOST_COPIED = 100
# This many characters of a string count as one part.
_TEXT_PART = 10
_WIDTH = {"List<scalar>": 1, "List<vector>": 3}
_IN_A_LIST = frozenset("0123456789+-.eE() \t\r\n")


class Word(NamedTuple):
    """A word, with its parentheses: div(phi,U)."""

    text: str
    at: int


class Text(NamedTuple):
    """The text between double quotes."""

    text: str
    at: int


class Number(NamedTuple):
    """A finite number."""

    value: int | float
    at: int


class Group(NamedTuple):
    """( ... ), with everything in it."""

    items: tuple[Item, ...]
    at: int


class Units(NamedTuple):
    """[ ... ]: the exponents of kg m s K mol A cd."""

    exponents: tuple[float, ...]
    at: int


class Column(NamedTuple):
    """List<...> N ( ... ): (N, width)."""

    values: NDArray[np.float64]
    at: int


@dataclass(frozen=True)
class Section:
    """{ ... } or a whole file.

    entries : the values by name, in their order
    places : at which character each begins
    included : the numbers of system/parameters, if it includes that
    used : of a whole file, the names that a ``$name`` in it has meant
    """

    source: Source
    name: str
    at: int
    entries: dict[str, Value] = field(default_factory=dict)
    places: dict[str, int] = field(default_factory=dict)
    included: dict[str, Number] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)

    def error(self, at: int, expected: str, found: str) -> InputError:
        """An error at a character of the file."""
        return self.source.error(at, expected, found)


Item = Word | Text | Number | Group | Units | Column | Section
Value = tuple[Item, ...] | Section
Parameters = Callable[[], Mapping[str, Number]]


def parse(
    source: Source,
    parameters: Parameters | None = None,
    given: Mapping[str, int] | None = None,
    longest: int = 0,
) -> Section:
    """The values of a dictionary.

    Parameters
    ----------
    parameters : gives the numbers of system/parameters where the file includes that
    given : numbers that replace those of entries at the top
    longest : how many entries a List<...> may have

    Raises InputError, with file and line, for everything that is not in the grammar above.
    """
    parser = _Parser(Scanner(source), parameters, given or {}, longest)
    return parser.whole()


class _Parser:
    """Reads entries and values; `_open` are the dictionaries around the place, outermost first."""

    def __init__(
        self,
        scan: Scanner,
        parameters: Parameters | None,
        given: Mapping[str, int],
        longest: int,
    ) -> None:
        self._scan, self._parameters, self._given = scan, parameters, given
        self._longest = longest
        self._open: list[Section] = []
        self._depth = self._parts = 0

    def whole(self) -> Section:
        root = Section(self._scan.source, "", 0)
        self._open.append(root)
        while self._scan.peek():
            self._entry(root)
        return root

    def _entry(self, section: Section) -> None:
        """One entry of a dictionary: a name and its value, an inclusion, or a dictionary's copy."""
        self._count(1)
        first, start = self._scan.peek(), self._scan.at
        if first == "#":
            self._inclusion(section)
            return
        if first == "$":
            self._copy(section)
            return
        # A pattern keeps its quotes: it is no name, and stands for nothing where names are looked up.
        name = f'"{self._scan.string()}"' if first == '"' else self._scan.word()[0]
        # Entries from ``$name;`` stand before the section, and another entry may replace them.
        if section.places.get(name, -1) >= section.at:
            self._scan.refuse(start, f"a second entry {name}")
        value = self._section(name) if self._scan.peek() == "{" else self._values()
        if section is self._open[0] and name in self._given:
            value = (Number(self._given[name], start),)
        section.entries[name], section.places[name] = value, start

    def _section(self, name: str) -> Section:
        self._deeper(1)
        section = Section(self._scan.source, name, self._scan.at)
        self._scan.need("{")
        self._open.append(section)
        while not self._scan.taken("}"):
            self._entry(section)
        self._open.pop()
        self._deeper(-1)
        return section

    def _deeper(self, step: int) -> None:
        self._depth += step
        if self._depth > MOST_NESTING:
            self._scan.refuse(self._scan.at, f"parts nested more than {MOST_NESTING} deep")

    def _count(self, parts: int) -> None:
        """Refuse a dictionary of more parts than any has: each takes memory, and is looked at."""
        self._parts += parts
        if self._parts > MOST_PARTS:
            self._scan.refuse(self._scan.at, f"more than {MOST_PARTS} entries and values")

    def _values(self) -> tuple[Item, ...]:
        items: list[Item] = []
        while not self._scan.taken(";"):
            items.append(self._item(in_list=False))
        return tuple(items)

    def _inclusion(self, section: Section) -> None:
        """``#include "parameters"``, the one file that is taken in."""
        match = _INCLUSION.match(self._scan.text, self._scan.at)
        if match is None or self._parameters is None or section is not self._open[0]:
            self._scan.odd()
        at, self._scan.at = self._scan.at, match.end()
        for name, number in self._parameters().items():
            # For OpenFOAM the included entry would count, and not the one before it.
            if name in section.entries:
                self._scan.refuse(at, f"a second entry {name}")
            section.included[name] = Number(number.value, at)

    def _copy(self, section: Section) -> None:
        """``$name;``: the entries of a dictionary that stands beside this one."""
        start, name = self._scan.at, self._scan.token(_VARIABLE)[1:]
        self._scan.need(";")
        beside = self._open[-2].entries.get(name) if len(self._open) > 1 else None
        size = _size(beside) if isinstance(beside, Section) else _MOST_COPIED + 1
        if not isinstance(beside, Section) or size > _MOST_COPIED:
            self._scan.refuse(start, f"${name}, where no small dictionary {name} stands before")
        self._count(size)
        for key, value in beside.entries.items():
            if key in section.entries:
                self._scan.refuse(start, f"a second entry {key}")
            section.entries[key], section.places[key] = value, beside.places[key]

    def _item(self, *, in_list: bool) -> Item:
        """A value; in lists, dictionaries with a name are values as well."""
        first, at = self._scan.peek(), self._scan.at
        self._count(1)
        if first == "(":
            return self._group()
        if first == "[":
            return self._units()
        if first == '"':
            text = Text(self._scan.string(), at)
            self._count(_size((text,)))
            return text
        if first == "$":
            return self._variable()
        if first == "#":
            return self._evaluation()
        if first and first in "+-.0123456789":
            return Number(self._scan.number(), at)
        word, at = self._scan.word()
        if word in _WIDTH:
            return self._column(_WIDTH[word])
        return self._section(word) if in_list and self._scan.peek() == "{" else Word(word, at)

    def _group(self) -> Group:
        self._deeper(1)
        at, items = self._scan.at, list[Item]()
        self._scan.need("(")
        while not self._scan.taken(")"):
            items.append(self._item(in_list=True))
        self._deeper(-1)
        return Group(tuple(items), at)

    def _units(self) -> Units:
        """[0 2 -1 0 0 0 0] or [m^2 s^-1]; five numbers stand for seven."""
        at, end = self._scan.at, self._scan.text.find("]", self._scan.at)
        parts = self._scan.text[at + 1 : end].split() if 0 < end - at < _LONGEST_UNITS else []
        exponents = [0.0] * len(_UNITS)
        if len(parts) in (5, 7) and all(_EXPONENT.fullmatch(part) for part in parts):
            exponents[: len(parts)] = (float(part) for part in parts)
        elif parts and all(_UNIT.fullmatch(part) for part in parts):
            for part in parts:
                unit, _, power = part.partition("^")
                exponents[_UNITS.index(unit)] += float(power or 1)
        else:
            self._scan.refuse(at, "dimensions in another form than [0 1 -1 0 0 0 0]")
        self._scan.at = end + 1
        return Units(tuple(exponents), at)

    def _variable(self) -> Number:
        """A number that was read before, in this dictionary, one around it or system/parameters."""
        start = self._scan.at
        name = self._scan.token(_VARIABLE)[1:]
        value = self._known(name)
        if value is None or self._scan.text[self._scan.at : self._scan.at + 1] == "(":
            self._scan.refuse(start, f"${name}, where no number {name} stands before")
        return Number(value.value, start)

    def _known(self, name: str) -> Number | None:
        """The number that ``$name`` means here, if it is one."""
        root = self._open[0]
        root.used.add(name)
        for section in reversed(self._open):
            value = section.entries.get(name)
            if value is not None:
                single = value[0] if isinstance(value, tuple) and len(value) == 1 else None
                return single if isinstance(single, Number) else None
        return root.included.get(name)

    def _evaluation(self) -> Number:
        """``#eval "arithmetic"``, worked out."""
        start = self._scan.at
        match = _EVAL.match(self._scan.text, start)
        if match is None:
            self._scan.odd()
        self._scan.at = match.end()

        def variable(name: str) -> float | None:
            known = self._known(name)
            return None if known is None else float(known.value)

        try:
            tree = arithmetic.parse(self._scan.string(), variable)
            return Number(arithmetic.evaluate(tree), start)
        except arithmetic.ExpressionError as error:
            self._scan.refuse(start, str(error))

    def _column(self, width: int) -> Column:
        """N ( ... ) of numbers or of triples; in a binary file their bytes."""
        self._scan.skip()
        at, count = self._scan.at, self._scan.number()
        if not isinstance(count, int) or not 0 <= count <= self._longest:
            expected = f"a list of 0 to {self._longest} entries, what the mesh has room for"
            raise self._scan.source.error(at, expected, f"{count}")
        if count == 0 and self._scan.peek() != "(":
            return Column(np.zeros((0, width)), at)
        self._scan.need("(")
        header = self._open[0].entries.get("FoamFile")
        if isinstance(header, Section) and word_of(header, "format") == "binary":
            return Column(self._raw(word_of(header, "arch"), count, width), at)
        return Column(self._triples(count, width), at)

    def _raw(self, arch: str, count: int, width: int) -> NDArray[np.float64]:
        """The bytes of a binary list; its header says how long a number is."""
        if arch not in ("", *(f"LSB;label={a};scalar={b}" for a in (32, 64) for b in (32, 64))):
            self._scan.refuse(self._scan.at, f"numbers of another machine, {arch!r}")
        dtype = np.dtype("<f4" if arch.endswith("32") else "<f8")
        start, end = self._scan.at, self._scan.at + count * width * dtype.itemsize
        if end > len(self._scan.text):
            self._scan.refuse(start, f"less than {count} entries")
        self._scan.at = end
        self._scan.need(")")
        values = np.frombuffer(self._scan.text[start:end].encode("latin-1"), dtype)
        if not np.isfinite(values).all():
            self._scan.refuse(start, "numbers that are not finite")
        return values.astype(np.float64).reshape(count, width)

    def _triples(self, count: int, width: int) -> NDArray[np.float64]:
        """The numbers of a list in ascii, up to its last parenthesis."""
        start, behind = self._scan.at, self._scan.text.find(";", self._scan.at)
        text = self._scan.text[start:behind].rstrip() if behind > 0 else ""
        if not text.endswith(")") or not _IN_A_LIST.issuperset(text):
            self._scan.refuse(start, "a list with something else than numbers")
        inner = text[:-1]
        if width > 1:  # (1 2 3) is read as 1 2 3 inf, so that each of them ends where it must
            inner = inner.replace("(", " ").replace(")", " inf ")
        columns = width + (width > 1)
        try:
            with warnings.catch_warnings(action="error", category=DeprecationWarning):
                rows = np.fromstring(inner, np.float64, sep=" ").reshape(count, columns)
        except (ValueError, DeprecationWarning):
            self._scan.refuse(start, f"a list of other than {count} entries of {width} numbers")
        values = np.ascontiguousarray(rows[:, :width])
        if not (np.isfinite(values).all() and np.isinf(rows[:, width:]).all()):
            self._scan.refuse(start, f"a list of other than {count} entries of {width} numbers")
        self._scan.at = behind
        return values


def _size(value: Value) -> int:
    """How many parts a value has, with theirs; a list of numbers has as many as those."""
    if isinstance(value, Section):
        return sum(1 + _size(inner) for inner in value.entries.values())
    size = len(value)
    for item in value:
        if isinstance(item, Section):
            size += _size(item)
        elif isinstance(item, Group):
            size += _size(item.items)
        elif isinstance(item, Column):
            size += item.values.size
        elif isinstance(item, Text):
            size += len(item.text) // _TEXT_PART
    return size


def word_of(section: Section, key: str) -> str:
    """An entry of one word or string; empty without such an entry."""
    value = section.entries.get(key)
    single = value[0] if isinstance(value, tuple) and len(value) == 1 else None
    return single.text if isinstance(single, (Word, Text)) else ""

"""system/blockMeshDict: vertices, blocks, curved edges and patches, checked and written anew."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import Enum
from typing import TypeVar

from ellipsoid_coupling.files.limits import LARGEST_IN_A_CASE
from ellipsoid_coupling.flow.openfoam.dictionary import Group, Item, Number, Section, Word, word_of
from ellipsoid_coupling.flow.openfoam.rules import (
    HEADER,
    Rules,
    braces,
    choice,
    dropped,
    entries,
    figure,
    items_of,
    name_of,
    one,
    real,
    switch,
    triple,
)

PATCH_TYPES: tuple[str, ...] = ("patch", "wall", "empty", "symmetry", "symmetryPlane", "cyclic")


class _Points(Enum):
    """How many points a curve gets between its ends."""

    NONE = 0
    ONE = 1
    MANY = 2


_CURVES = {
    "line": _Points.NONE, "arc": _Points.ONE, "polyLine": _Points.MANY, "spline": _Points.MANY,
    "simpleSpline": _Points.MANY, "BSpline": _Points.MANY,
}  # fmt: skip
_GRADINGS = {"simpleGrading": 3, "edgeGrading": 12}
_CORNERS, _DIRECTIONS = 8, 3
_MOST_CELLS = 10**9
_LEAST_RATIO, _MOST_RATIO = 1e-9, 1e9

Kind = TypeVar("Kind", bound=Item)


def block_mesh(section: Section) -> tuple[list[str], float]:
    """The dictionary as lines, and how many cells it makes.

    Raises InputError for anything that is not of one of the forms below.
    """
    points = len(_list_of(section, "vertices").items)
    blocks = list(_blocks(section, points))

    def vertices(_section: Section, _key: str) -> str:
        return _lines(_point(section, item) for item in _list_of(section, "vertices").items)

    rules: Rules = {
        "FoamFile": HEADER,
        "scale": real(1e-12, 1e12),
        "convertToMeters": real(1e-12, 1e12),
        "fastMerge": switch,
        "vertices": vertices,
        "blocks": lambda _section, _key: _lines(row for row, _ in blocks),
        "edges": lambda part, _key: _lines(_edges(part, points)),
        "boundary": lambda part, _key: _lines(_patches(part, points)),
        "mergePatchPairs": lambda part, _key: _lines(_pairs(part)),
        "defaultPatch": {"name": own_name, "type": choice(*PATCH_TYPES)},
    }
    for needed in ("blocks", "boundary"):
        if not _list_of(section, needed).items:
            raise section.error(
                section.places[needed], f"a list {needed} with something in it", "none"
            )
    return entries(section, rules), sum(cells for _, cells in blocks)


def _lines(rows: Iterable[str]) -> str:
    return "(\n" + "\n".join(rows) + "\n)"


def _list_of(section: Section, key: str) -> Group:
    """The list that an entry is; a number in front of it must be its length."""
    items = items_of(section, key)
    group = items[-1]
    if not isinstance(group, Group) or not _counts(items[:-1], group):
        raise section.error(items[0].at, f"a list {key} ( ... )", "another value")
    return group


def _counts(front: tuple[Item, ...], group: Group) -> bool:
    return not front or (
        len(front) == 1 and isinstance(front[0], Number) and front[0].value == len(group.items)
    )


def _point(section: Section, item: Item) -> str:
    return (
        f"({' '.join(map(figure, triple(section, item, -LARGEST_IN_A_CASE, LARGEST_IN_A_CASE)))})"
    )


def _labels(section: Section, item: Item, count: int | None, below: int) -> list[int]:
    """(a b c ...), whole numbers from 0 on, below `below`."""
    parts = item.items if isinstance(item, Group) else ()
    numbers = [part.value for part in parts if isinstance(part, Number)]
    whole = [value for value in numbers if isinstance(value, int) and 0 <= value < below]
    if len(whole) != len(parts) or not parts or count not in (None, len(parts)):
        expected = f"{count or 'some'} whole numbers below {below} in parentheses"
        raise section.error(item.at, expected, "another value")
    return whole


def _row(values: list[int]) -> str:
    return f"({' '.join(map(str, values))})"


class _Row:
    """Items of a list, taken one after another, each of the kind that must come next."""

    def __init__(self, section: Section, group: Group) -> None:
        self.section, self.left = section, list(reversed(group.items))
        self.end = group.at

    def next(self, kind: type[Kind], what: str) -> Kind:
        """The next item; InputError for one of another kind, or none."""
        if not self.left:
            raise self.section.error(self.end, what, "the end of the list")
        item = self.left.pop()
        if not isinstance(item, kind):
            raise self.section.error(item.at, what, "another value")
        return item

    def word(self, *known: str) -> str:
        """The next item, which must be one of these words."""
        word = self.next(Word, " or ".join(known))
        if word.text not in known:
            raise self.section.error(word.at, " or ".join(known), word.text)
        return word.text

    def labels(self, count: int | None, below: int) -> list[int]:
        """The next item, which must be a list of whole numbers."""
        group = self.next(Group, "whole numbers in parentheses")
        return _labels(self.section, group, count, below)


def _blocks(section: Section, points: int) -> Iterator[tuple[str, float]]:
    """The blocks: hex (8 vertices) [zone] (cells) simpleGrading (...), with their cells."""
    row = _Row(section, _list_of(section, "blocks"))
    while row.left:
        at = row.left[-1].at
        row.word("hex")
        corners = row.labels(_CORNERS, points)
        zone = row.next(Word, "a zone") if row.left and isinstance(row.left[-1], Word) else None
        name = f"{name_of(section, zone.text, zone.at)} " if zone else ""
        counts = row.labels(_DIRECTIONS, _MOST_CELLS)
        if min(counts) < 1:
            raise section.error(at, "at least one cell in every direction", _row(counts))
        grading = row.word(*_GRADINGS)
        ratios = _ratios(section, row.next(Group, "expansion ratios"), _GRADINGS[grading])
        cells = float(counts[0]) * counts[1] * counts[2]
        yield f"hex {_row(corners)} {name}{_row(counts)} {grading} {ratios}", cells


def _ratios(section: Section, group: Group, count: int) -> str:
    """Expansion ratios, or for each direction (length, cells, ratio) of its parts."""
    if len(group.items) != count:
        raise section.error(group.at, f"{count} expansion ratios", f"{len(group.items)}")
    parts: list[str] = []
    for item in group.items:
        if isinstance(item, Group) and item.items:
            inner = (triple(section, part, _LEAST_RATIO, _MOST_RATIO) for part in item.items)
            parts.append("(" + " ".join(f"({' '.join(map(figure, part))})" for part in inner) + ")")
        elif isinstance(item, Number) and _LEAST_RATIO <= item.value <= _MOST_RATIO:
            parts.append(figure(item.value))
        else:
            raise section.error(item.at, "an expansion ratio above 0", "another value")
    return f"({' '.join(parts)})"


def _edges(section: Section, points: int) -> Iterator[str]:
    """The curved edges: arc a b (x y z), and others between two vertices."""
    row = _Row(section, _list_of(section, "edges"))
    while row.left:
        kind = row.word(*_CURVES)
        ends = [row.next(Number, "a vertex") for _ in range(2)]
        start, end = _labels(section, Group(tuple(ends), ends[0].at), 2, points)
        inner = ""
        if _CURVES[kind] is _Points.ONE:
            inner = _point(section, row.next(Group, "a point"))
        elif _CURVES[kind] is _Points.MANY:
            group = row.next(Group, "points")
            inner = f"({' '.join(_point(section, item) for item in group.items)})"
        yield f"{kind} {start} {end} {inner}"


def _patches(section: Section, points: int) -> Iterator[str]:
    """The patches: NAME { type wall; faces ((0 1 2 3) ...); }, one after another."""

    def faces(patch: Section, _key: str) -> str:
        listed = (_row(_labels(patch, item, 4, points)) for item in _list_of(patch, "faces").items)
        return f"({' '.join(listed)})"

    rules: Rules = {
        "type": choice(*PATCH_TYPES), "faces": faces, "inGroups": dropped,
        "neighbourPatch": own_name, "matchTolerance": real(0.0, 1.0),
        "transform": choice("unknown", "noOrdering", "coincidentFullMatch", "translational"),
    }  # fmt: skip
    for patch in _list_of(section, "boundary").items:
        if not isinstance(patch, Section):
            raise section.error(
                patch.at, "a patch: NAME { type ...; faces (...); }", "another value"
            )
        yield from braces(name_of(patch, patch.name, patch.at), entries(patch, rules))


def patch_types(section: Section) -> dict[str, str]:
    """The types of the patches by their names."""
    patches = _list_of(section, "boundary").items
    return {patch.name: word_of(patch, "type") for patch in patches if isinstance(patch, Section)}


def _pairs(section: Section) -> Iterator[str]:
    """Pairs (patch patch), one after another, or none."""
    for item in _list_of(section, "mergePatchPairs").items:
        names = item.items if isinstance(item, Group) else ()
        pair = [name_of(section, part.text, part.at) for part in names if isinstance(part, Word)]
        if len(pair) != len(names) or len(names) != 2:
            raise section.error(item.at, "two patches (a b)", "another value")
        yield f"({' '.join(pair)})"


def own_name(section: Section, key: str) -> str:
    """A name that the case has chosen."""
    word = one(section, key, Word, "a name")
    return name_of(section, word.text, word.at)

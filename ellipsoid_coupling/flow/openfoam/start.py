"""U and p at the start: dimensions, inner values and conditions on patches, checked and written anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ellipsoid_coupling.files.limits import LARGEST_IN_A_CASE
from ellipsoid_coupling.flow.openfoam import arithmetic
from ellipsoid_coupling.flow.openfoam.dictionary import (
    Column,
    Item,
    Number,
    Section,
    Text,
    Units,
    Word,
)
from ellipsoid_coupling.flow.openfoam.rules import (
    HEADER,
    Rule,
    Rules,
    braces,
    choice,
    entries,
    figure,
    items_of,
    listed,
    name_of,
    one,
    one_of,
    require_units,
    subsection,
    triple,
    without_patterns,
)


@dataclass(frozen=True)
class _Kind:
    """A field: its width and dimensions, and for each condition the entries that it may have."""

    width: int
    dimensions: tuple[float, ...]
    conditions: Mapping[str, Rules]


def _values(width: int) -> Rule:
    """``uniform X`` or ``nonuniform List<...> N (...)``, every number within limits."""

    def rule(section: Section, key: str) -> str:
        items = items_of(section, key)
        first, rest = items[0], items[1:]
        form = first.text if isinstance(first, Word) else ""
        if form == "uniform" and len(rest) == 1:
            return f"uniform {_value(section, rest[0], width)}"
        if form == "nonuniform" and len(rest) == 1 and isinstance(rest[0], Column):
            column = rest[0]
            if column.values.shape[1] == width and (abs(column.values) <= LARGEST_IN_A_CASE).all():
                return listed(column)
        expected = f"uniform or nonuniform numbers up to {LARGEST_IN_A_CASE:g} for {key}"
        raise section.error(first.at, expected, form or "another value")

    return rule


def _value(section: Section, item: Item, width: int) -> str:
    if width > 1:
        return f"({' '.join(map(figure, triple(section, item, -LARGEST_IN_A_CASE, LARGEST_IN_A_CASE)))})"
    if isinstance(item, Number) and abs(item.value) <= LARGEST_IN_A_CASE:
        return figure(item.value)
    raise section.error(item.at, f"a number up to {LARGEST_IN_A_CASE:g}", "another value")


def _formula(section: Section, key: str) -> str:
    """A vector that depends on the place: "vector(-pos().y(),pos().x(),0)"."""
    text = one(section, key, Text, f"{key} in quotes")
    try:
        tree = arithmetic.parse(text.text)
    except arithmetic.ExpressionError as error:
        raise section.error(text.at, "arithmetic of numbers and pos()", str(error)) from None
    if not arithmetic.is_vector(tree):
        raise section.error(text.at, 'a vector of three, "vector(...)"', "another expression")
    return f'"{arithmetic.written(tree)}"'


_VECTOR, _SCALAR = _values(3), _values(1)
_FLUX: Rules = {"phi": choice("phi"), "inletValue": _VECTOR}
_PLAIN: dict[str, Rules] = {
    name: {}
    for name in ("zeroGradient", "fixedValue", "empty", "symmetry", "symmetryPlane", "cyclic")
}
KINDS = {
    "U": _Kind(3, (0, 1, -1), _PLAIN | {
        "noSlip": {},
        "slip": {},
        "movingWallVelocity": {},
        "inletOutlet": _FLUX,
        "pressureInletOutletVelocity": {"phi": choice("phi")},
        "surfaceNormalFixedValue": {"refValue": _SCALAR},
        "exprFixedValue": {"valueExpr": _formula},
    }),
    "p": _Kind(1, (0, 2, -2), _PLAIN | {
        "fixedGradient": {"gradient": _SCALAR},
        "inletOutlet": {"phi": choice("phi"), "inletValue": _SCALAR},
        "outletInlet": {"phi": choice("phi"), "outletValue": _SCALAR},
        "totalPressure": {"phi": choice("phi"), "U": choice("U"), "p0": _SCALAR},
    }),
}  # fmt: skip

_FIXED = frozenset(
    f"type {name};" for name in ("fixedValue", "inletOutlet", "outletInlet", "totalPressure")
)


def start_field(section: Section, name: str, patches: Mapping[str, str]) -> list[str]:
    """A field of time 0 as lines; InputError for a condition that is not known, with its patch.

    patches : the mesh's, by their names, with their types: each needs a condition
    """
    kind = KINDS[name]

    def dimensions(part: Section, key: str) -> str:
        units = one(part, key, Units, "dimensions")
        require_units(part, units, kind.dimensions)
        return f"[{' '.join(f'{part:g}' for part in units.exponents)}]"

    rules: Rules = {
        "FoamFile": HEADER,
        "dimensions": dimensions,
        "internalField": _values(kind.width),
    }
    for needed in ("dimensions", "internalField"):
        items_of(section, needed)
    given = subsection(section, "boundaryField")
    # An entry for all patches of a type counts before patterns.
    settled = frozenset(patch for patch, group in patches.items() if group in given.entries)
    boundary = without_patterns(given, patches, settled)
    for patch, patch_type in patches.items():
        # OpenFOAM recognises walls, and patches with a single possible condition, by their type as well.
        groups = {patch} | ({patch_type} - {"patch"})
        if patch_type != "empty" and not groups & boundary.entries.keys():
            found = f"none for the patch {patch}"
            raise section.error(boundary.at, "a condition for each patch of the mesh", found)
    rest = {key: value for key, value in section.entries.items() if value is not given}
    lines = entries(replace(section, entries=rest), rules)
    return lines + braces("boundaryField", _conditions(boundary, kind))


def fixes_level(lines: list[str]) -> bool:
    """Whether a condition of p, as written by `start_field`, fixes it, so that it needs no pRefCell."""
    return not _FIXED.isdisjoint(line.strip() for line in lines)


def _conditions(boundary: Section, kind: _Kind) -> list[str]:
    lines: list[str] = []
    for name in boundary.entries:
        patch = subsection(boundary, name)
        found = one(patch, "type", Word, "a type of condition")
        rules = kind.conditions.get(found.text)
        if rules is None:
            expected = one_of(kind.conditions, "a condition on a patch")
            raise patch.error(found.at, expected, found.text)
        known = {"type": choice(found.text), "value": _values(kind.width), **rules}
        lines += braces(name_of(boundary, name, boundary.places[name]), entries(patch, known))
    return lines

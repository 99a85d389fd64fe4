"""The kinematic viscosity of a case: nu in constant/transportProperties."""

from __future__ import annotations

import math
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_DICTIONARY_BYTES
from ellipsoid_coupling.flow.openfoam.entries import skip_entry
from ellipsoid_coupling.flow.openfoam.files import FoamFile, open_file, packed
from ellipsoid_coupling.flow.openfoam.locate import locate
from ellipsoid_coupling.flow.openfoam.tokens import Token, after_space

# OpenFOAM.org's has another name since version 9.
_FILES = ("transportProperties", "physicalProperties")
_NEWTONIAN = {"transportModel": "Newtonian", "viscosityModel": "constant"}


def viscosity_at(path: Path) -> float | None:
    """As `read_viscosity`, of the case that a path means; None where it means none, as a saved flow."""
    try:
        case, _ = locate(path)
    except InputError:
        return None
    return read_viscosity(case)


def read_viscosity(case: Path) -> float | None:
    """The viscosity nu of a case; None where it is no plain number, or the fluid not Newtonian.

    Nothing else of the file is looked at, and nothing in it is followed or run.
    """
    for name in _FILES:
        if packed(case / "constant" / name) is not None:
            path, most = case / "constant" / name, MOST_DICTIONARY_BYTES
            try:
                return _viscosity(open_file(path, "dictionary", most=most))
            except InputError:
                return None
    return None


def _viscosity(file: FoamFile) -> float | None:
    at, found = file.start, None
    while (at := after_space(file.data, at)) < len(file.data):
        key = file.token(at, "an entry")
        at = skip_entry(file, key)
        if key.text in _NEWTONIAN and _last(file, key, at) != _NEWTONIAN[key.text]:
            return None
        if key.text == "nu":
            found = _number(_last(file, key, at))
    return found


def _last(file: FoamFile, key: Token, end: int) -> str:
    """The last word of an entry: 1e-06 in ``nu nu [0 2 -1 0 0 0 0] 1e-06;``."""
    at, last = key.end, ""
    while at < end and (token := file.token(at, "a value")).text != ";":
        last, at = token.text, token.end
    return last


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0.0 < value < math.inf else None

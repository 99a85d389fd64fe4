"""Make a field that the package ships, for machines without OpenFOAM: the cavity's, or another case's.

python workflows/make_shipped_flow.py [CASE] [--cells 100]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.openfoam.programs import openfoam_version
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.solve import parameter, solve_case
from ellipsoid_coupling.flow.provide import SHIPPED


def main(arguments: Sequence[str] | None = None) -> Path:
    """Solve a case of foam_cases and save its field with its origin; the file's path."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", nargs="?", default="cavity")
    parser.add_argument("--cells", type=int)
    parser.add_argument("--out", type=Path, default=SHIPPED)
    options = parser.parse_args(arguments)
    case = options.case
    solved = solve_case(case, options.cells, processes=2)
    field, mesh = read_case(solved), "its own mesh"
    with suppress(InputError):
        cells = parameter(solved, "cells")
        mesh = f"{cells} x {cells} cells"
    residual = float(parameter(solved, "atRest"))
    until = f"an initial residual of U below {residual:g}" if residual else "endTime"
    if case == "cavity":
        until += " (change below 1e-8 per unit time)"
    origin = (
        f"foam_cases/{case}, {mesh}, OpenFOAM {openfoam_version()}, "
        f"icoFoam to {until}, made {datetime.now(UTC):%Y-%m-%d}, "
        # Behind the case's name and time: how far it is off U.
        f"{field.origin.split(', ', 2)[2]}"
    )
    options.out.mkdir(parents=True, exist_ok=True)
    path = Path(options.out) / f"{case}.npz"
    replace(field, origin=origin).save(path)
    return path


if __name__ == "__main__":
    print(main())

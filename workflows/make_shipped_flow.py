"""Make the cavity field that the package ships, for machines without OpenFOAM.

python workflows/make_shipped_flow.py [--cells 100]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from ellipsoid_coupling.flow.openfoam.programs import openfoam_version
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.solve import parameter, solve_case
from ellipsoid_coupling.flow.provide import SHIPPED


def main(arguments: Sequence[str] | None = None) -> Path:
    """Solve foam_cases/cavity and save its field with its origin; the file's path."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--out", type=Path, default=SHIPPED)
    options = parser.parse_args(arguments)
    solved = solve_case("cavity", options.cells, processes=2)
    field = read_case(solved)
    origin = (
        f"foam_cases/cavity, {options.cells} x {options.cells} cells, "
        f"OpenFOAM {openfoam_version()}, "
        f"icoFoam to an initial residual of U below {parameter(solved, 'atRest')} "
        f"(change below 1e-8 per unit time), made {datetime.now(UTC):%Y-%m-%d}, "
        # Behind the case's name and time: how far it is off U.
        f"{field.origin.split(', ', 2)[2]}"
    )
    options.out.mkdir(parents=True, exist_ok=True)
    path = Path(options.out) / "cavity.npz"
    replace(field, origin=origin).save(path)
    return path


if __name__ == "__main__":
    print(main())

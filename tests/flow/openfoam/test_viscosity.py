"""nu of a case: what OpenFOAM's versions write, and nothing where it is not a plain number."""

from __future__ import annotations

from pathlib import Path

import pytest

from ellipsoid_coupling.flow.openfoam.viscosity import read_viscosity

HEAD = "FoamFile { version 2.0; format ascii; class dictionary; object x; }\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("nu 0.1;", 0.1),
        ("nu nu [0 2 -1 0 0 0 0] 1e-06; // water", 1e-6),
        ("transportModel Newtonian;\nnu [0 2 -1 0 0 0 0] 0.01;", 0.01),
        ("viscosityModel constant;\nnu [m^2 s^-1] 0.25;", 0.25),
        ("BirdCarreauCoeffs { nu0 1; }\nnu 2;", 2.0),
        ("transportModel BirdCarreau;\nnu 0.1;", None),
        ("nu 0;", None),
        ("nu nan;", None),
        ("nu $other;", None),
        ("nu #calc \"1\";", None),
        ("rho 1;", None),
        ("nu 1", None),
        ("'", None),
    ],
)  # fmt: skip
def test_nu_is_read_or_not_known(tmp_path: Path, text: str, expected: float | None) -> None:
    (tmp_path / "constant").mkdir()
    (tmp_path / "constant" / "transportProperties").write_text(HEAD + text)
    assert read_viscosity(tmp_path) == expected


def test_another_name_and_no_file(tmp_path: Path) -> None:
    assert read_viscosity(tmp_path) is None
    (tmp_path / "constant").mkdir()
    (tmp_path / "constant" / "physicalProperties").write_text(HEAD + "nu 3;")
    assert read_viscosity(tmp_path) == 3.0
    (tmp_path / "constant" / "transportProperties").write_text("broken")
    assert read_viscosity(tmp_path) is None

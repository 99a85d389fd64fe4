"""Plain values of a stranger's case: what is understood, and what is written anew."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.openfoam import solve
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder, inputs_hash
from ellipsoid_coupling.flow.openfoam.trust import plain_case
from tests.flow.known import points
from tests.flow.openfoam.installed import needs_openfoam
from tests.flow.openfoam.strangers import edit, refused, stranger


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """A stranger's copy of the cavity, on 16 cells."""
    return stranger(tmp_path / "own")


# The package's own cases: squares of cells, and those of other shapes.
SQUARES = {"cavity", "rotation", "top_bottom"}


OTHERS = {"channel", "cylinder", "elbow", "ring", "step", "vortex_street"}


def test_the_packages_own_cases_take_the_same_way(
    case: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = sorted(path.name for path in BUILT_IN.iterdir() if path.is_dir())
    assert names == sorted(SQUARES | OTHERS)
    for name in sorted(OTHERS):
        assert plain_case(BUILT_IN / name, None, 1).run.application.name == "icoFoam"
    for name in sorted(SQUARES):
        assert plain_case(BUILT_IN / name, 20, 1).mesh_cells == 400
    # A folder of that name where the program is started is not taken for the package's own.
    evil = case.rename(case.with_name("cavity"))
    monkeypatch.chdir(evil.parent)
    (evil / "system" / "controlDict").write_text("#calc 1", "utf-8")
    assert case_folder("cavity") == BUILT_IN / "cavity"
    with pytest.raises(InputError, match="#calc"):
        solve_case("./cavity")


def test_numbers_of_parameters_are_put_in(case: Path) -> None:
    plain = plain_case(case, 32, 2)
    assert (plain.cells, plain.mesh_cells) == (32, 1024)
    assert (plain.run.application.name, plain.run.at_rest, plain.run.end_time) == (
        "icoFoam",
        1e-9,
        20,
    )
    assert (
        "hex (0 1 2 3 4 5 6 7) (32 32 1) simpleGrading (1 1 1)"
        in (plain.files["system/blockMeshDict"])
    )
    assert "numberOfSubdomains 2;" in plain.files["system/decomposeParDict"]
    # min(0.05, 400/32^2)
    assert "deltaT 0.05;" in plain.files["system/controlDict"]
    assert "deltaT 0.01;" in plain_case(case, 200, 1).files["system/controlDict"]
    # pFinal is $p, spelt out.
    assert plain.files["system/fvSolution"].count("solver GAMG;") == 2
    edit(case / "system" / "blockMeshDict", "($cells $cells 1)", "(16 16 1)")
    assert plain_case(case, 16, 1).mesh_cells == 256
    with pytest.raises(
        InputError, match=r"blockMeshDict: expected blocks of \(\$cells .* take the 16"
    ):
        plain_case(case, 17, 1)


def test_numbers_of_parameters_are_entries_of_who_includes_them(case: Path) -> None:
    """As they are for OpenFOAM: a scale there makes the mesh smaller; an own entry behind it counts."""
    edit(case / "system" / "parameters", "cells 16;", "cells 16; scale 0.5; deltaT 0.25; nu 0.5;")
    control = case / "system" / "controlDict"
    text = control.read_text("utf-8")
    edit(control, "deltaT          $timeStep;", "")
    edit(case / "system" / "blockMeshDict", "scale   1;", "")
    plain = plain_case(case, None, 1)
    assert plain.files["system/blockMeshDict"].count("scale 0.5;") == 1
    assert plain.files["system/controlDict"].count("deltaT 0.25;") == 1
    assert "scale" not in plain.files["system/controlDict"]
    control.write_text(text, "utf-8")
    assert "deltaT 0.05;" in plain_case(case, None, 1).files["system/controlDict"]
    (case / "system" / "blockMeshDict").write_text(
        '#include "parameters"\n' * 2 + (case / "system" / "blockMeshDict").read_text("utf-8"),
        "utf-8",
    )
    assert plain_case(case, None, 1).files["system/blockMeshDict"].count("scale 0.5;") == 1


def test_the_viscosity_may_lie_in_physical_properties(case: Path) -> None:
    own = case / "constant" / "transportProperties"
    expected = plain_case(case, None, 1)
    other = own.rename(own.with_name("physicalProperties"))
    other.write_text(other.read_text("utf-8") + "\nviscosityModel constant;\n", "utf-8")
    assert plain_case(case, None, 1) == expected
    edit(other, "constant;", "powerLaw;")
    refused(case, "constant/physicalProperties, line .* viscosityModel constant, found powerLaw")
    shutil.copy(other, own)
    refused(case, "constant/physicalProperties: expected nothing but transportProperties")


def test_walls_are_known_by_their_type_as_well(case: Path) -> None:
    """And an empty patch needs no condition."""
    for field in ("U", "p"):
        path = case / "0.orig" / field
        edit(path, "    walls\n", "    wall\n")
        text = path.read_text("utf-8")
        path.write_text(text.partition("    frontAndBack")[0] + "}\n", "utf-8")
    assert "wall\n" in plain_case(case, None, 1).files["0.orig/U"]


def without_parameters(case: Path) -> Path:
    """As OpenFOAM's own tutorials are: 20 x 20 cells, no function object, a folder 0."""
    for name in ("parameters", "decomposeParDict"):
        (case / "system" / name).unlink()
    mesh, control = case / "system" / "blockMeshDict", case / "system" / "controlDict"
    for path in (mesh, control):
        edit(path, '#include "parameters"', "")
    edit(mesh, "($cells $cells 1)", "(20 20 1)")
    edit(control, "$endTime", "20")
    edit(control, "$timeStep", "0.05")
    control.write_text(control.read_text("utf-8").partition("functions")[0], "utf-8")
    (case / "0.orig").rename(case / "0")
    return case


def test_a_case_without_parameters_keeps_its_mesh(case: Path) -> None:
    plain = plain_case(without_parameters(case), None, 1)
    assert (plain.cells, plain.mesh_cells, plain.scales) == (20, 400, False)
    assert "value 1e-06;" in plain.files["system/controlDict"]
    assert plain_case(case, 20, 1) == plain
    with pytest.raises(InputError, match="take the 20 that there are"):
        plain_case(case, 40, 1)
    edit(case / "system" / "blockMeshDict", "(20 20 1)", "($cells 20 1)")
    refused(case, "blockMeshDict, line 27: .* no number cells stands before")


VARIANTS = {
    # file, old text, new text, what is written
    "condition": ("0.orig/U", "noSlip;", "fixedValue; value uniform (0 0 0);", "value uniform (0 0 0);"),
    "flux": ("0.orig/U", "noSlip;", "inletOutlet; inletValue uniform (1e-3 0 0);", "(0.001 0 0)"),
    "column": (
        "0.orig/U", "noSlip;", "fixedValue; value nonuniform List<vector> 2((1 2 3) (4 5 6));",
        "nonuniform List<vector> 2\n(\n(1.0 2.0 3.0)\n(4.0 5.0 6.0)\n)",
    ),
    "no column": (
        "0.orig/U", "noSlip;", "fixedValue; value nonuniform List<vector> 0();",
        "nonuniform List<vector> 0\n(\n\n)",
    ),
    "units": ("0.orig/U", "[0 1 -1 0 0 0 0]", "[m s^-1]", "dimensions [0 1 -1 0 0 0 0];"),
    "five units": ("0.orig/p", "[0 2 -2 0 0 0 0]", "[0 2 -2 0 0]", "dimensions [0 2 -2 0 0 0 0];"),
    "nu": ("constant/transportProperties", "0.1;", "nu [0 2 -1 0 0 0 0] 1e-2;", "nu 0.01;"),
    "comments": ("system/fvSolution", "PISO\n{", "/* { */ PISO // }\n{", "PISO\n{"),
    "functions, none": ("system/controlDict", "functions", "runTimeModifiable yes;\nfunctions", "e no;"),
    "arc": ("system/blockMeshDict", "boundary\n", "edges (arc 0 1 (.5 -.1 0));\nboundary\n",
            "arc 0 1 (0.5 -0.1 0)"),
    "sized": ("system/blockMeshDict", "faces ((3", "faces 1((3", "faces ((3 7 6 2));"),
    "gradings": ("system/blockMeshDict", "simpleGrading (1 1 1)",
                 "simpleGrading (((0.5 1 2) (0.5 1 .5)) 1 1)", "(((0.5 1 2) (0.5 1 0.5)) 1 1)"),
    "groups": ("system/blockMeshDict", "type wall;\n        faces ((3",
               "type wall; inGroups 1(wall); faces ((3", "lid\n{\n    type wall;\n    faces"),
    "other solvers": ("system/fvSolution",
                      "PISO\n{", "SIMPLE { consistent yes; }\nPISO\n{", "SIMPLE\n{\n}"),
}  # fmt: skip


@pytest.mark.parametrize("name", VARIANTS)
def test_other_plain_forms_are_understood(name: str, case: Path) -> None:
    file, old, new, written = VARIANTS[name]
    edit(case / file, old, new)
    assert written in plain_case(case, None, 1).files[file]


REFUSED = {
    "condition": ("0.orig/U", "noSlip", "noSuchCondition", "a condition on a patch of those known"),
    "entry": ("0.orig/U", "noSlip;", "noSlip; x 1;", "an entry of those known"),
    "formula": ("0.orig/U", "exp(-0.5", "time(-0.5", "arithmetic of numbers and pos"),
    "pattern": ("0.orig/U", "walls\n", '"w[[:alpha:]]*"\n', "a pattern that is read here"),
    "units": ("0.orig/p", "[0 2 -2 0 0 0 0]", "[1 -1 -2 0 0 0 0]", r"dimensions \[0 2 -2 0 0 0 0\]"),
    "a count": ("0.orig/U", "noSlip;", "fixedValue; value nonuniform List<vector> 2((1 2 3));",
                "a list of other than 2 entries"),
    "a list in other threes": (
        "0.orig/U", "noSlip;", "fixedValue; value nonuniform List<vector> 2((1 2) (3 4 5 6));",
        "a list of other than 2 entries",
    ),
    "a list with text": (
        "0.orig/U", "noSlip;", "fixedValue; value nonuniform List<vector> 1((1 2 nan));",
        "something else than numbers",
    ),
    "a list too long": (
        "0.orig/U", "noSlip;", "fixedValue; value nonuniform List<vector> 1537((1 2 3));",
        "a list of 0 to 1536 entries, what the mesh has room for",
    ),
    "solver": ("system/controlDict", "icoFoam", "rhoSimpleFoam", "application icoFoam or"),
    "start": ("system/controlDict", "startTime       0", "startTime 1", "startTime from 0 to 0"),
    "scheme": ("system/fvSchemes", "Euler", "CoEuler", "a scheme of those known"),
    "a number": ("system/fvSolution", "1e-10", "-1", "a number tolerance from 0 to 1"),
    "no such number": ("system/blockMeshDict", "$cells", "$cell", "no number cell stands before"),
    "a vertex": ("system/blockMeshDict", "(3 7 6 2)", "(3 7 6 8)", "4 whole numbers below 8"),
    "cells": ("system/parameters", "cells 16;", "cells 0.5;", "a whole number cells|a number cells"),
    "no cells": ("system/parameters", "cells 16;", "", "no number cells stands before"),
    "at rest": ("system/parameters", "1e-9", "nan", "a number"),
    "no last solver": ("system/fvSolution", "pFinal", "k", "a dictionary pFinal, found none"),
    "few digits": ("system/controlDict", "writePrecision  12", "writePrecision 2",
                   "a number writePrecision from 6 to 17, found 2"),
    "at rest at once": ("system/parameters", "1e-9", "1", "atRest from 0 to 0.999, found 1"),
    "steps": ("system/controlDict", "$timeStep", "1e-9", "at most 1000000 steps to endTime 20, found"),
    "a long sum": ("0.orig/U", "pos().x()-0.5", "+".join(["1"] * 300), "more than 200 signs"),
    "a huge number": ("0.orig/U", "pos().x()-0.5", "1e999", "1e999, which is out of range"),
    "a patch left out": ("0.orig/U", "    walls\n", "    sides\n",
                         "a condition for each patch of the mesh, found none for the patch walls"),
    "a second end": ("system/controlDict", '#include "parameters"',
                     'endTime 1;\n#include "parameters"', "a second entry endTime"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_known_is_refused_in_words(name: str, case: Path) -> None:
    file, old, new, match = REFUSED[name]
    edit(case / file, old, new)
    assert file in refused(case, match).where


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_tutorials_case_is_solved(case: Path) -> None:
    """At rest is 1e-6 in U's initial residual, which leaves less than 1e-5 of the lid's speed."""
    solved = solve_case(without_parameters(case))
    # Nothing is written on the way.
    assert len([path for path in solved.iterdir() if path.name[0].isdigit()]) == 3
    expected = read_case(solve_case("cavity", 20)).evaluate(*points(200))
    found = read_case(solved).evaluate(*points(200))
    np.testing.assert_allclose(found.velocity_x, expected.velocity_x, atol=1e-5)
    np.testing.assert_allclose(found.velocity_y, expected.velocity_y, atol=1e-5)


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_strangers_plain_case_is_solved(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """0 instead of 0.orig, U in binary from another run, no function object: the cavity's own flow.

    Its U fits one mesh only, so no coarser solution is mapped. Another start leaves the rest as it is,
    to what the stop leaves (1.5e-9) and single precision (1e-6).
    """
    monkeypatch.setattr(solve, "MAPPED_FROM", 16)
    expected = read_case(solve_case("cavity", 16)).evaluate(*points(200))
    (case / "0.orig").rename(case / "0")
    start = case / "0" / "U"
    text = start.read_text("utf-8").replace("ascii", 'binary; arch "LSB;label=32;scalar=64"')
    values = np.zeros((256, 3), "<f8")
    values[:, 0] = 0.1
    column = b"nonuniform List<vector> 256\n(" + values.tobytes() + b")"
    start.write_bytes(
        text.encode().replace(b"internalField   uniform (0 0 0)", b"internalField " + column)
    )
    control = case / "system" / "controlDict"
    control.write_text(control.read_text("utf-8").partition("functions")[0], "utf-8")
    solved = solve_case(case)
    assert "256\n(\n(0.1 0.0 0.0)\n" in (solved / "0.orig" / "U").read_text("utf-8")
    found = read_case(solved).evaluate(*points(200))
    np.testing.assert_allclose(found.velocity_x, expected.velocity_x, atol=2e-6)
    np.testing.assert_allclose(found.velocity_y, expected.velocity_y, atol=2e-6)


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_case_that_brings_its_mesh_is_solved_on_it(case: Path) -> None:
    """The cavity's own mesh, in binary: the cavity's flow, to what the stop leaves and single precision."""
    made = solve_case("cavity", 16)
    shutil.copytree(made / "constant" / "polyMesh", case / "constant" / "polyMesh")
    (case / "system" / "blockMeshDict").unlink()
    key = inputs_hash(case, 16)
    solved = solve_case(case)
    header = (solved / "constant" / "polyMesh" / "points").read_bytes()[:100]
    assert b"format binary" in header
    expected, found = (read_case(folder).evaluate(*points(200)) for folder in (made, solved))
    np.testing.assert_allclose(found.velocity_x, expected.velocity_x, atol=2e-6)
    np.testing.assert_allclose(found.velocity_y, expected.velocity_y, atol=2e-6)
    boundary = case / "constant" / "polyMesh" / "boundary"
    edit(boundary, "type            empty;", "type            wedge;")
    assert inputs_hash(case, 16) != key
    refused(case, "polyMesh/boundary, patch frontAndBack: .* the type wedge")

"""`--solve`: the case's own solver, to the case's own end, through the same gate."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import Wanted, wanted_path
from ellipsoid_coupling.flow.openfoam.applications import APPLICATIONS
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder
from ellipsoid_coupling.flow.openfoam.times import solved_times
from ellipsoid_coupling.flow.openfoam.trust import plain_case
from tests.flow.known import points
from tests.flow.openfoam.installed import needs_openfoam

HEAD = "FoamFile {{ version 2.0; format ascii; class dictionary; object {0}; }}\n"
CONTROL = """application {name}; startFrom startTime; startTime 0; stopAt endTime;
endTime {end}; deltaT {step}; writeControl timeStep; writeInterval {every}; writePrecision 12;
"""
SOLUTION = """solvers
{
    p { solver GAMG; smoother GaussSeidel; tolerance 1e-10; relTol 0.01; }
    Phi { $p; }
    "(U|k|epsilon)" { solver PBiCGStab; preconditioner DILU; tolerance 1e-11; relTol 0; }
    ".*Final" { solver PBiCGStab; preconditioner diagonal; tolerance 1e-11; relTol 0; }
}
PISO { nCorrectors 4; nNonOrthogonalCorrectors 0; pRefCell 0; pRefValue 0; }
PIMPLE { nOuterCorrectors 1; nCorrectors 4; pRefCell 0; pRefValue 0; }
SIMPLE { consistent yes; pRefCell 0; pRefValue 0; residualControl { p 1e-8; "(U|k)" 1e-8; } }
potentialFlow { nNonOrthogonalCorrectors 0; PhiRefCell 0; PhiRefValue 0; }
relaxationFactors { equations { U 0.9; ".*" 0.7; } }
"""
STEADY = "ddtSchemes { default steadyState; }"
VISCOUS = "div((nuEff*dev2(T(grad(U))))) Gauss linear;"
# endTime, deltaT and steps between writing.
RUNS = {
    "icoFoam": (6, 0.05, 40), "pisoFoam": (6, 0.05, 40), "pimpleFoam": (6, 0.05, 40),
    "simpleFoam": (400, 1, 1000), "potentialFoam": (1, 1, 1),
}  # fmt: skip


def made(folder: Path, name: str) -> Path:
    """The cavity on 16 cells for another solver, without system/parameters."""
    case = Path(shutil.copytree(case_folder("cavity"), folder / f"by {name}"))
    (case / "system" / "parameters").unlink()
    mesh = case / "system" / "blockMeshDict"
    mesh.write_text(mesh.read_text().replace('#include "parameters"', "").replace("$cells", "16"))
    end, step, every = RUNS[name]
    control = CONTROL.format(name=name, end=end, step=step, every=every)
    (case / "system" / "controlDict").write_text(HEAD.format("controlDict") + control)
    (case / "system" / "decomposeParDict").unlink()
    solution = SOLUTION if name != "pisoFoam" else SOLUTION.replace('".*Final"', '"(p|U)Final"')
    (case / "system" / "fvSolution").write_text(HEAD.format("fvSolution") + solution)
    schemes = case / "system" / "fvSchemes"
    text = schemes.read_text().replace("div(phi,U)", f"{VISCOUS} div(phi,U)")
    if name == "simpleFoam":
        start = text.index("ddtSchemes")
        text = text[:start] + STEADY + text[text.index("}", start) + 1 :]
    schemes.write_text(text)
    model = case / "constant" / "turbulenceProperties"
    model.write_text(HEAD.format("turbulenceProperties") + "simulationType laminar;\n")
    return case


@pytest.mark.parametrize("name", APPLICATIONS)
def test_each_solver_gets_what_it_reads_and_no_more(tmp_path: Path, name: str) -> None:
    plain = plain_case(made(tmp_path, name), None, 1, to_rest=False)
    application = plain.run.application
    assert (application.name, plain.run.at_rest, plain.run.end_time) == (name, 0.0, RUNS[name][0])
    assert f"application {name};" in plain.files["system/controlDict"]
    assert f"writeInterval {RUNS[name][2]}" in plain.files["system/controlDict"]
    assert "functions" not in plain.files["system/controlDict"]
    solution = plain.files["system/fvSolution"]
    assert '"' not in solution
    assert ("SIMPLE\n{\n    consistent yes;" in solution) == (name == "simpleFoam")
    assert ("U 0.9;" in solution) == application.relaxed
    assert ("constant/turbulenceProperties" in plain.files) == application.modelled


def test_to_rest_is_for_solvers_in_time(tmp_path: Path) -> None:
    for name, application in APPLICATIONS.items():
        run = plain_case(made(tmp_path, name), None, 1).run
        assert (run.at_rest > 0.0) == application.in_time


REFUSED = {
    "turbulence": ("constant/turbulenceProperties", "laminar", "RAS", "simulationType laminar"),
    "Maxwell's fluid": (
        "constant/turbulenceProperties", "laminar;",
        "laminar; laminar { laminarModel Maxwell; MaxwellCoeffs { nuM 10; lambda 5; } }",
        "laminarModel Stokes",
    ),
    "a power law": (
        "constant/turbulenceProperties", "laminar;",
        "laminar; laminar { model generalizedNewtonian; viscosityModel powerLaw; }",
        "model Stokes",
    ),
    "a pattern of a model": (
        "constant/turbulenceProperties", "laminar;",
        'laminar; "lamina." { model Maxwell; }', 'entry "lamina."',
    ),
    "another solver": ("system/controlDict", "pisoFoam", "interFoam", "application icoFoam or"),
    "code": ("system/controlDict", "application", "#calc 1\napplication", "the directive #calc"),
    "functions": (
        "system/controlDict", "application", "functions { f { type x; } } application", "entry f",
    ),
    "a library": ("system/controlDict", "application", 'libs ("x"); application', "entry libs"),
    "times without end": ("system/controlDict", "writeInterval 40", "writeInterval 0.01", "to be written"),
    "steps without end": ("system/controlDict", "deltaT 0.05", "deltaT 1e-9", "steps to endTime"),
    "a pattern for libs": ("system/controlDict", "application", '"l.bs" (x); application', 'entry "l.bs"'),
    "a pattern of another kind": ("system/fvSolution", '"(p|U)Final"', '"[[:x:]]"', "a pattern that"),
    "relaxation": ("system/fvSolution", "tolerance 1e-10", "tolerance 2", "a number tolerance"),
    "no solver for U": ("system/fvSolution", '"(U|k|epsilon)"', '"k"', "a dictionary U"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_known_is_refused_in_words(tmp_path: Path, name: str) -> None:
    file, old, new, match = REFUSED[name]
    case = made(tmp_path, "pisoFoam")
    text = (case / file).read_text()
    assert old in text
    (case / file).write_text(text.replace(old, new))
    with pytest.raises(InputError, match=match) as caught:
        plain_case(case, None, 1, to_rest=False)
    assert file in caught.value.where


def test_the_newtonian_model_may_be_named(tmp_path: Path) -> None:
    """Models of turbulence beside it, which OpenFOAM does not look for, may be there as well."""
    case = made(tmp_path, "pisoFoam")
    path, name = case / "constant" / "turbulenceProperties", "constant/turbulenceProperties"
    written = plain_case(case, None, 1).files[name]
    with path.open("a") as file:
        file.write("laminar { laminarModel Stokes; StokesCoeffs {} printCoeffs on; }\n")
        file.write("RAS { RASModel kEpsilon; turbulence on; kEpsilonCoeffs { Cmu 0.09; } }\n")
        file.write("LES { LESModel Smagorinsky; delta cubeRootVol; } printCoeffs no;\n")
    assert plain_case(case, None, 1).files[name] == written


@pytest.mark.parametrize("name", APPLICATIONS)
@pytest.mark.parametrize("other", ["ABSENT", "a pattern"])
def test_a_solver_without_its_block_is_refused(tmp_path: Path, name: str, other: str) -> None:
    """All but icoFoam take what they need for granted where a condition fixes p (OpenFOAM 1912)."""
    case, application = made(tmp_path, name), APPLICATIONS[name]
    path, block = case / "system" / "fvSolution", application.block
    before, found, behind = path.read_text().partition(f"{block} {{")
    assert found
    rest = behind.partition("}\n")[2]
    path.write_text(
        before + rest if other == "ABSENT" else f'{before}"{block[:-1]}[{block[-1]}]" {{{behind}'
    )
    with pytest.raises(
        InputError, match=f"fvSolution, line 1: expected a dictionary {block}, found none"
    ):
        plain_case(case, None, 1)
    pressure = case / "0.orig" / "p"
    text = pressure.read_text()
    start = text.index("{", text.index("lid"))
    end = text.index("}", start)
    pressure.write_text(f"{text[:start]}{{ type fixedValue; value uniform 0; {text[end:]}")
    if application.needs_block:
        with pytest.raises(InputError, match=f"a dictionary {block}"):
            plain_case(case, None, 1)
    else:
        assert f"\n{block}\n" not in plain_case(case, None, 1).files["system/fvSolution"]


def test_a_start_from_another_time_is_refused(tmp_path: Path) -> None:
    """Only time 0 is read; without startFrom, OpenFOAM would take the latest time."""
    case = made(tmp_path, "icoFoam")
    path, start = case / "system" / "controlDict", "startFrom startTime;"
    text = path.read_text()
    for name in ("0", "0.orig.old", "\u0665"):
        (case / name).mkdir()
    words = ("startFrom startTime;", "startFrom firstTime;", "startFrom latestTime;", "")
    for word in words:
        path.write_text(text.replace(start, word))
        plain_case(case, None, 1)
    shutil.copytree(case / "0.orig", case / "0", dirs_exist_ok=True)
    (case / "2.5").mkdir()
    for word in words[:2]:
        path.write_text(text.replace(start, word))
        plain_case(case, None, 1)
    for word in words[2:]:
        path.write_text(text.replace(start, word))
        with pytest.raises(
            InputError, match=r"found latestTime beside a time 2\.5\. Change"
        ) as caught:
            plain_case(case, None, 1)
        assert "system/controlDict, line" in caught.value.where


def test_a_case_without_a_model_is_refused(tmp_path: Path) -> None:
    case = made(tmp_path, "simpleFoam")
    (case / "constant" / "turbulenceProperties").unlink()
    with pytest.raises(InputError, match="turbulenceProperties"):
        plain_case(case, None, 1, to_rest=False)


def test_patterns_of_patches_stand_for_their_names(tmp_path: Path) -> None:
    """A name's own entry counts first, then that of its type, then the last pattern."""
    case = made(tmp_path, "icoFoam")
    path = case / "0.orig" / "p"
    head = path.read_text().partition("boundaryField")[0]
    conditions = (
        '".*" { type symmetry; } "w.*|lid" { type zeroGradient; } frontAndBack { type empty; }'
    )
    path.write_text(f"{head}boundaryField {{ {conditions} }}")
    written = plain_case(case, None, 1).files["0/p"]
    assert written.count("zeroGradient") == 2
    assert "symmetry" not in written
    group = "wall { type fixedGradient; gradient uniform 0; }"
    path.write_text(f"{head}boundaryField {{ {conditions} {group} }}")
    written = plain_case(case, None, 1).files["0/p"]
    assert written.count("fixedGradient") == 1
    assert "zeroGradient" not in written


def test_solve_without_a_case_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["run", "cavity_free", "--model", "microscopic", "--solve"])
    assert "--flow CASE" in capsys.readouterr().err
    assert wanted_path(Wanted(Path("x"))) == Path("x")


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_every_solver_finds_the_cavitys_flow(tmp_path: Path) -> None:
    """The flow of icoFoam comes to exp(-5.1 * 6) near to rest.

    The others have the transposed gradient in their stress, which on a mesh is not quite free of
    divergence: 1 % of the lid's speed on 16 cells, alike for all three up to how they couple p and U
    (2e-3). potentialFoam's flow is another; it writes phi.
    """
    at_rest = read_case(solve_case("cavity", 16)).evaluate(*points(200)).velocity_x
    found, told = {}, list[str]()
    for name in ("icoFoam", "pisoFoam", "pimpleFoam", "simpleFoam"):
        told.clear()
        wanted = Wanted(made(tmp_path, name), solve=True)
        path = wanted_path(wanted, lambda stage, _done: told.append(stage))
        assert path is not None
        assert told[-1].endswith("16 cells: solved")
        found[name] = read_case(path).evaluate(*points(200)).velocity_x
        assert (path / solved_times(path)[-1] / "phi").is_file()
        # It is taken from the cache, and is not the one at rest.
        assert wanted_path(wanted) == path
    np.testing.assert_allclose(found["icoFoam"], at_rest, atol=1e-8)
    np.testing.assert_allclose(found["pisoFoam"], at_rest, atol=0.015)
    for name in ("pimpleFoam", "simpleFoam"):
        np.testing.assert_allclose(found[name], found["pisoFoam"], atol=2e-3)
    potential = wanted_path(Wanted(made(tmp_path, "potentialFoam"), solve=True))
    assert potential is not None
    assert (potential / "0" / "phi").is_file()


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_run_to_its_end_writes_on_the_way_and_leaves_the_case_alone(tmp_path: Path) -> None:
    case = made(tmp_path, "icoFoam")
    before = sorted(path.relative_to(case) for path in case.rglob("*"))
    path = wanted_path(Wanted(case, solve=True))
    assert path is not None
    assert [float(time) for time in solved_times(path)] == [0.0, 2.0, 4.0, 6.0]
    assert sorted(found.relative_to(case) for found in case.rglob("*")) == before
    # To rest, the same files have another solution.
    assert solve_case(case) != path


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_plan_solves_only_where_it_is_told_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The whole way up to a run: an unsolved case is refused, with --solve its flow is told."""
    case = made(tmp_path, "icoFoam")
    shutil.copytree(case / "0.orig", case / "0")
    with pytest.raises(SystemExit, match="2"):
        main(["plan", "cavity_free", "--flow", str(case)])
    assert "--solve" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cavity_free", "--flow", str(case), "--solve"])
    assert not ended.value.code
    told, progress = capsys.readouterr()
    assert "Stokes number" in told
    assert "by icoFoam, 16 cells: icoFoam" in progress

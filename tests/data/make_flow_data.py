"""Make the small solved cases of the flow tests: run again only if their foam_cases change.

    python tests/data/make_flow_data.py

cavity_16 : foam_cases/cavity on 16 x 16 cells, and in cavity_16/VTK what foamToVTK made of it
cavity_16_binary : cavity_16 in OpenFOAM's binary format
graded    : the same on 12 x 12 cells, the mesh graded towards the lid and one side
l_shape   : an L of three 6 x 6 blocks, its own lid over the left half
top_bottom_12 : foam_cases/top_bottom on 12 x 12 cells, which has no stream function
nozzle, baffle : a channel that narrows, a channel with a thin plate; from their own dictionaries, with phi
"""

from __future__ import annotations

import gzip
import shutil
import subprocess
import tempfile
from pathlib import Path

from ellipsoid_coupling.flow.openfoam.programs import foam_environment
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder

HERE = Path(__file__).parent
KEPT = ("U", "streamFunction")
L_VERTICES = "".join(
    f"    ({x} {y} {z})\n" for z in (0, 0.1) for y in (0, 0.5, 1) for x in (0, 0.5, 1)
)
L_BLOCKS = "".join(
    f"    hex ({a} {a + 1} {a + 4} {a + 3} {a + 9} {a + 10} {a + 13} {a + 12})"
    " ($cells $cells 1) simpleGrading (1 1 1)\n"
    for a in (0, 1, 3)
)
L_MESH = f"""FoamFile
{{
    version     2.0;
    format      ascii;
    class       dictionary;
    object      blockMeshDict;
}}

#include "parameters"

scale   1;

vertices
(
{L_VERTICES});

blocks
(
{L_BLOCKS});

boundary
(
    lid
    {{
        type wall;
        faces ((6 15 16 7));
    }}
    walls
    {{
        type wall;
        faces ((0 9 12 3) (3 12 15 6) (0 1 10 9) (1 2 11 10) (2 5 14 11) (5 4 13 14) (4 7 16 13));
    }}
    frontAndBack
    {{
        type empty;
        faces ((0 3 4 1) (1 4 5 2) (3 6 7 4) (9 10 13 12) (10 11 14 13) (12 13 16 15));
    }}
);
"""


def _edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text, f"{path} has no {old!r}"
    path.write_text(text.replace(old, new), encoding="utf-8")


def _keep(solved: Path, name: str) -> None:
    """Copy the mesh, the last time's fields and the VTK folder, if any, to tests/data."""
    target = HERE / name
    shutil.rmtree(target, ignore_errors=True)
    last = max((p for p in solved.glob("[1-9]*") if p.is_dir()), key=lambda p: float(p.name))
    shutil.copytree(solved / "constant", target / "constant")
    shutil.copytree(solved / "system", target / "system")
    (target / last.name).mkdir()
    for field in KEPT:
        if (last / field).is_file():
            shutil.copy(last / field, target / last.name)
    if (solved / "VTK").is_dir():
        step = next(solved.glob("VTK/*_*/internal.vtu")).parent
        shutil.copytree(step, target / "VTK" / f"{name}_{step.name.rpartition('_')[2]}")


def _keep_binary(case: Path) -> None:
    """The same case in binary, converted by OpenFOAM."""
    target = HERE / f"{case.name}_binary"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(case, target, ignore=shutil.ignore_patterns("VTK"))
    control = target / "system" / "controlDict"
    _edit(control, "writeFormat     ascii", "writeFormat     binary")
    subprocess.run(
        ["foamFormatConvert"], cwd=target, env=foam_environment(), check=True,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip


def _solve_again(name: str, programs: tuple[str, ...]) -> None:
    """Solve a case of tests/data from its own dictionaries; the mesh and the last time are packed."""
    case = HERE / name
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(shutil.copytree(case, Path(scratch) / name))
        for program in programs:
            subprocess.run(
                program.split(), cwd=work, env=foam_environment(), check=True,
                stdout=subprocess.DEVNULL,
            )  # fmt: skip
        last = max((p for p in work.glob("[1-9]*") if p.is_dir()), key=lambda p: float(p.name))
        mesh = "constant/polyMesh"
        shutil.copy(work / mesh / "boundary", case / mesh)
        files = [f"{mesh}/{part}" for part in ("points", "faces", "owner", "neighbour")]
        for file in (*files, f"{last.name}/U", f"{last.name}/phi"):
            packed = gzip.compress((work / file).read_bytes(), mtime=0)
            (case / f"{file}.gz").write_bytes(packed)


def main() -> None:
    """Solve the cases in a scratch folder and keep what the readers need."""
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        for name in ("cavity_16", "graded", "l_shape"):
            shutil.copytree(case_folder("cavity"), work / name)
        _edit(
            work / "graded" / "system" / "blockMeshDict",
            "simpleGrading (1 1 1)", "simpleGrading (3 0.3 1)",
        )  # fmt: skip
        (work / "l_shape" / "system" / "blockMeshDict").write_text(L_MESH, encoding="utf-8")
        _edit(
            work / "l_shape" / "0.orig" / "U",
            "pos().x()-0.5,2)/0.01", "pos().x()-0.25,2)/0.005",
        )  # fmt: skip
        for name, cells in (("cavity_16", 16), ("graded", 12), ("l_shape", 6)):
            solved = solve_case(work / name, cells, out=work / f"{name}-solved")
            if name == "cavity_16":
                subprocess.run(
                    ["foamToVTK", "-latestTime", "-fields", "(U streamFunction)"],
                    cwd=solved, env=foam_environment(), check=True, stdout=subprocess.DEVNULL,
                )  # fmt: skip
            _keep(solved, name)
            if name == "cavity_16":
                _keep_binary(HERE / name)
        _keep(solve_case("top_bottom", 12, out=work / "top_bottom_12"), "top_bottom_12")
    _solve_again("nozzle", ("blockMesh", "icoFoam"))
    baffles = "topoSet", "createBaffles -overwrite"
    _solve_again("baffle", ("blockMesh", *baffles, "icoFoam"))


if __name__ == "__main__":
    main()

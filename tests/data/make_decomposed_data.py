"""Make the decomposed cases of the tests: run again only if their form shall change.

    python tests/data/make_decomposed_data.py

periodic_4 : a lid over a layer of 8 x 8 cells, cyclic from left to right, solved by four processes, binary;
    beside its parts, processor0 to processor3, the times and the mesh that reconstructPar made of them
collated_4 : the same parts as one file each, in processors4, with the last time alone
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from ellipsoid_coupling.flow.openfoam.programs import foam_environment
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder

HERE = Path(__file__).parent
CONTROL = """FoamFile { version 2.0; format ascii; class dictionary; object controlDict; }
application icoFoam; startFrom latestTime; startTime 0; stopAt endTime; endTime 2; deltaT 0.05;
writeControl runTime; writeInterval 1; writeFormat binary; timeFormat general;
"""
PARTS = """FoamFile { version 2.0; format ascii; class dictionary; object decomposeParDict; }
numberOfSubdomains 4; method simple; simpleCoeffs { n (2 2 1); delta 0.001; }
"""
SIDES = {
    "system/blockMeshDict": (
        "left { type cyclic; neighbourPatch right; faces ((0 4 7 3)); }\n"
        "right { type cyclic; neighbourPatch left; faces ((2 6 5 1)); }\n"
        "walls { type wall; faces ((1 5 4 0)); }\n"
    ),
    "0.orig/U": "left { type cyclic; }\nright { type cyclic; }\nwalls { type noSlip; }\n",
    "0.orig/p": "left { type cyclic; }\nright { type cyclic; }\nwalls { type zeroGradient; }\n",
}


def _run(case: Path, *command: str) -> None:
    subprocess.run(command, cwd=case, env=foam_environment(), check=True, stdout=subprocess.DEVNULL)


def _periodic(case: Path) -> None:
    """foam_cases/cavity, cyclic from left to right."""
    source = case_folder("cavity")
    for part in ("0.orig", "constant", "system"):
        shutil.copytree(source / part, case / part)
    (case / "system" / "controlDict").write_text(CONTROL)
    (case / "system" / "decomposeParDict").write_text(PARTS)
    (case / "system" / "parameters").write_text("cells 8;\n")
    for name, patches in SIDES.items():
        text = (case / name).read_text()
        before, _, rest = text.partition("    walls")
        (case / name).write_text(
            before + patches + "    frontAndBack" + rest.partition("frontAndBack")[2]
        )
    shutil.copytree(case / "0.orig", case / "0")


def _keep(case: Path, target: Path) -> None:
    """What the reader needs, less pressure and what solvers write beside."""
    for name in ("0", "0.orig"):
        shutil.rmtree(case / name)
    for path in sorted(case.rglob("*"), reverse=True):
        if path.name in ("p", "uniform") or path.name.startswith("log."):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    for folder in (case, *case.glob("processor[0-9]")):
        shutil.rmtree(folder / "0", ignore_errors=True)
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(case, target)


def main() -> None:
    """Solve, decompose and reconstruct in a scratch folder, and keep what the readers need."""
    with tempfile.TemporaryDirectory() as scratch:
        case = Path(scratch) / "periodic_4"
        _periodic(case)
        _run(case, "blockMesh")
        _run(case, "decomposePar")
        _run(case, "mpirun", "--oversubscribe", "-np", "4", "icoFoam", "-parallel")
        _run(case, "reconstructPar")
        collated = Path(scratch) / "collated_4"
        shutil.copytree(case, collated, ignore=shutil.ignore_patterns("processor*", "1"))
        _run(collated, "decomposePar", "-latestTime", "-fileHandler", "collated")
        shutil.rmtree(collated / "2")
        shutil.rmtree(collated / "constant" / "polyMesh")
        _keep(collated, HERE / "collated_4")
        _keep(case, HERE / "periodic_4")


if __name__ == "__main__":
    main()

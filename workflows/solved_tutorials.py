"""Plane laminar tutorials of OpenFOAM, solved for a short time: foreign cases for the table of cases.

    python workflows/solved_tutorials.py FOLDER

They are those of Debian's package openfoam-examples. Each is copied into FOLDER, where its steps run one
after another; a case that is there already is not solved anew.
"""

from __future__ import annotations

import argparse
import gzip
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.errors import RunError, run_in_words
from ellipsoid_coupling.flow.openfoam.programs import foam_environment
from ellipsoid_coupling.output.progress import ProgressReporter

EXAMPLES = Path("/usr/share/doc/openfoam-examples/examples")
INSTALL = "apt-get install -y --no-install-recommends openfoam openfoam-examples"
# Of one step.
_LONGEST = 600.0
_DONE = "solved"


class Tutorial(NamedTuple):
    """A tutorial, by its path, the programs that solve it, and what is set in its controlDict.

    Attributes
    ----------
    path : str
    steps : tuple of str
    settings : tuple of (str, str)
    """

    path: str
    steps: tuple[str, ...]
    settings: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """Of its folder, and the one around it where that is the solver's or says more."""
        parts = self.path.split("/")
        return "_".join(part for part in parts[1:] if part != "laminar")


_FROM_0 = (("startTime", "0"), ("endTime", "0.2"))
TUTORIALS = (
    Tutorial("incompressible/icoFoam/cavity/cavity", ("blockMesh", "icoFoam")),
    Tutorial("incompressible/icoFoam/cavity/cavityGrade", ("blockMesh", "icoFoam"), _FROM_0),
    Tutorial("incompressible/icoFoam/cavity/cavityClipped", ("blockMesh", "icoFoam"), _FROM_0),
    Tutorial("incompressible/icoFoam/elbow", ("fluentMeshToFoam elbow.msh", "icoFoam")),
    Tutorial(
        "incompressible/nonNewtonianIcoFoam/offsetCylinder", ("blockMesh", "nonNewtonianIcoFoam"),
        (("endTime", "0.5"),),
    ),
    Tutorial(
        "incompressible/pisoFoam/laminar/porousBlockage", ("blockMesh", "topoSet", "pisoFoam"),
        (("endTime", "20"), ("writeInterval", "10")),
    ),
    Tutorial(
        "incompressible/pimpleFoam/laminar/planarContraction", ("blockMesh", "pimpleFoam"),
        (("endTime", "0.02"),),
    ),
    Tutorial("basic/potentialFoam/pitzDaily", ("blockMesh", "potentialFoam -writephi")),
    # Its U is given.
    Tutorial("basic/scalarTransportFoam/pitzDaily", ("blockMesh",)),
    Tutorial(
        "electromagnetics/mhdFoam/hartmann", ("blockMesh", "mhdFoam"), (("endTime", "0.5"),),
    ),
    Tutorial(
        "multiphase/interFoam/laminar/damBreak/damBreak", ("blockMesh", "setFields", "interFoam"),
        (("endTime", "0.2"),),
    ),
    Tutorial(
        "multiphase/twoLiquidMixingFoam/lockExchange",
        ("blockMesh", "setFields", "twoLiquidMixingFoam"), (("endTime", "5"),),
    ),
    Tutorial(
        "heatTransfer/buoyantBoussinesqPimpleFoam/BenardCells",
        ("blockMesh", "buoyantBoussinesqPimpleFoam"), (("endTime", "300"),),
    ),
    Tutorial(
        "compressible/sonicFoam/laminar/forwardStep", ("blockMesh", "sonicFoam"),
        (("endTime", "0.5"),),
    ),
)  # fmt: skip


def require_examples(examples: Path = EXAMPLES) -> None:
    """RunError, with the remedy, where the tutorials are not installed."""
    if not examples.is_dir():
        raise RunError(f"OpenFOAM's examples are missing ({examples}). Install them: {INSTALL}")


def copy_tutorial(tutorial: Tutorial, target: Path, examples: Path = EXAMPLES) -> None:
    """A copy that can be solved: unpacked dictionaries, and a 0 from 0.orig."""
    shutil.copytree(examples / tutorial.path, target)
    for packed in [
        *target.glob("*.gz"),
        *target.glob("system/*.gz"),
        *target.glob("constant/*.gz"),
    ]:
        packed.with_suffix("").write_bytes(gzip.decompress(packed.read_bytes()))
        packed.unlink()
    if (target / "0.orig").is_dir() and not (target / "0").is_dir():
        shutil.copytree(target / "0.orig", target / "0")
    (target / "constant").mkdir(exist_ok=True)


def solve(tutorial: Tutorial, folder: Path, examples: Path = EXAMPLES) -> Path:
    """The solved case in `folder`; RunError, with the end of its log, where a step fails."""
    case = folder / tutorial.name
    if (case / _DONE).is_file():
        return case
    shutil.rmtree(case, ignore_errors=True)
    copy_tutorial(tutorial, case, examples)
    sets = [
        f"foamDictionary -entry {key} -set {value} system/controlDict"
        for key, value in tutorial.settings
    ]
    for step in (*sets, *tutorial.steps):
        _run(step, case)
    (case / _DONE).touch()
    return case


def _run(step: str, case: Path) -> None:
    environment = {**foam_environment(), "LC_ALL": "C", "HOME": os.environ.get("HOME", str(case))}
    done = subprocess.run(
        step.split(), cwd=case, env=environment, capture_output=True, text=True, errors="replace",
        check=False, timeout=_LONGEST,
    )  # fmt: skip
    if done.returncode:
        last = "\n".join((done.stdout + done.stderr).splitlines()[-8:])
        raise RunError(f"{step} in {case.name} ended with status {done.returncode}:\n{last}")


def solve_all(folder: Path, tutorials: Sequence[Tutorial] = TUTORIALS) -> Iterator[Path]:
    """The tutorials, solved one by one in `folder`."""
    require_examples()
    folder.mkdir(parents=True, exist_ok=True)
    with ProgressReporter("tutorials") as report:
        for number, tutorial in enumerate(tutorials):
            report(f"solving {tutorial.name}", number / len(tutorials))
            yield solve(tutorial, folder)


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve them; prints their folders."""
    parser = argparse.ArgumentParser(description="OpenFOAM's plane laminar tutorials, solved")
    parser.add_argument("folder", type=Path)
    for case in solve_all(parser.parse_args(arguments).folder):
        sys.stdout.write(f"{case}\n")
    return 0


if __name__ == "__main__":
    run_in_words(main)

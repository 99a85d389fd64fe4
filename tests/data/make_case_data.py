"""Make small solutions of the package's cases with patches: run again only if their foam_cases change.

    python tests/data/make_case_data.py [NAME ...]

channel_8, step_6, cylinder_8, ring_8 : on so many cells a side; elbow : on its own triangles;
vortex_street_8 : both halves of its period and the beginning of the next one, on a coarse mesh.
All files are packed by gzip; of each time U and phi are kept.
"""

from __future__ import annotations

import argparse
import gzip
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.times import solved_times

HERE = Path(__file__).parent
CASES = {"channel": 8, "step": 6, "cylinder": 8, "ring": 8, "elbow": None, "vortex_street": 8}
# Of twenty folders a period, every tenth.
EVERY = 10
KEPT = ("U", "phi")


def packed(source: Path, target: Path) -> None:
    """A copy packed by gzip, which is the same whenever it is made."""
    target.parent.mkdir(parents=True, exist_ok=True)
    data = source.read_bytes()
    target.with_name(f"{target.name}.gz").write_bytes(gzip.compress(data, 9, mtime=0))


def keep(solved: Path, target: Path) -> None:
    """The mesh, the dictionaries and the last times of a solved case."""
    shutil.rmtree(target, ignore_errors=True)
    for name in ("points", "faces", "owner", "neighbour", "boundary"):
        packed(solved / "constant/polyMesh" / name, target / "constant/polyMesh" / name)
    for name in ("constant/transportProperties", "system/controlDict"):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(solved / name, target / name)
    times = [time for time in solved_times(solved) if float(time) > 0.0]
    for time in times[::-EVERY]:
        for name in KEPT:
            packed(solved / time / name, target / time / name)


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve each case in a scratch folder and keep what the readers need."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(CASES))
    for name in parser.parse_args(arguments).names:
        cells = CASES[name]
        with tempfile.TemporaryDirectory() as scratch:
            solved = solve_case(name, cells, out=Path(scratch) / name)
            keep(solved, HERE / (name if cells is None else f"{name}_{cells}"))


if __name__ == "__main__":
    main()

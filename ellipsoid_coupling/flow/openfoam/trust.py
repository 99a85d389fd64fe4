"""Untrusted cases: a case is read into plain values, and the solver gets files written anew from these.

OpenFOAM's dictionaries can hold C++ that it compiles, load libraries, call the shell, take in other
files, delete and write elsewhere. To detect all of that a reader would have to match OpenFOAM's in every
detail. So OpenFOAM never reads a stranger's dictionary: `plain_case` parses each file that a plane laminar
case needs (`dictionary`: words, numbers, lists, dictionaries), checks every entry against the list
of those known (`tables`, `blocks`, `start`) and writes each file from the values that it has read.
No byte of the case is passed on. A second wall stands around the solver, see `confine`.

The package's own cases take the same way. A user who has read a case can pass its own files on, `--trust`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_SCENE_BYTES, MOST_START_BYTES
from ellipsoid_coupling.files.reading import is_folder, read_bytes, unpack
from ellipsoid_coupling.flow.openfoam.blocks import block_mesh, patch_types
from ellipsoid_coupling.flow.openfoam.case import Mesh
from ellipsoid_coupling.flow.openfoam.dictionary import Number, Section, parse, word_of
from ellipsoid_coupling.flow.openfoam.files import packed
from ellipsoid_coupling.flow.openfoam.own_mesh import read_own_mesh
from ellipsoid_coupling.flow.openfoam.rules import (
    braces,
    entries,
    figure,
    name_of,
    one,
    real_of,
    whole_of,
)
from ellipsoid_coupling.flow.openfoam.run_control import Run, control
from ellipsoid_coupling.flow.openfoam.scanner import TRUST, Source
from ellipsoid_coupling.flow.openfoam.start import KINDS, fixes_level, start_field
from ellipsoid_coupling.flow.openfoam.tables import (
    SCHEMES,
    require_block,
    solution,
    transport,
    turbulence,
)
from ellipsoid_coupling.flow.openfoam.times import times_of

# Where there is a blockMeshDict, the mesh is made anew: this folder is not copied.
LEFT_OUT = "polyMesh"

PARAMETERS = "system/parameters"
_MODEL = "turbulenceProperties"
# Initial residual of U that ends a run whose system/parameters has no atRest.
AT_REST = 1e-6
# The first residual is 1: a run to that would be none.
_LARGEST_REST = 0.999
MOST_CELLS = 10**9
# Of a hexahedron: no patch has more faces than all cells together.
_FACES = 6
# Never read by the programs that run here, and often in a case.
_UNREAD = frozenset((
    "turbulenceProperties", "momentumTransport", "RASProperties", "LESProperties",
    "g", "foamDataToFluentDict", "mapFieldsDict", "PDRblockMeshDict",
    "sampleDict", "streamlines", "probes", "phi", "Phi", "streamFunction",
    "k", "epsilon", "omega", "nut", "nuTilda", "R", "uniform", LEFT_OUT,
))  # fmt: skip


@dataclass(frozen=True)
class PlainCase:
    """A checked case, and the numbers of its run.

    files : the text of each by its name below the case
    cells : a side, by system/parameters; mesh_cells : all of them
    scales : whether mesh and start follow from `cells`
    mesh : the case's own, if it has no blockMeshDict
    """

    files: Mapping[str, str]
    cells: int
    run: Run
    mesh_cells: float
    scales: bool
    mesh: Mesh | None


def start_folder(case: Path) -> str:
    """The folder of the start: 0.orig where there is one, else 0."""
    return "0.orig" if is_folder(case / "0.orig") else "0"


def input_folders(case: Path) -> tuple[str, str, str]:
    """The folders that a case must have."""
    return start_folder(case), "constant", "system"


def plain_case(case: Path, cells: int | None, processes: int, *, to_rest: bool = True) -> PlainCase:
    """The files of a run, written from the values of the case's own.

    Parameters
    ----------
    case : a folder with 0.orig (or 0), constant and system; nothing is written there
    cells : instead of the number in system/parameters
    processes : for system/decomposeParDict
    to_rest : whether a case without atRest in system/parameters ends at rest, or at its endTime

    Raises InputError, with file and line, for everything that is not of the plain form above, and for
    files that a plane laminar case does not have.
    """
    _require_known(case)
    given = {"processes": processes} | ({} if cells is None else {"cells": cells})
    numbers = _numbers(case, given)

    def read(name: str) -> Section:
        return parse(_source(case, name), lambda: numbers)

    meshing = _meshing(case, cells, numbers)
    at_rest = numbers["atRest"].value if "atRest" in numbers else AT_REST * to_rest
    controls = read("system/controlDict")
    control_lines, run = control(controls, at_rest)
    _require_start(case, controls)
    if packed(case / "system" / "decomposeParDict"):  # the package writes its own
        read("system/decomposeParDict")
    solving = read("system/fvSolution")
    dictionaries = {
        "system/controlDict": control_lines,
        "system/decomposeParDict": _strips(processes),
        "system/fvSchemes": entries(read("system/fvSchemes"), SCHEMES),
        "system/fvSolution": solution(solving, run.application),
        "constant/transportProperties": transport(read(f"constant/{_viscosity_file(case)}")),
    }
    if run.application.modelled:
        dictionaries["constant/turbulenceProperties"] = turbulence(read(f"constant/{_MODEL}"))
    if meshing.blocks:
        dictionaries["system/blockMeshDict"] = meshing.blocks
    files = {name: _text(name, "dictionary", lines) for name, lines in dictionaries.items()}
    files[PARAMETERS] = "".join(f"{name} {figure(n.value)};\n" for name, n in numbers.items())
    for name, kind in (("U", "volVectorField"), ("p", "volScalarField")):
        source = _source(case, f"{start_folder(case)}/{name}")
        lines = start_field(
            parse(source, lambda: numbers, longest=_FACES * int(meshing.cells)),
            name,
            meshing.patches,
        )
        if name == "p":
            require_block(solving, run.application, fixed=fixes_level(lines))
        for start in ("0", "0.orig"):
            files[f"{start}/{name}"] = _text(f"{start}/{name}", kind, lines)
    scales = meshing.scales and not any("nonuniform" in text for text in files.values())
    return PlainCase(
        files, meshing.side, run, meshing.cells, scales, meshing.own
    )  # fmt: skip


def _require_start(case: Path, controls: Section) -> None:
    """InputError where system/controlDict starts from another time than 0, which alone is read."""
    # OpenFOAM's own choice where there is none.
    word = word_of(controls, "startFrom") or "latestTime"
    times = times_of(case)
    if word == "startTime" or not times:
        return
    start = times[0 if word == "firstTime" else -1]
    if float(start) != 0.0:
        raise controls.source.error(
            controls.places.get("startFrom", controls.at),
            "startFrom startTime, as a case is solved from time 0",
            f"{word} beside a time {start}", "Change it, or remove the other times.",
        )  # fmt: skip


@dataclass(frozen=True)
class _Meshing:
    """The mesh of a case: blockMeshDict's lines or the case's own, patches, cells, cells a side."""

    blocks: list[str]
    own: Mesh | None
    patches: dict[str, str]
    cells: float
    side: int
    scales: bool


def _meshing(case: Path, cells: int | None, numbers: Mapping[str, Number]) -> _Meshing:
    """The mesh of a case: blockMesh makes it, or it is there."""
    path = case / "system" / "blockMeshDict"
    if packed(path) is None and packed(case / "constant" / LEFT_OUT / "points"):
        mesh = read_own_mesh(case)
        side = _fixed_side(case / "constant" / LEFT_OUT, cells, case, mesh.cells)
        patches = {patch.name: patch.kind for patch in mesh.patches}
        return _Meshing([], mesh, patches, mesh.cells, side, scales=False)
    section = parse(_source(case, "system/blockMeshDict"), lambda: numbers)
    blocks, count = block_mesh(section)
    scales = "cells" in section.used
    side = int(numbers["cells"].value) if scales else _fixed_side(path, cells, case, count)
    return _Meshing(blocks, None, patch_types(section), count, side, scales)


def _numbers(case: Path, given: Mapping[str, int]) -> dict[str, Number]:
    """The entries of system/parameters, all of them numbers; none if there is no such file."""
    if packed(case / PARAMETERS) is None:
        return {}
    section = parse(_source(case, PARAMETERS), given=given)
    if "cells" in section.entries:
        whole_of(section, "cells", 1, MOST_CELLS)
    if "atRest" in section.entries:
        real_of(section, "atRest", 0.0, _LARGEST_REST)
    return {
        name_of(section, name, section.places[name]): one(section, name, Number, f"a number {name}")
        for name in section.entries if name != "FoamFile"
    }  # fmt: skip


def _fixed_side(mesh: Path, cells: int | None, case: Path, mesh_cells: float) -> int:
    """Cells a side of a mesh that does not follow from `cells`; InputError if others are asked for."""
    own = _numbers(case, {}).get("cells")
    side = round(mesh_cells**0.5) if own is None else int(own.value)
    if cells not in (None, side):
        raise InputError(
            str(mesh), f"blocks of ($cells $cells 1) cells, to make {cells} a side",
            "other numbers", f"Write $cells there, or take the {side} that there are.",
        )  # fmt: skip
    return side


def _viscosity_file(case: Path) -> str:
    """The file with nu; OpenFOAM.org's has another name since version 9."""
    own, other = "transportProperties", "physicalProperties"
    folder = case / "constant"
    return other if packed(folder / own) is None and packed(folder / other) else own


def _strips(processes: int) -> list[str]:
    """system/decomposeParDict: the mesh in strips, one a process."""
    strips = [f"n ({processes} 1 1);", "delta 0.001;"]
    head = [f"numberOfSubdomains {processes};", "method simple;"]
    return [*head, *braces("simpleCoeffs", strips)]


def _text(name: str, kind: str, lines: list[str]) -> str:
    """A file with OpenFOAM's header."""
    written = ["version 2.0;", "format ascii;", f"class {kind};", f"object {name.split('/')[1]};"]
    return "\n".join([*braces("FoamFile", written), "", *lines, ""])


def _require_known(case: Path) -> None:
    """InputError for a file that may be meant to change the flow, and that no run here would read."""
    known = {
        start_folder(case): {*KINDS},
        "constant": {_viscosity_file(case)},
        "system": {
            "parameters", "blockMeshDict", "controlDict", "fvSchemes", "fvSolution",
            "decomposeParDict",
        },
    }  # fmt: skip
    for folder, names in known.items():
        for path in sorted((case / folder).iterdir()):
            name = path.name.removesuffix(".gz")
            if name not in names | _UNREAD and not name.startswith(".") and not name.endswith("~"):
                expected = f"nothing but {', '.join(sorted(names))} in {folder}"
                remedy = f"Remove the file; {TRUST[0].lower()}{TRUST[1:]}"
                raise InputError(str(path), expected, f"a file {name}", remedy)


def _source(case: Path, name: str) -> Source:
    """A dictionary of a case, unpacked, a character a byte."""
    expected = f"a case laid out as foam_cases/cavity is, with {name}"
    path = packed(case / name)
    if path is None:
        raise InputError(str(case / name), expected, "no such file", "Add it.")
    most = MOST_START_BYTES if name.split("/")[-1] in KINDS else MOST_SCENE_BYTES
    data = read_bytes(path, expected, most)
    if path.suffix == ".gz":
        data = unpack(data, path, expected, most)
    return Source(path, data.decode("latin-1"))

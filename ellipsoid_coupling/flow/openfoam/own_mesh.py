"""A mesh that a case brings with it instead of blockMeshDict: checked, and written anew for the solver."""

from __future__ import annotations

import re
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.openfoam.blocks import PATCH_TYPES
from ellipsoid_coupling.flow.openfoam.case import Mesh, read_mesh, write_mesh
from ellipsoid_coupling.flow.openfoam.rules import PATCH_NAME
from ellipsoid_coupling.flow.openfoam.times import Places
from ellipsoid_coupling.flow.openfoam.tokens import name_at

# Pairs of patches would need further entries of the mesh.
_ALONE = tuple(kind for kind in PATCH_TYPES if kind != "cyclic")


def read_own_mesh(case: Path) -> Mesh:
    """constant/polyMesh of a case.

    Raises InputError for a broken mesh, and for a patch whose type or name is not passed to the solver.
    """
    folder = case / "constant" / "polyMesh"
    mesh = read_mesh(Places(folder, folder, folder))
    for patch in mesh.patches:
        if patch.kind not in _ALONE or not re.fullmatch(PATCH_NAME, patch.name):
            raise InputError(
                f"{folder / 'boundary'}, patch {patch.name}",
                f"a name of letters, digits and _.:+-, and a type of {', '.join(_ALONE)}",
                f"the type {patch.kind}", "Solve the case yourself, and give it with --flow.",
            )  # fmt: skip
    return mesh


def write_own_mesh(mesh: Mesh, case: Path) -> None:
    """constant/polyMesh of an empty case folder, from the mesh's numbers alone."""
    write_mesh(mesh, case)
    (case / "1").rmdir()
    boundary = case / "constant" / "polyMesh" / "boundary"
    head = boundary.read_text(encoding="ascii").partition("}")[0]
    patches = "".join(
        f"{patch_word(name)} {{ type {kind}; nFaces {count}; startFace {start}; }}\n"
        for name, kind, start, count, _ in mesh.patches
    )
    text = f"{head}}}\n\n{len(mesh.patches)}\n(\n{patches})\n"
    boundary.write_text(text, encoding="latin-1")


def patch_word(name: str) -> str:
    """A patch's name as a case has it: in quotes, where it is no word."""
    token = name_at(name.encode("latin-1"), 0)
    whole = token is not None and token.kind == "word" and token.text == name
    return name if whole else f'"{name}"'

"""What happens at each patch of the flow's case: as the scene says, else as the case's own type says.

    wall, symmetryPlane, symmetry     reflect
    cyclic                            periodic
    patch, and any other type         remove

Where the outline of the fluid is just the rectangle of the domain, its four sides say all of this
(`boundaries`), and nothing here is needed: see `is_outlined`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.boundary import BoundaryPart
from ellipsoid_coupling.scenes.scene import Domain
from ellipsoid_coupling.scenes.sides import SIDES

_BY_TYPE = {
    "wall": "reflect",
    "symmetryPlane": "reflect",
    "symmetry": "reflect",
    "cyclic": "periodic",
}
# Of the domain's size: an edge on a side of it. Meshes may be saved in single precision.
_SAME_PLACE = 1e-5


def patch_parts(scene: Scene, outline: Outline) -> dict[str, BoundaryPart]:
    """The kind of every patch of an outline, in its order, with the parameters that the scene gives.

    Raises
    ------
    InputError
        For a name in [boundaries] that is neither a side of the domain nor a patch.
    """
    require_patches(scene, outline.names)
    named = scene.boundaries or {}
    return {
        name: named.get(name) or BoundaryPart(kind=kind_of_type(kind))
        for name, kind in zip(outline.names, outline.types, strict=True)
    }


def kind_of_type(patch_type: str) -> str:
    """The kind of boundary that a patch of this type is, unless a scene says another."""
    return _BY_TYPE.get(patch_type, "remove")


def require_patches(scene: Scene, patches: tuple[str, ...]) -> None:
    """Refuse names in [boundaries] that are neither sides of the domain nor one of these patches.

    Raises
    ------
    InputError
    """
    unknown = [name for name in scene.named_patches if name not in patches]
    if unknown:
        raise InputError(
            f"scene {scene.name}, key boundaries.{unknown[0]}",
            f"a side of the domain ({', '.join(SIDES)}) or a patch of the flow's case "
            f"({', '.join(patches) or 'it has none'})",
            unknown[0], "Name one of these, or leave it out.",
        )  # fmt: skip


def same_place(domain: Domain) -> float:
    """How far an edge may be off a side of the domain that it lies on."""
    return _SAME_PLACE * max(domain.width, domain.height)


def on_sides(scene: Scene, outline: Outline) -> NDArray[np.bool_]:
    """(E,), which edges lie on a side of the domain, as wide as that or not."""
    domain = scene.domain
    tolerance = same_place(domain)
    lying = [
        np.abs(outline.ends[:, :, axis] - end).max(axis=1) <= tolerance
        for axis, side in enumerate((domain.x, domain.y))
        for end in side
    ]
    return np.asarray(np.any(lying, axis=0))


def is_outlined(scene: Scene, flow: FlowField | None) -> bool:
    """Whether patches bound the fluid, and not just the sides of the domain.

    That is so where an edge lies within the domain, as around a solid or at a curved wall, or where the
    scene names a patch.
    """
    if flow is None or flow.outline is None:
        return False
    if scene.named_patches:
        return True
    ends, domain = flow.outline.ends, scene.domain
    middle = ends.mean(axis=1)
    within = (middle[:, 0] > domain.x[0]) & (middle[:, 0] < domain.x[1])
    within &= (middle[:, 1] > domain.y[0]) & (middle[:, 1] < domain.y[1])
    return bool((within & ~on_sides(scene, flow.outline)).any())

"""Patches of the case: which kind each has, and when they count at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline, polygon_outline
from ellipsoid_coupling.geometry.patches import is_outlined, patch_parts
from ellipsoid_coupling.scenes import Scene

X, Y = (0.0, 4.0), (0.0, 1.0)
SOLID = np.array([[1.0, 0.4], [1.0, 0.6], [1.2, 0.6], [1.2, 0.4]])


def box(*inner: tuple[str, str, np.ndarray[Any, Any], bool]) -> Outline:
    """A channel from left to right, and further patches in it."""
    corners = [np.array(p) for p in ((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0))]
    lines = [np.array(pair) for pair in zip(corners, corners[1:] + corners[:1], strict=True)]
    named = [
        ("floor", "wall"),
        ("outlet", "patch"),
        ("ceiling", "symmetryPlane"),
        ("inlet", "patch"),
    ]
    sides = [(*name, line, False) for name, line in zip(named, lines, strict=True)]
    return polygon_outline([*sides, *inner])


def flow(outline: Outline | None) -> FlowField:
    x, y = np.linspace(*X, 17), np.linspace(*Y, 9)
    psi = np.repeat(y[:, None], x.size, axis=1)
    return FlowField.from_stream_function(psi, x, y, "plug flow", outline=outline)


def scene(**changes: Any) -> Scene:
    return ec.load_scene("rotation", {"domain.x": list(X), "domain.y": list(Y), "start.x": [0.2, 0.4],
                                      "start.y": [0.2, 0.4], **changes})  # fmt: skip


def test_the_types_of_a_case_are_the_defaults_and_the_scene_comes_first() -> None:
    outline = box(("solid", "wall", SOLID, True), ("left", "cyclic", SOLID, True))
    found = {name: part.kind for name, part in patch_parts(scene(), outline).items()}
    assert found == {
        "floor": "reflect", "outlet": "remove", "ceiling": "reflect", "inlet": "remove",
        "solid": "reflect", "left": "periodic",
    }  # fmt: skip
    changed = scene(**{"boundaries.solid.kind": "stick", "boundaries.left.kind": "remove"})
    found = {name: part.kind for name, part in patch_parts(changed, outline).items()}
    assert (found["solid"], found["left"]) == ("stick", "remove")


def test_a_name_that_is_no_patch_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(InputError, match=r"boundaries\.lid: .*floor, outlet, ceiling, inlet.*lid"):
        patch_parts(scene(**{"boundaries.lid.kind": "remove"}), box())


def test_patches_count_where_they_lie_within_the_domain_or_are_named() -> None:
    assert not is_outlined(scene(), None)
    assert not is_outlined(scene(), flow(None))
    assert not is_outlined(scene(), flow(box()))
    assert is_outlined(scene(**{"boundaries.outlet.kind": "remove"}), flow(box()))
    assert is_outlined(scene(), flow(box(("solid", "wall", SOLID, True))))
    smaller = scene(**{"domain.x": [0.1, 3.5]})
    assert not is_outlined(smaller, flow(box()))


def test_normals_point_into_the_fluid() -> None:
    """Counter-clockwise around the fluid, clockwise around a solid: to rounding."""
    outline = box(("solid", "wall", SOLID, True))
    middle = outline.ends.mean(axis=1) + 1e-6 * outline.normals()
    solid = (
        (middle[:, 0] > 1.0) & (middle[:, 0] < 1.2) & (middle[:, 1] > 0.4) & (middle[:, 1] < 0.6)
    )
    within = (middle > 0.0).all(axis=1) & (middle < (4.0, 1.0)).all(axis=1)
    assert (within & ~solid).all()
    assert outline.lengths().sum() == pytest.approx(10.8, rel=1e-15)

"""Gravity: V(r) = -g . r, by itself or together with an outer potential.

It is no kind of [outer_potential], but a section of its own, which may stand beside one.
"""

from __future__ import annotations

from typing import NamedTuple, cast

from ellipsoid_coupling.compiled.dispatch import register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.physics.outer.formulas import outer_energy, outer_force
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.kinds import Record


class Gravity(NamedTuple):
    """g, an acceleration."""

    x: float
    y: float


class WithGravity(NamedTuple):
    """An outer potential, and gravity."""

    outer: Record
    gravity: Gravity


@inline_kernel
def _energy(gravity: Gravity, x: float, y: float) -> float:
    return -(gravity.x * x + gravity.y * y)


@inline_kernel
def _force(gravity: Gravity, x: float, y: float) -> tuple[float, float]:  # noqa: ARG001
    return gravity.x, gravity.y


@inline_kernel
def _sum_of_energies(both: WithGravity, x: float, y: float) -> float:
    return outer_energy(both.outer, x, y) - (both.gravity.x * x + both.gravity.y * y)


@inline_kernel
def _sum_of_forces(both: WithGravity, x: float, y: float) -> tuple[float, float]:
    force_x, force_y = outer_force(both.outer, x, y)
    return force_x + both.gravity.x, force_y + both.gravity.y


register_formula(outer_energy, Gravity, _energy)
register_formula(outer_force, Gravity, _force)
register_formula(outer_energy, WithGravity, _sum_of_energies)
register_formula(outer_force, WithGravity, _sum_of_forces)


def scene_outer(scene: Scene) -> Record | None:
    """What pulls at particles by their place alone: a scene's outer potential, gravity, both or None."""
    outer, part = scene.outer_potential, scene.gravity
    if part is None:
        return outer
    gravity = Gravity(part.x, part.y)
    # Kernels take it like any other record.
    return gravity if outer is None else cast(Record, WithGravity(outer, gravity))

"""What a scene with periodic sides must fulfil, and which models know them."""

from __future__ import annotations

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene


def periodic_axes(scene: Scene) -> tuple[bool, bool]:
    """Whether y and x are periodic, in the order of a grid's axes."""
    sides = scene.sides
    return sides["bottom"].particles == "wrap", sides["left"].particles == "wrap"


def require_no_period(scene: Scene, model: str) -> None:
    """Refuse periodic sides for a model that does not know them.

    Raises
    ------
    InputError
    """
    for name, side in scene.sides.items():
        if side.particles == "wrap":
            raise InputError(
                f"scene {scene.name}, key boundaries.{name}.kind (or domain.boundary)",
                f"sides that {model} knows, which reflect or are left",
                side.kind,
                "Take another kind, or a model on a grid (rho_mono_kinetic, diffusive, q_maxwellian, "
                "q_mono_kinetic), which may be periodic.",
            )


def require_room(scene: Scene, grid: Grid) -> None:
    """Refuse periods that hold too few cells for ghosts, or that the interaction reaches around.

    Raises
    ------
    InputError
    """
    for letter, count, periodic in zip("yx", grid.shape, periodic_axes(scene), strict=True):
        if not periodic:
            continue
        where, remedy = f"scene {scene.name}, key domain.{letter}", "Change it, or numerics.cell."
        if count < GHOSTS:
            expected = f"at least {GHOSTS} cells in a period"
            raise InputError(where, expected, f"{count}", remedy)
        if scene.interaction is None:
            continue
        reach = potential_shape(scene.particles.length, scene.particles.width).reach
        if count % 2 or (count - 1) * grid.cell < 2.0 * reach:
            raise InputError(
                where,
                "with [interaction], a period of an even number of cells, and longer than twice "
                f"the potential's reach ({reach:g}) by a cell",
                f"{count} cells of {grid.cell:g}",
                remedy,
            )

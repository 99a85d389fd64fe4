"""What a scene with periodic sides must fulfil, and which models know them."""

from __future__ import annotations

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.geometry.boundaries import periodic_axes
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene


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
                "Take another kind, or another model: all others may be periodic.",
            )


def require_wide_periods(scene: Scene) -> None:
    """Refuse periods in which a particle's interaction reaches around: it would meet another one twice.

    Raises
    ------
    InputError
    """
    if scene.interaction is None:
        return
    reach = potential_shape(scene.particles.length, scene.particles.width).reach
    widths = scene.domain.height, scene.domain.width
    for letter, width, periodic in zip("yx", widths, periodic_axes(scene), strict=True):
        if periodic and width < 2.0 * reach:
            raise InputError(
                f"scene {scene.name}, key domain.{letter}",
                f"with [interaction], a period of at least twice the potential's reach ({reach:g})",
                f"{width:g}",
                "Change it, or particles.length.",
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

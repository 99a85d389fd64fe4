"""Warnings of a run that came to its end, as sentences: `Result.warnings`.

A model chooses those that apply to it and returns them in its `counts`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ellipsoid_coupling.scenes import Scene

# Which part of the mass at tilted walls is told, and how many times denser than all of the fluid it is: an
# even density lies there as anywhere, and nothing presses it.
_MASS_AT_WALLS, _CROWDED = 0.1, 2.0
# Differences of work between cells, in units of the temperature, up to which densities are kept.
_MOST_WORK = 4.0


def as_counts(*warnings: Sequence[str]) -> dict[str, str]:
    """The attribute `warnings` of the result file, one line each; no attribute without warnings."""
    lines = [line for some in warnings for line in some]
    return {"warnings": "\n".join(lines)} if lines else {}


def of_crossing(time: float) -> list[str]:
    """The time at which characteristics crossed; none for NaN."""
    if not math.isfinite(time):
        return []
    return [
        f"Characteristics crossed at t = {time:.4g}: a mono-kinetic closure has no meaning after that."
    ]


def of_start(scene: Scene) -> list[str]:
    """For a start that a grid cannot represent."""
    start, cell = scene.start, scene.numerics.cell
    if start.points:
        return [
            f"start.points start as whole cells of {cell:g}, each about the cell that holds it."
        ]
    sides = [high - low for low, high in (start.x, start.y)]
    # Boxes of one cell are given with rounding.
    if min(sides) >= cell * (1.0 - 1e-9):
        return []
    return [
        f"The start box is {sides[0]:.4g} x {sides[1]:.4g}, narrower than a cell of {cell:g}: it starts "
        "one cell wide, about the same middle."
    ]


def of_mixed_angles(scene: Scene) -> list[str]:
    """For a start whose angles differ so much that a mean angle represents none of them."""
    angles = [angle for _, _, angle in scene.start.places()]
    if not angles or max(angles) - min(angles) <= 0.5 * math.pi:
        return []
    return [
        "Start angles differ by more than pi/2: where particles of several angles meet, a cell has their "
        "mean, also of ellipses that look alike at 0 and pi."
    ]


def of_one_angle(scene: Scene, turns: bool) -> list[str]:
    """For a grid of one angle whose particles turn."""
    if not turns:
        return []
    return [
        f"Circles of diameter {scene.particles.length:g} look the same at every angle: this model does "
        "not follow it, and its distribution of the angle is even."
    ]


def of_tilted_walls(mass: float, cells: float, slides: bool) -> list[str]:
    """Where much of the mass lies in the cells at walls that are tilted to the grid.

    Parameters
    ----------
    mass, cells : float
        Which part of the mass they hold, and which part of the fluid's cells they are.
    slides : bool
        Whether they lose what goes into the wall, see `finite_volume.wall_cells`.
    """
    if mass < max(_MASS_AT_WALLS, _CROWDED * cells):
        return []
    off = "some 5 to 15 % off" if slides else "some 25 to 30 % too slow"
    return [
        f"{mass:.0%} of the mass lies in cells at walls that are tilted to the grid: what a force presses "
        f"against them is {off} along them, on any grid. Compare with mckean_vlasov."
    ]


def of_drag_work(work: float) -> list[str]:
    """Of a scheme that balances pressure and forces from cell to cell, where drag is all but rigid.

    work : float
        By how much gamma u h differs between cells, in units of the temperature.
    """
    if work <= _MOST_WORK:
        return []
    return [
        f"Drag does work across a cell, gamma u h, that differs by {work:.3g} between cells, more than "
        f"{_MOST_WORK:g}: in this scheme densities with pressure may be off by tens of per cent, even "
        "where they should stay even. Compare with q_mono_kinetic, scheme paper or smaller cells."
    ]

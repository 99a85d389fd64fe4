"""Where the fluid ends: walls as lines, openings dashed, solids and the outside grey."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Curve
from numpy.typing import NDArray

from ellipsoid_coupling.flow.inside import enclosed_area
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.output.figures.canvas import Extent
from ellipsoid_coupling.output.outlines import joined

Floats = NDArray[np.float64]


class _Pen(NamedTuple):
    """Colour, width in points, dashes as matplotlib has them, and what a line ends in."""

    colour: str
    width: float
    dashes: str | tuple[float, tuple[float, float]]
    cap: Literal["butt", "projecting"]


# Types of patches that fluid may cross.
_OPEN = ("patch", "cyclic")
_SOLID = "0.82"
# Of a wall on the rim of a panel only half is seen.
_WALL = _Pen("0.0", 2.2, "-", "projecting")
_OPENING = _Pen("0.45", 1.1, (0.0, (3.0, 2.0)), "butt")
# Wipes out the frame of a panel.
_BLANK = _Pen("white", 1.6, "-", "butt")
# Below what a panel shows, and above its frame.
_BELOW, _ABOVE = 0.8, 2.6
# Of the panel's size: an edge this near to its rim lies on it.
_NEAR = 1e-6


def add_walls(axes: Axes, outline: Outline | None, extent: Extent) -> None:
    """Draw an outline over a panel of this extent; nothing without one.

    Where an opening lies on the rim of the panel, its dashes take the place of the frame.
    """
    if outline is None:
        return
    axes.add_patch(
        PathPatch(_beyond(outline, extent), facecolor=_SOLID, edgecolor="none", zorder=0.5)
    )
    is_open = np.array([kind in _OPEN for kind in outline.types])[outline.patch]
    openings = outline.ends[is_open]
    on_rim = _on_rim(openings, extent)
    x_low, x_high, y_low, y_high = extent
    rim = np.clip(openings[on_rim], (x_low, y_low), (x_high, y_high))
    _add_lines(axes, outline.ends[~is_open], _WALL)
    _add_lines(axes, openings[~on_rim], _OPENING)
    _add_lines(axes, rim, _BLANK, above=True)
    _add_lines(axes, rim, _OPENING, above=True)


def _add_lines(axes: Axes, ends: Floats, pen: _Pen, *, above: bool = False) -> None:
    """Draw edges (E, 2, 2); `above`: over the frame, also the half of them that is outside.

    They are joined: one by one short edges look dotted, and each would begin its dashes anew.
    """
    if not len(ends):
        return
    lines = LineCollection(
        joined(ends),
        colors=pen.colour,
        linewidths=pen.width,
        linestyles=[pen.dashes],
        capstyle=pen.cap,
        clip_on=not above,
        zorder=_ABOVE if above else _BELOW,
    )
    axes.add_collection(lines, autolim=False)


def _on_rim(ends: Floats, extent: Extent) -> NDArray[np.bool_]:
    """Which edges (E, 2, 2) lie on the rim of a panel, part of them at least."""
    found = np.zeros(len(ends), np.bool_)
    for axis in (0, 1):
        low, high = extent[2 * axis : 2 * axis + 2]
        other_low, other_high = extent[2 - 2 * axis : 4 - 2 * axis]
        others = ends[:, :, 1 - axis]
        beside = (others.max(axis=1) > other_low) & (others.min(axis=1) < other_high)
        for place in (low, high):
            near = np.abs(ends[:, :, axis] - place).max(axis=1) <= _NEAR * (high - low)
            found |= near & beside
    return found


def _beyond(outline: Outline, extent: Extent) -> Curve:
    """All of an extent that is not fluid: where this curve's lines go around at all."""
    loops = [line[-2::-1] for line in joined(outline.ends)]
    if enclosed_area(outline.ends) > 0.0:
        x_low, x_high, y_low, y_high = extent
        frame = [(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]
        loops.append(np.array(frame))
    points = [np.vstack((loop, loop[:1])) for loop in loops]
    codes = [[Curve.MOVETO, *[Curve.LINETO] * (len(loop) - 1), Curve.CLOSEPOLY] for loop in loops]
    return Curve(np.concatenate(points), np.concatenate(codes))

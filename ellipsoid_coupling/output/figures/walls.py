"""Where the fluid ends: walls as lines, openings dashed, solids and the outside grey."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Curve
from numpy.typing import NDArray

from ellipsoid_coupling.flow.inside import enclosed_area
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.output.figures.canvas import Extent
from ellipsoid_coupling.output.outlines import outline_loops

Floats = NDArray[np.float64]

# Types of patches that fluid may cross.
_OPEN = ("patch", "cyclic")
_SOLID, _WALL, _OPENING = "0.82", "0.0", "0.45"
# In points; of a line on the rim of a panel only half is seen.
_WIDE, _FINE = 2.2, 0.9


def add_walls(axes: Axes, outline: Outline | None, extent: Extent) -> None:
    """Draw an outline over a panel of this extent; nothing without one."""
    if outline is None:
        return
    axes.add_patch(
        PathPatch(_beyond(outline, extent), facecolor=_SOLID, edgecolor="none", zorder=0.5)
    )
    is_open = np.array([kind in _OPEN for kind in outline.types])[outline.patch]
    looks = ((~is_open, _WALL, "-", _WIDE), (is_open, _OPENING, (0.0, (3.0, 2.0)), _FINE))
    for chosen, colour, style, width in looks:
        lines = LineCollection(
            list(outline.ends[chosen]),
            colors=colour,
            linestyles=style,
            linewidths=width,
            capstyle="projecting",
            zorder=0.8,
        )
        axes.add_collection(lines, autolim=False)


def _beyond(outline: Outline, extent: Extent) -> Curve:
    """All of an extent that is not fluid: where this curve's lines go around at all."""
    loops = [loop[::-1] for loop in outline_loops(outline)]
    if enclosed_area(outline.ends) > 0.0:
        x_low, x_high, y_low, y_high = extent
        frame = [(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]
        loops.append(np.array(frame))
    points = [np.vstack((loop, loop[:1])) for loop in loops]
    codes = [[Curve.MOVETO, *[Curve.LINETO] * (len(loop) - 1), Curve.CLOSEPOLY] for loop in loops]
    return Curve(np.concatenate(points), np.concatenate(codes))

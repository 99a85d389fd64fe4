"""Labels of points that keep clear of each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Where a label may stand, in points from its own; the earlier, the better.
_PLACES = (
    (6, 4, "left"),
    (-6, 4, "right"),
    (6, -9, "left"),
    (-6, -9, "right"),
    (0, 9, "center"),
    (0, -14, "center"),
    (9, -3, "left"),
    (-9, -3, "right"),
    (6, 14, "left"),
    (-6, 14, "right"),
    (6, -19, "left"),
    (-6, -19, "right"),
    (0, 17, "center"),
    (0, -23, "center"),
    (-16, 4, "right"),
    (-16, -9, "right"),
    (16, 4, "left"),
    (16, -9, "left"),
)
# A text of which more than this part is covered wherever it stands is left out: a line through it is
# more than that.
_MOST_COVERED = 0.03

Point = tuple[float, float, str]

# Half the size of the boxes that stand for a marker and for a line, in points.
_MARKER, _LINE = 3.5, 1.0


def place_labels(
    axes: Axes, lines: Sequence[Sequence[Point]], others: Sequence[Sequence[Point]] = ()
) -> None:
    """Write each point's text beside it, where it overlaps least with texts, lines and the frame.

    A text without a place that is clear is left out.

    Parameters
    ----------
    axes : its limits are final
    lines : of points (x, y, text) in the axes' data
    others : lines that are kept clear of, but not labelled
    """
    figure = axes.get_figure(root=True)
    if figure is None:
        return
    figure.draw_without_rendering()
    pixels = figure.dpi / 72.0
    drawn = [line for line in (*lines, *others) if line]
    taken = np.concatenate([np.empty((0, 4)), *(_line_boxes(axes, x, pixels) for x in drawn)])
    for x, y, text in (point for line in lines for point in line):
        note = axes.annotate(
            text, (x, y), (0, 0), textcoords="offset points", fontsize=6.5, color="0.25"
        )
        # Labels are laid out last and must not push the axes that they were measured in.
        note.set_in_layout(False)
        box, covered = _best_place(note, taken, axes.bbox)
        if covered > _MOST_COVERED:
            note.remove()
        else:
            taken = np.concatenate([taken, box])


def _line_boxes(axes: Axes, line: Sequence[Point], pixels: float) -> Floats:
    """Small boxes along a line, larger ones on its markers, (boxes, 4) as `Bbox.extents`.

    `pixels` are those of a point.
    """
    places = axes.transData.transform([point[:2] for point in line])
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    # Side by side, so that no text fits in between.
    steps = np.linspace(0.0, way[-1], 1 + int(way[-1] / (2.0 * _LINE * pixels)))
    along = np.stack([np.interp(steps, way, places[:, axis]) for axis in (0, 1)], axis=-1)
    parts = ((places, _MARKER * pixels), (along, _LINE * pixels))
    return np.concatenate([np.hstack([centres - half, centres + half]) for centres, half in parts])


def _best_place(note: Annotation, taken: Floats, frame: Bbox) -> tuple[Floats, float]:
    """Move the note to the first place with the least overlap.

    Returns the extents (1, 4) that it takes there, and the part of it that is covered or outside.
    """
    inside = np.array([frame.extents])
    trials = []
    for order, (right, up, side) in enumerate(_PLACES):
        note.set(position=(right, up), horizontalalignment=side)
        box = note.get_window_extent()
        outside = box.width * box.height - _overlap(box, inside)
        trials.append((_overlap(box, taken) + outside, order, box))
    overlap, order, box = min(trials, key=lambda trial: trial[:2])
    right, up, side = _PLACES[order]
    note.set(position=(right, up), horizontalalignment=side)
    return np.array([box.extents]), overlap / (box.width * box.height)


def _overlap(box: Bbox, others: Floats) -> float:
    """The area that a box shares with others (boxes, 4), summed over them."""
    low = np.maximum(box.extents[:2], others[:, :2])
    high = np.minimum(box.extents[2:], others[:, 2:])
    return float(np.prod(np.clip(high - low, 0.0, None), axis=1).sum())

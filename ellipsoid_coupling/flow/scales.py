"""A flow's own scales: how fast it is, how strongly it shears, and where it has room."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.field import FlowField

# Points a side at which a flow is looked at, and on a side of its rectangle.
_POINTS, _ON_A_SIDE = 200, 401


class FlowScales(NamedTuple):
    """Of the fluid within a box.

    largest, typical : speeds, the largest and the root of the mean square
    shear : the largest rate of shear, ((du_x/dx - du_y/dy)^2 + (du_x/dy + du_y/dx)^2)^(1/2)
    divergence : the largest du_x/dx + du_y/dy, of either sign; 0 without sources
    """

    largest: float
    typical: float
    shear: float
    divergence: float = 0.0


Box = tuple[tuple[float, float], tuple[float, float]]


def flow_scales(field: FlowField, box: Box) -> FlowScales:
    """The scales of a flow within x = box[0], y = box[1], where there is fluid; 0 without fluid."""
    x, y = _middles(box, _POINTS)
    sample = field.evaluate(*np.meshgrid(x, y))
    if not sample.inside.any():
        return FlowScales(0.0, 0.0, 0.0)
    speed = np.hypot(sample.velocity_x, sample.velocity_y)[sample.inside]
    shear = np.hypot(2.0 * sample.stretch, sample.dux_dy + sample.duy_dx)[sample.inside]
    swelling = np.abs(sample.dux_dx + sample.duy_dy)[sample.inside]
    typical = float(np.sqrt(np.mean(speed**2)))
    return FlowScales(float(speed.max()), typical, float(shear.max()), float(swelling.max()))


def normal_speed(field: FlowField, side: int) -> float:
    """The mean speed at which fluid passes a side of the flow's rectangle, over its points in the fluid.

    side : 0 to 3, left, right, bottom, top
    """
    axis, end = divmod(side, 2)
    ends = field.bounds[:2], field.bounds[2:]
    along = np.linspace(*ends[1 - axis], _ON_A_SIDE)
    across = np.full(_ON_A_SIDE, ends[axis][end])
    sample = field.evaluate(*((across, along) if axis == 0 else (along, across)))
    normal = sample.velocity_x if axis == 0 else sample.velocity_y
    return float(np.mean(np.abs(normal), where=sample.inside)) if sample.inside.any() else 0.0


def roomiest_box(field: FlowField, box: Box) -> Box | None:
    """The largest rectangle of a box that is all fluid, to a 200th of the box; None without fluid."""
    x, y = _middles(box, _POINTS)
    found = largest_rectangle(np.asarray(field.evaluate(*np.meshgrid(x, y)).inside))
    if found is None:
        return None
    (left, right), (low, high) = found
    steps = [(side[1] - side[0]) / _POINTS for side in box]
    return (
        (box[0][0] + left * steps[0], box[0][0] + right * steps[0]),
        (box[1][0] + low * steps[1], box[1][0] + high * steps[1]),
    )


def _middles(box: Box, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The middles of `count` equal parts of each side."""
    part = (np.arange(count) + 0.5) / count
    x, y = (low + part * (high - low) for low, high in box)
    return x, y


def largest_rectangle(
    inside: NDArray[np.bool_],
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Columns and rows, [first, last), of the largest rectangle of True.

    Row by row: `height` counts the True above each column; a stack holds the columns at which
    rectangles of rising height begin.
    """
    best, area = None, 0
    height = np.zeros(inside.shape[1], np.int64)
    for row, line in enumerate(inside):
        height = np.where(line, height + 1, 0)
        open_ones: list[tuple[int, int]] = []
        for column, now in enumerate([*height.tolist(), 0]):
            start = column
            while open_ones and open_ones[-1][1] >= now:
                start, tall = open_ones.pop()
                if tall * (column - start) > area:
                    area = tall * (column - start)
                    best = (start, column), (row + 1 - tall, row + 1)
            open_ones.append((start, now))
    return best

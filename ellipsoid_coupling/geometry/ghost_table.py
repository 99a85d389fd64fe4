"""Which cells of the domain a grid's ghost cells follow from: a table with a row for each side.

    y     . . t t t t t t . .        o            cells of the domain, here 6 x 3
    |     . . t t t t t t . .        l, r, b, t   two layers of ghosts of the left, right, bottom, top
    |     l l o o o o o o r r        .            corners, which no sweep looks at
    |     l l o o o o o o r r
    |     l l o o o o o o r r        All these are cells of one padded plane; a cell's number counts
    |     . . b b b b b b . .        row by row from the lower left corner, so that the next cell along
    |     . . b b b b b b . .        y is `columns + 4` further on.
    +------------------------- x

Of its first layer, the one at the edge, a row of the table holds the first ghost with the cells that it
follows from, and how to get on from there:

    row      ghost   edge   image    to the next layer of      width   stride    axis   normal
                                     ghosts       images
    left     2,1     2,2    2,2      1 to the left   right     rows    a row     x      +1
    bottom   1,2     2,2    2,2      1 down          up        columns 1         y      +1
    right, top       likewise, from the other end                                       -1

(cells as row, column of the padded plane). Images of a periodic side begin at the other side and go the
way that the ghosts go. Ghosts of the same layer are `stride` apart, `width` of them: along y they lie
side by side in memory, and a loop over them vectorises.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.boundaries import Boundaries, at_side

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Rows, in this order, and columns of a table.
LEFT, RIGHT, BOTTOM, TOP = range(4)
GHOST, EDGE, IMAGE, NEXT_GHOST, NEXT_IMAGE, WIDTH, STRIDE, NORMAL = range(8)
# Columns of `places`: the middle of the first ghost's face, and the way to the next one.
X, Y, STEP_X, STEP_Y = range(4)


class GhostTable(NamedTuple):
    """See the module.

    Attributes
    ----------
    kinds : Boundaries
        The last column of the table: the kind of each row.
    cells : (4, 8) int64
        Rows LEFT, RIGHT, BOTTOM, TOP; columns GHOST .. NORMAL.
    places : (4, 4) float64
        The first ghost's face, and the step to the next one: columns X .. STEP_Y.
    first : int
        The first ghost of the lowest row of cells.
    angle_width : float
        From plane to plane of a q-grid; 0 on an r-grid.
    """

    kinds: Boundaries
    cells: Indices
    places: Floats
    first: int
    angle_width: float


def ghost_table(
    kinds: Boundaries,
    shape: tuple[int, int],
    layers: int,
    corner: tuple[float, float] = (0.0, 0.0),
    cell: float = 1.0,
    angle_width: float = 0.0,
) -> GhostTable:
    """The table of a grid of square cells.

    Parameters
    ----------
    kinds : Boundaries
    shape : (int, int)
        Cells of the domain, (ny, nx).
    layers : int
        Of ghosts.
    corner : (float, float)
        x and y of the domain's lower left corner.
    cell : float
        The cells' width.
    angle_width : float
        From plane to plane, radian.
    """
    rows, columns = shape
    row = columns + 2 * layers
    start = layers * (row + 1)
    x, y = corner
    # Along x a cell is 1 further on, along y a row; from side to side it is so many of them.
    along_x = _pair(kinds[:2], columns, 1, start, (rows, row))
    along_y = _pair(kinds[2:], rows, row, start, (columns, 1))
    half = 0.5 * cell
    places = [
        (x, y + half, 0.0, cell),
        (x + columns * cell, y + half, 0.0, cell),
        (x + half, y, cell, 0.0),
        (x + half, y + rows * cell, cell, 0.0),
    ]
    cells = np.array([*along_x, *along_y], np.int64)
    return GhostTable(kinds, cells, np.array(places), layers * row, angle_width)


def _pair(
    kinds: tuple[object, ...], count: int, step: int, start: int, across: tuple[int, int]
) -> list[tuple[int, ...]]:
    """The rows of both sides of `count` cells, `step` apart, of which `start` is the first."""
    last = start + (count - 1) * step
    rows: list[tuple[int, ...]] = []
    for kind, edge, other, out in zip(
        kinds, (start, last), (last, start), (-step, step), strict=True
    ):
        image, next_image = (other, out) if at_side(kind) == "wrap" else (edge, -out)
        rows.append((edge + out, edge, image, out, next_image, *across, 1 if out < 0 else -1))
    return rows

"""The lines of a staircase: what a sweep goes along where solids, or patches, bound the fluid.

A line is a run of fluid cells along x or y, from boundary to boundary. It is swept by itself, in memory of
its own, with two ghosts at either end, so that a solid one cell thick, or a plate between two cells, needs
no room for ghosts:

    cells     . . # . . . | . .           #  solid      |  plate
    lines     a a   b b b   c c
    b         g g b b b g g               ghosts of the kind of what closes each of its ends

Where x is periodic, the line that reaches one side goes on at the other one; if nothing closes it, it is a
ring, whose ghosts are its own cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.fluxes.in_fluid import FluidMotion
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.finite_volume.wall_cells import WallCells
from ellipsoid_coupling.geometry.boundaries import Periodic, Reflect, at_side
from ellipsoid_coupling.geometry.fluid_cells import NONE, Faces, FluidCells

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

# The lower and the upper end of a line.
LOW, HIGH = range(2)


class LineTable(NamedTuple):
    """The lines along one axis, T of them.

    Attributes
    ----------
    row : (T,) int64
        First cell of the whole row (or column) of cells that a line is part of, a flat cell of a padded
        plane.
    start, length : (T,) int64
        The line's first cell in that row, and its cells; beyond the row's end it goes on at its beginning.
    slot : (T,) int64
        Where the line's first ghost stands in arrays of all lines one after the other.
    ring : (T,) bool
        Whether its ends meet.
    kind, boundary : (T, 2) int64
        What closes either end: numbers in `FluidLines.kinds` and `FluidLines.boundaries`.
    carried : (T, 2) int64
        The row of `FluidLines.carried` of either end.
    faces : (T, 2, 2) float64
        The middle of the face at either end, x and y.
    cells, stride, row_stride : int
        In a whole row; from cell to cell, and from row to row, of a padded plane.
    size : int
        Of arrays of all lines.
    """

    row: Indices
    start: Indices
    length: Indices
    slot: Indices
    ring: Flags
    kind: Indices
    boundary: Indices
    carried: Indices
    faces: Floats
    cells: int
    stride: int
    row_stride: int
    size: int

    @property
    def rows(self) -> Indices:
        """Which row (or column) of cells each line is part of, (T,)."""
        # Padded planes begin with ghosts of both directions.
        return np.asarray((self.row - GHOSTS * (self.row_stride + self.stride)) // self.row_stride)

    def places(self) -> tuple[Indices, Indices]:
        """Of every cell of every line its line, and its place in the whole row."""
        line = np.repeat(np.arange(self.length.size), self.length)
        step = np.arange(line.size) - np.repeat(np.cumsum(self.length) - self.length, self.length)
        return line, (self.start[line] + step) % self.cells

    def slots(self) -> Indices:
        """Where every cell of every line stands in arrays of all lines."""
        line = np.repeat(np.arange(self.length.size), self.length)
        before = np.cumsum(self.length) - self.length
        return np.asarray(self.slot[line] + GHOSTS + np.arange(line.size) - before[line])


class Ends(NamedTuple):
    """What may close a face: the kinds by boundary, the boundary of each edge, and of each side.

    names : tuple of str; kinds : of as many, any of `geometry.boundaries`.
    edge : (E,) int64, the boundary of each edge of the outline.
    sides : (4,) int64, those of left, right, bottom, top.
    """

    names: tuple[str, ...]
    kinds: tuple[object, ...]
    edge: Indices
    sides: Indices

    def of_faces(self, owner: Indices, side: int) -> Indices:
        """The boundary of each closed face, -1 of the others; side : that of the domain at this end."""
        # The side stands last, where -1 points to; an edge has its own number. There may be no edge at all.
        known = np.append(self.edge, self.sides[side])
        return np.where(owner == NONE, -1, known[np.where(owner < 0, -1, owner)])

    def reflects(self, boundary: Indices) -> Flags:
        """Whether particles turn round there; False where nothing closes."""
        found = [at_side(kind) == "reflect" for kind in self.kinds]
        # -1, no boundary, is the last one: False.
        return np.append(found, False)[boundary].astype(bool)

    def wraps(self, boundary: Indices) -> Flags:
        """Whether a boundary is periodic."""
        found = [at_side(kind) == "wrap" for kind in self.kinds]
        return np.append(found, False)[boundary].astype(bool)


class FluidLines(NamedTuple):
    """See the module.

    Attributes
    ----------
    inside : (ny, nx) bool
        The cells of the fluid.
    boundaries : tuple of str
        The names of patches and sides.
    kinds : tuple
        Each kind once.
    tables : dict
        The lines along each axis, -1 and -2.
    carried : dict
        What the fluid carries of a density 1 through faces at inlets, (K, rows planes) along each axis, in
        the flux's order, plane by plane; row 0 is of all other faces.
    motion : dict
        The fluid along each axis, flat like the lines, of a step that follows it; None without a fluid.
    fastest : float
        The largest velocity, summed over both faces, by which a cell empties along an axis.
    walls : WallCells or None
        The cells at tilted walls; None where there are none.
    slides : bool
        Whether they lose what goes into the walls: in systems without pressure, see `wall_cells`.
    """

    inside: Flags
    boundaries: tuple[str, ...]
    kinds: tuple[object, ...]
    tables: dict[int, LineTable]
    carried: dict[int, Floats]
    motion: dict[int, FluidMotion | None]
    fastest: float
    walls: WallCells | None = None
    slides: bool = False

    @property
    def has_inflow(self) -> bool:
        """Whether the fluid may carry anything in."""
        return any((table.carried > 0).any() for table in self.tables.values())

    @property
    def is_passed(self) -> list[bool]:
        """Of each boundary whether it closes a line and mass may pass it."""
        found: set[int] = set()
        for table in self.tables.values():
            # A ring has no ends, and the numbers that stand there mean nothing.
            ends = table.boundary[~table.ring]
            kinds = [at_side(self.kinds[kind]) for kind in table.kind[~table.ring].ravel()]
            found |= {int(b) for b, act in zip(ends.ravel(), kinds, strict=True) if act == "leave"}
        return [k in found for k in range(len(self.boundaries))]

    @property
    def without_inflow(self) -> FluidLines:
        """With nothing carried in."""
        nothing = {axis: np.zeros_like(rows) for axis, rows in self.carried.items()}
        return self._replace(carried=nothing)

    def fluid(self, axis: int, follows: float, second: bool) -> FluidMotion | None:
        """The fluid along an axis, of which cells follow this part; see `fluxes.in_fluid`."""
        motion = self.motion[axis]
        if motion is None:
            return None
        motion = motion._replace(follows=follows, second=float(second))
        if self.walls is None or not self.slides or follows in (0.0, 1.0):
            return motion
        return self.walls.with_all_fluid(motion, axis)

    def slide(self, fields: Floats, velocities: tuple[int, ...], in_fluid: bool) -> None:
        """Take what goes into tilted walls; see `WallCells.slide`."""
        if self.walls is not None and self.slides:
            self.walls.slide(fields, velocities, self.motion, in_fluid)


def _each_once(kinds: tuple[object, ...]) -> tuple[object, ...]:
    # Kinds without parameters are empty tuples, which are all equal.
    return tuple({(type(kind), repr(kind)): kind for kind in kinds}.values())


def _number(kinds: tuple[object, ...], kind: object) -> int:
    """Where a kind stands in `kinds`."""
    wanted = type(kind), repr(kind)
    return [(type(one), repr(one)) for one in kinds].index(wanted)


def line_tables(
    cells: FluidCells, ends: Ends, grid: Grid
) -> tuple[dict[int, LineTable], tuple[object, ...]]:
    """The lines along x (-1) and y (-2), and the kinds that they end with."""
    # The last two whatever the scene has: for rings, and for a periodic side without fluid behind it.
    kinds = _each_once((*ends.kinds, Periodic(), Reflect()))
    row = grid.padded[1]
    corner = GHOSTS * (row + 1)
    along_x = _table(cells.x, ends, kinds, (corner, row, 1), (0, 1))
    # Made with x and y exchanged, and so are the middles of its faces below.
    along_y = _table(cells.y.turned, ends, kinds, (corner, 1, row), (2, 3))
    x, y, h = (grid.x_low, grid.y), (grid.y_low, grid.x), grid.cell
    along_x = along_x._replace(faces=_middles(along_x, *x, h))
    turned = _middles(along_y, *y, h)
    return {-1: along_x, -2: along_y._replace(faces=turned[..., ::-1].copy())}, kinds


def _middles(table: LineTable, low: float, across: Floats, h: float) -> Floats:
    """The middles of the faces at both ends, (T, 2, 2): along the line, and across."""
    first = low + h * table.start
    # The upper face of the last cell, which may lie at the row's beginning.
    last = low + h * ((table.start + table.length - 1) % table.cells + 1)
    places = np.stack((first, last), axis=-1)
    return np.stack((places, np.broadcast_to(across[table.rows][:, None], places.shape)), axis=-1)


def _table(
    faces: Faces,
    ends: Ends,
    kinds: tuple[object, ...],
    layout: tuple[int, int, int],
    sides: tuple[int, int],
) -> LineTable:
    """Lines along the last axis; layout : first flat cell, from line to line, from cell to cell."""
    # A cell outside of the fluid has no closed face: NONE at both.
    boundary = [ends.of_faces(faces.lower, sides[LOW]), ends.of_faces(faces.upper, sides[HIGH])]
    closed = [found >= 0 for found in boundary]
    # The sides of a periodic row: open where the fluid goes on at the other one.
    joined = ends.wraps(boundary[LOW][:, 0]) & ends.wraps(boundary[HIGH][:, -1])
    closed[LOW][:, 0] &= ~joined
    closed[HIGH][:, -1] &= ~joined
    n = faces.lower.shape[1]
    found: list[tuple[int, ...]] = []
    # A cell of the fluid has an open face at least, or is closed off at both.
    inside = faces.is_open[:, 1:] | faces.is_open[:, :-1] | (boundary[LOW] >= 0)
    for row in np.flatnonzero(inside.any(axis=1)).tolist():
        starts, stops = np.flatnonzero(closed[LOW][row]), np.flatnonzero(closed[HIGH][row])
        # Nothing closes the row: the whole of it is a ring.
        if starts.size == 0:
            found.append((row, 0, n, 1, 0, 0))
            continue
        # The first end closes the line that goes on from the row's other side.
        if stops[0] < starts[0]:
            stops = np.roll(stops, -1)
        for start, stop in zip(starts, stops, strict=True):
            low, high = boundary[LOW][row, start], boundary[HIGH][row, stop]
            found.append((row, int(start), int(stop - start) % n + 1, 0, int(low), int(high)))
    rows, first, length, ring, lows, highs = np.array(found, np.int64).reshape(-1, 6).T
    number = np.array([_number(kinds, kind) for kind in ends.kinds], np.int64)
    by_end = np.stack((lows, highs), axis=-1)
    # A periodic side with no fluid at the other one is a wall.
    kind = np.where(ends.wraps(by_end), _number(kinds, Reflect()), number[by_end])
    kind[ring != 0] = _number(kinds, Periodic())
    # Lines stand one after the other, each with its ghosts.
    padded = length + 2 * GHOSTS
    corner, across, along = layout
    return LineTable(
        corner + rows * across, first, length, np.cumsum(padded) - padded, ring != 0, kind, by_end,
        np.zeros_like(by_end), np.zeros((rows.size, 2, 2)), n, along, across, int(padded.sum()),
    )  # fmt: skip

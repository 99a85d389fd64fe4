"""A bundle of columns that marches through rows: one step of transport across rows, in place.

    row j + 1   above    old values
    row j       here     old values
    ------------------   the face whose flux is known now, next to the one below from the step before
    row j - 1   below    updated: U += F_below - F_above

The bundle is narrow enough for its rows to stay in cache. What a step hands on to the next one is a row
in cache as well: the last faces, 1/rho of two rows, and what the flux keeps of the row `here`. Rows may
be any rows, of y or of the angle; where the angle's direction is periodic they form a ring.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, add, select, sub
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.loops import block_size, prefetch_block
from ellipsoid_coupling.compiled.rows import Rows, load, offset, rows_at, store
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    DENSITY,
    Flux,
    Stencil,
    kept_for,
    through_face,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS

Floats = NDArray[np.float64]

# What a march keeps, (4, K, whole vectors): a row that it may overwrite where it has none of its own;
# the last faces; what the flux keeps; 1/rho of the rows `below` and `here`.
_SPARE, _FACES, _KEPT, _INVERSES = range(4)


class March(NamedTuple):
    """A bundle of columns on its way through the rows: first flat cell, rows, columns, row to row."""

    first: int
    length: int
    width: int
    stride: int


class Ring(NamedTuple):
    """A periodic direction: its first interior cell in this march's columns, and the cells all around.

    around = 0 : no ring.
    """

    base: int
    around: int


class _Kept(NamedTuple):
    """What a march keeps from row to row, in rows as long as whole vectors.

    Attributes
    ----------
    faces, ups : K rows each
        The fluxes through the last face, and what a flux of cells keeps for the next one.
    inverse_below, inverse_here : (whole vectors,)
        1/rho of the row below and of the middle one.
    """

    faces: Rows
    ups: Rows
    inverse_below: Floats
    inverse_here: Floats


@inline_kernel
def inverse_density(density: float, vacuum: float) -> float:
    """1/rho, 0 in vacuum."""
    # Of a rim that is all but empty the velocity would be made of rounding.
    return 1.0 / density if density > vacuum else 0.0


@kernel(noalias=True)
def invert(cells: Rows, vacuum: float, inverse: Floats) -> None:
    """1/rho of as many cells as `inverse` has elements."""
    density = cells[:1]
    for i in range(inverse.size):
        inverse[i] = inverse_density(load(density, i)[DENSITY], vacuum)


@inline_kernel
def updated(flux: Flux, cell: Values, entering: Values, leaving: Values) -> Values:
    """U + F_below - F_above, the cell after the step; 0 where its density is that of a vacuum."""
    change = sub(entering, leaving)
    # Written so that NaN is no vacuum: the check of the fields has to find it.
    empty = cell[DENSITY] + change[DENSITY] <= flux.vacuum
    return select(empty, 0.0, add(cell, change))


@kernel(noalias=True)
def _across(
    flux: Flux,
    rows: tuple[Rows, Rows, Rows],
    cell: int,
    stride: int,
    width: int,
    ratio: float,
    kept: _Kept,
) -> None:
    """Step one row of `width` columns: the lowest of three `rows`, now that both its faces are known.

    cell : flat index of the middle one.
    """
    below, here, above = rows
    # Whole vectors: cells beyond `width` belong to another bundle and are computed, not stored.
    for i in range(kept.inverse_here.size):
        highest = load(above, i)
        inverse = (
            kept.inverse_below[i],
            kept.inverse_here[i],
            inverse_density(highest[DENSITY], flux.vacuum),
        )
        stencil = Stencil(load(below, i), load(here, i), highest, inverse, cell + i, stride)
        # The face between `below` and `here`; `above` holds the old values that a flux of cells
        # needs.
        leaving, up = through_face(flux, stencil, load(kept.ups, i), ratio)
        new = updated(flux, stencil.below, load(kept.faces, i), leaving)
        if i < width:
            store(below, i, new)
        store(kept.faces, i, leaving)
        store(kept.ups, i, up)
        # The row `here` is the row `below` of the next step.
        kept.inverse_below[i] = inverse[1]
        kept.inverse_here[i] = inverse[2]


@kernel(noalias=True)
def copy_row(rows: Rows, copies: Rows, width: int) -> None:
    """Copy `width` cells."""
    for i in range(width):
        store(copies, i, load(rows, i))


@inline_kernel
def march_workspace(components: tuple[int, ...], width: int) -> Floats:
    """What a march over `width` cells of each row keeps, (4, K, width), all zero."""
    return np.zeros((4, len(components), width))


@inline_kernel
def first_row(flux: Flux, components: tuple[int, ...], workspace: Floats) -> int:
    """The row that a march begins with.

    A flux of cells needs row -1 to know what flows into row 0; a flux of faces starts at row 0.
    """
    return -1 if len(kept_for(flux, rows_at(workspace[_KEPT], components, 0))) > 0 else 0


@kernel(noalias=True)
def begin_march(flux: Flux, below: Rows, here: Rows, workspace: Floats) -> None:
    """Prepare for the first step, whose lower two rows these are."""
    invert(below, flux.vacuum, workspace[_INVERSES, 0])
    invert(here, flux.vacuum, workspace[_INVERSES, 1])


@inline_kernel
def _stepped_row(below: Rows, components: tuple[int, ...], row: int, workspace: Floats) -> Rows:
    """The row that a step writes to: `below`, or a copy of it where it lies before the march."""
    if row < 1:
        # The row before the march belongs to another one, or is a ghost: it is read, not changed.
        spare = rows_at(workspace[_SPARE], components, 0)
        copy_row(below, spare, workspace.shape[2])
        below = spare
    return below


@inline_kernel
def _kept_in(flux: Flux, components: tuple[int, ...], workspace: Floats) -> _Kept:
    """What the march has kept of the rows before."""
    return _Kept(
        rows_at(workspace[_FACES], components, 0),
        kept_for(flux, rows_at(workspace[_KEPT], components, 0)),
        workspace[_INVERSES, 0],
        workspace[_INVERSES, 1],
    )


@inline_kernel
def _outflow(march: March, row: int, workspace: Floats) -> float:
    """The mass that has left through the end that has been passed, less what came in."""
    # Faces 0 and `length` are the march's ends; a face counts upwards.
    if row in (0, march.length):
        # Beyond the width there are faces of other bundles.
        through = float(workspace[_FACES, DENSITY, : march.width].sum())
        return through if row == march.length else -through
    return 0.0


@inline_kernel
def step_march(
    flux: Flux,
    components: tuple[int, ...],
    rows: tuple[Rows, Rows, Rows],
    cell: int,
    march: March,
    row: int,
    ratio: float,
    workspace: Floats,
) -> float:
    """Step the lowest of three `rows`, of which the middle one is row number `row` of the march.

    cell : flat index of the middle one.
    Returns the mass that has left through the end that has been passed, less what came in.
    """
    below = _stepped_row(rows[0], components, row, workspace)
    kept = _kept_in(flux, components, workspace)
    _across(flux, (below, rows[1], rows[2]), cell, march.stride, march.width, ratio, kept)
    return _outflow(march, row, workspace)


@inline_kernel
def _step_in_blocks(
    flux: Flux,
    components: tuple[int, ...],
    rows: tuple[Rows, Rows, Rows, Rows],
    cell: int,
    march: March,
    row: int,
    ratio: float,
    workspace: Floats,
) -> float:
    """`step_march` block by block; before each block, that of the fourth of `rows` is prefetched."""
    below, here, above = _stepped_row(rows[0], components, row, workspace), rows[1], rows[2]
    faces, ups, inverse_below, inverse_here = _kept_in(flux, components, workspace)
    size, block = workspace.shape[2], block_size(len(components))
    for first in range(0, size, block):
        prefetch_block(offset(rows[3], first), block)
        # The rows of the march itself are in cache; only the row that comes next has to be fetched.
        part = slice(first, min(first + block, size))
        three = offset(below, first), offset(here, first), offset(above, first)
        kept = _Kept(
            offset(faces, first), offset(ups, first), inverse_below[part], inverse_here[part]
        )
        _across(flux, three, cell + first, march.stride, march.width - first, ratio, kept)
    return _outflow(march, row, workspace)


@inline_kernel
def _on_ring(cell: int, ring: Ring) -> int:
    """The interior cell that a cell beyond either end of a ring is."""
    base, around = ring
    if around > 0:
        return cell + around if cell < base else cell - around if cell >= base + around else cell
    return cell


@inline_kernel
def _rows_of_step(
    fields: Floats, components: tuple[int, ...], march: March, ring: Ring, row: int, old: Floats
) -> tuple[Rows, Rows, Rows]:
    """The rows below, at and above row number `row` of a march, with their old values.

    old : copies of the first two rows of a march all around its ring.
    """
    cell = march.first + row * march.stride
    below = rows_at(fields, components, _on_ring(cell - march.stride, ring))
    here = rows_at(fields, components, _on_ring(cell, ring))
    above = rows_at(fields, components, _on_ring(cell + march.stride, ring))
    if _is_closed(march, ring):
        # Row `length` is row 0 again, which the march has changed since: its old values are asked for.
        if row == march.length:
            here, above = rows_at(old[0], components, 0), rows_at(old[1], components, 0)
        elif row == march.length - 1:
            above = rows_at(old[0], components, 0)
    return below, here, above


@inline_kernel
def _is_closed(march: March, ring: Ring) -> bool:
    """Whether a march goes all around its ring."""
    return ring.around == march.length * march.stride


@kernel(noalias=True)
def run_march(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    march: March,
    ring: Ring,
    ratio: float,
    workspaces: tuple[Floats, Floats],
) -> float:
    """Sweep a bundle of columns; returns the mass that has left through both ends, less what came in.

    workspaces : `march_workspace`, and copies of two rows, (2, K, whole vectors).
    """
    workspace, old = workspaces
    # A march around the full ring reads its first rows again after updating them: copies of their old
    # values stand in for them then.
    if _is_closed(march, ring):
        for row in range(GHOSTS):
            cells = rows_at(fields, components, march.first + row * march.stride)
            copy_row(cells, rows_at(old[row], components, 0), workspace.shape[2])
    begin, outflow = first_row(flux, components, workspace), 0.0
    for row in range(begin, march.length + 1):
        cell = march.first + row * march.stride
        middle = _on_ring(cell, ring)
        rows = _rows_of_step(fields, components, march, ring, row, old)
        if row == begin:
            begin_march(flux, rows[0], rows[1], workspace)
        # Hardware prefetch does not reach the next plane of the angle, so it is asked for. A flux of
        # cells computes for so long that this is no gain.
        if ring.around > 0 and begin == 0:
            coming = rows_at(fields, components, _on_ring(cell + 2 * march.stride, ring))
            four = rows[0], rows[1], rows[2], coming
            outflow += _step_in_blocks(flux, components, four, middle, march, row, ratio, workspace)
        else:
            outflow += step_march(flux, components, rows, middle, march, row, ratio, workspace)
    return outflow

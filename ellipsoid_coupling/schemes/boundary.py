"""What the ghost layers of a padded field hold: mirrored or continued values."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import parallel_kernel, threads_for
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]

# To fill so many ghost cells takes as long as to wake a thread.
_CELLS_PER_THREAD = 4000


def fill_ghosts(fields: Floats, axis: int, reflecting: bool, normal: int) -> None:
    """Fill the ghost layers at both ends of one direction, in place.

    Parameters
    ----------
    fields : (K, ..., n + 4, ...) float64, contiguous
        Conserved fields, component first; padded along `axis`.
    axis : int
        The axis to fill, counted on `fields`.
    reflecting : bool
        True: mirror the interior and turn the normal momentum round, so that no mass crosses; False
        (open): continue the outermost cell (Neumann) where it moves outwards, so that what reaches
        the edge leaves, and mirror where it moves inwards. A continued cell that moves inwards
        would be a source without end: nothing is known of what lies outside.
    normal : int
        The component that is the momentum along `axis`.
    """
    before, n, after = fields.shape[1:axis], fields.shape[axis], fields.shape[axis + 1 :]
    shape = fields.shape[0], math.prod(before), n, math.prod(after)
    with threads_for(shape[1] * shape[3], _CELLS_PER_THREAD):
        _fill(np.reshape(fields, shape, copy=False), reflecting, normal)


@parallel_kernel
def _fill(fields: Floats, reflecting: bool, normal: int) -> None:
    """`fill_ghosts` along the third axis of four."""
    n = fields.shape[2]
    for line in numba.prange(fields.shape[1]):
        # Layer by layer: the second mirrors the other end's first where there is one cell only.
        for layer in range(GHOSTS):
            for end in range(2):
                inwards = 1 - 2 * end
                edge = GHOSTS if end == 0 else n - GHOSTS - 1
                ghost, image = edge - inwards * (layer + 1), edge + inwards * layer
                for i in range(fields.shape[3]):
                    mirrored = reflecting or fields[normal, line, edge, i] * inwards > 0.0
                    source = image if mirrored else edge
                    for k in range(fields.shape[0]):
                        fields[k, line, ghost, i] = fields[k, line, source, i]
                    if mirrored:
                        fields[normal, line, ghost, i] *= -1.0


def fill_periodic(fields: Floats, axis: int, part: tuple[int, int] | None = None) -> None:
    """Fill the ghost layers at both ends of a periodic direction of contiguous fields, in place.

    part : (first, end), optional
        Of the numbers of a layer, which follow one another: the others stay as they are.
    """
    before, n, after = fields.shape[:axis], fields.shape[axis], fields.shape[axis + 1 :]
    shape = math.prod(before), n, math.prod(after)
    first, end = (0, shape[2]) if part is None else part
    with threads_for(shape[0] * (end - first), _CELLS_PER_THREAD):
        _wrap(np.reshape(fields, shape, copy=False), first, end)


@parallel_kernel
def _wrap(fields: Floats, first: int, end: int) -> None:
    """`fill_periodic` along the second axis of three."""
    last = fields.shape[1] - 2 * GHOSTS
    layers = 2 * GHOSTS
    for task in numba.prange(fields.shape[0] * layers):
        line, layer = task // layers, task % layers
        ghost = layer if layer < GHOSTS else last + layer
        image = ghost + last if layer < GHOSTS else ghost - last
        to, source = fields[line, ghost, first:end], fields[line, image, first:end]
        for i in range(to.size):
            to[i] = source[i]

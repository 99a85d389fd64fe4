"""Nodes along periodic axes: what lies beyond a period is what lies at its beginning.

Samples deposit into nodes that go on beyond the upper side, as many as a spline has:

    node      0  1  2  ...  n-1 | n  n+1  n+2  n+3         n nodes in a period
    is        0  1  2  ...  n-1 | 0   1    2    3

`fold` adds what came to the images, and `unfold` gives them what their originals have, so that neither
depositing nor interpolating knows of periods.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.interaction.convolution.spectra import Real
from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.interaction.particle_mesh.splines import STENCIL

Periods = tuple[bool, bool]


# As long as a period is sought in which a whole number of nodes fits along both axes.
_MOST_OF_WANTED = 4.0
_WHOLE = 1e-9


def fitting_spacing(width: float, height: float, h: float, periods: Periods) -> float | None:
    """The largest spacing up to `h` of which both periods are an even multiple; None if none is near.

    periods : whether y (the height) and x (the width) are periodic.
    """
    if not any(periods):
        return h
    first, other = (width, height) if periods[1] else (height, width)
    count = _even_count(first / h)
    while count * h <= _MOST_OF_WANTED * first:
        # Half of the nodes of the other period: whole where their number is even.
        half = 0.5 * count * other / first
        if not all(periods) or (round(half) > 0 and abs(half - round(half)) < _WHOLE * half):
            return first / count
        count = _even_count(count + 1.0)
    return None


def _even_count(least: float) -> int:
    """The smallest even number from `least` on whose transform is fast."""
    return 2 * fft.next_fast_len(max(1, int(np.ceil(0.5 * least - _WHOLE))), real=True)


class Folding:
    """How rows and columns of nodes are folded.

    Parameters
    ----------
    counts : (rows, columns)
        Of all nodes, images included.
    periods : (bool, bool)
        Whether y and x are periodic.
    """

    def __init__(self, counts: tuple[int, int], periods: Periods) -> None:
        self._counts, self.periods = counts, periods
        # Nodes that are no images, of the whole domain.
        self.own = self._choose((counts[0] - STENCIL, counts[1] - STENCIL), counts)

    def _choose(self, periodic: tuple[int, int], other: tuple[int, int]) -> tuple[int, int]:
        y, x = (
            p if wraps else o for p, o, wraps in zip(periodic, other, self.periods, strict=True)
        )
        return y, x

    def corner(self, corner: tuple[int, int]) -> tuple[int, int]:
        """The first row and column of what `unfold` gives, where samples have theirs at `corner`."""
        return self._choose((0, 0), corner)

    def extent(self, extent: tuple[int, int]) -> tuple[int, int]:
        """Rows and columns of what `unfold` gives, where those of all samples are `extent`."""
        return self._choose(self._counts, extent)

    def fold(self, sources: Array, corner: tuple[int, int], pool: BufferPool) -> Array:
        """Sources (functions, rows, columns), the first node at `corner`, on the nodes of a period.

        pool : holds the result until the next call
        """
        for axis in (0, 1):
            if self.periods[axis]:
                shape = list(sources.shape)
                shape[axis + 1] = self.own[axis]
                folded = pool.array(f"folded {axis}", tuple(shape), np.float64)
                _fold(sources, axis + 1, corner[axis], folded)
                sources = folded
        return sources

    def unfold(self, potential: Real) -> None:
        """Overwrite the images in a potential (rows, columns, functions), those of columns first."""
        # Then the images of rows get those of their columns as well.
        for axis in (1, 0):
            if self.periods[axis]:
                lines, count = potential.swapaxes(0, axis), self.own[axis]
                for image in range(count, count + STENCIL):
                    lines[image] = lines[image % count]


def _fold(sources: Array, axis: int, first: int, folded: Array) -> None:
    """Overwrite the nodes of a period with the sums of the nodes first, first + 1, ... along an axis."""
    folded[:] = 0.0
    lines, out = np.moveaxis(sources, axis, 0), np.moveaxis(folded, axis, 0)
    count = len(out)
    # At most once around, but for periods shorter than a spline.
    for begin in range(0, len(lines), count):
        some = lines[begin : begin + count]
        # What goes beyond the period's end goes on at its beginning.
        start = (first + begin) % count
        inside = min(len(some), count - start)
        out[start : start + inside] += some[:inside]
        out[: len(some) - inside] += some[inside:]

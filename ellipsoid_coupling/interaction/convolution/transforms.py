"""Real Fourier transforms along y and x whose large arrays are reused by the next call.

Each transform of scipy returns a new array, and new memory costs more than the transform itself: the
system hands it out zeroed, page by page. So the transform along y works in place in reused arrays. The
one along x takes a few rows at a time, whose arrays stay in cache and are reused by the allocator.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import fft

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.threads import chunk_ranges, for_each
from ellipsoid_coupling.compiled.tuning import TRANSFORM_NUMBERS
from ellipsoid_coupling.interaction.convolution.spectra import Complex, Lengths, Precision, Real


class Transforms:
    """Forward and back for one convolution; its arrays are overwritten by the next one.

    The same bits come out for any number of threads.

    Parameters
    ----------
    precision : np.float32 or np.float64
    """

    def __init__(self, precision: Precision) -> None:
        self._type = np.result_type(precision, np.complex64)
        self._pool = BufferPool()

    def forward(
        self, count: int, rows: int, padded: Lengths, make: Callable[[slice], Real]
    ) -> Complex:
        """The spectra of `count` fields, padded with zeros to (Py, Px): (count, Py, Px//2 + 1).

        make : (slice of the rows) -> (count, these rows, columns)
        """
        py, px = padded
        waves = self._pool.array("waves", (count, py, px // 2 + 1), self._type)

        def some(first: int, end: int) -> None:
            # scipy releases Python's lock, so that parts run side by side.
            waves[:, first:end] = fft.rfft(make(slice(first, end)), px, axis=2)

        in_parts(rows, rows * count * px, some)
        # Padding: the memory holds the last call's product.
        waves[:, rows:] = 0.0
        along_y(fft.fft, waves)
        return waves

    def product(self, waves: Complex, components: int) -> Complex:
        """An array for `components` products of each of `waves`: (components, *waves.shape)."""
        return self._pool.array("product", (components, *waves.shape), self._type)

    def back(
        self, product: Complex, rows: int, px: int, take: Callable[[slice, Real], None]
    ) -> None:
        """Transform the first rows of `product`, which is overwritten, and hand them over.

        take : (slice of the rows, (components, count, these rows, Px)) -> None
        """
        components, count = product.shape[:2]
        # Along y first, in place; along x only the rows that are asked for.
        along_y(fft.ifft, product.reshape(-1, *product.shape[2:]))

        def some(first: int, end: int) -> None:
            take(slice(first, end), fft.irfft(product[:, :, first:end], px, axis=3))

        in_parts(rows, rows * components * count * px, some)


def along_y(transform: Callable[..., Complex], fields: Complex) -> None:
    """Transform `fields` (n, Py, kx) along y, in place."""

    def some(first: int, end: int) -> None:
        here = fields[first:end]
        moved = transform(here, axis=1, overwrite_x=True)
        # scipy need not work in place, though it does.
        if not np.may_share_memory(moved, here):
            here[:] = moved

    in_parts(len(fields), fields.size, some)


def in_parts(count: int, numbers: int, task: Callable[[int, int], None]) -> None:
    """Run task(first, end) on ranges that cover `count` rows, which hold `numbers` numbers in all.

    Transforms and the products between them share one set of threads. With two libraries' threads, one
    set still spins on the core that the other one needs next: in every second process such a phase then
    took twice as long, as on one thread.
    """
    parts = chunk_ranges(count, numbers // TRANSFORM_NUMBERS + 1)
    for_each(len(parts), lambda k: task(*parts[k]))

"""Real Fourier transforms along y and x whose large arrays are kept from one call to the next.

Every transform of scipy returns a new array, and new memory costs more than the transform itself:
the system hands it out zeroed, page by page. So the direction along y is transformed in place in
kept arrays, and that along x a few rows at a time, whose arrays are small enough to stay in cache
and to be had again at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ellipsoid_coupling.interaction.ladder import Lengths
from ellipsoid_coupling.interaction.spectra import Complex, Precision, Real
from ellipsoid_coupling.kernels import for_each

# Numbers transformed along x at once: half a megabyte at most.
_NUMBERS_AT_ONCE = 60_000
# Work that is not cut that small goes in so many parts, whatever the number of threads.
_PARTS = 16


class Transforms:
    """Forward and back for one convolution; its arrays are overwritten by the next one.

    The same bits come out for any number of threads.

    Parameters
    ----------
    precision : np.float32 or np.float64
    """

    def __init__(self, precision: Precision) -> None:
        self._type = np.result_type(precision, np.complex64)
        self._memory: dict[str, NDArray[np.uint8]] = {}

    def forward(
        self, count: int, rows: int, padded: Lengths, make: Callable[[slice], Real]
    ) -> Complex:
        """The spectra of `count` fields, padded with zeros to (Py, Px): (count, Py, Px//2 + 1).

        make : (some of the rows) -> (count, so many rows, columns)
        """
        py, px = padded
        waves = self._kept("waves", (count, py, px // 2 + 1))

        def some(part: slice) -> None:
            waves[:, part] = fft.rfft(make(part), px, axis=2)

        in_parts(rows, _NUMBERS_AT_ONCE // (count * px), some)
        waves[:, rows:] = 0.0
        self._along_y(fft.fft, waves)
        return waves

    @staticmethod
    def multiply(frequencies: int, task: Callable[[int, int], None]) -> None:
        """Run task(first, end) on parts of the range of ky >= 0, which together are all of it."""
        in_parts(frequencies, frequencies // _PARTS + 1, lambda part: task(part.start, part.stop))

    def product(self, waves: Complex, components: int) -> Complex:
        """Where to write so many components of each of `waves`: (components, *waves.shape)."""
        return self._kept("product", (components, *waves.shape))

    def back(
        self, product: Complex, rows: int, px: int, take: Callable[[slice, Real], None]
    ) -> None:
        """Transform the first rows of `product`, which is overwritten, and hand them over.

        take : (some of the rows, (components, count, so many rows, Px)) -> None
        """
        self._along_y(fft.ifft, product)

        def some(part: slice) -> None:
            take(part, fft.irfft(product[:, :, part], px, axis=3))

        in_parts(rows, _NUMBERS_AT_ONCE // (product.shape[0] * product.shape[1] * px), some)

    @staticmethod
    def _along_y(transform: Callable[..., Complex], array: Complex) -> None:
        """Along the last axis but one, in place."""
        each = array.reshape(-1, *array.shape[-2:])

        def some(part: slice) -> None:
            here = each[part]
            moved = transform(here, axis=1, overwrite_x=True)
            # Where scipy cannot work in place, it says so by another array.
            if not np.shares_memory(moved, here):
                here[:] = moved

        in_parts(len(each), len(each) // _PARTS + 1, some)

    def _kept(self, name: str, shape: tuple[int, ...]) -> Complex:
        size = int(np.prod(shape)) * self._type.itemsize
        if name not in self._memory or self._memory[name].size < size:
            self._memory[name] = np.empty(size, np.uint8)
        return self._memory[name][:size].view(self._type).reshape(shape)


def in_parts(count: int, step: int, task: Callable[[slice], None]) -> None:
    """`task` for `step` of `count` rows (at least one) at a time, on all threads.

    Transforms and what is done between them share one set of threads. With a library's own for each
    kind of work, one set still waits awake on the core that the next one needs: in every other
    process such a phase took twice as long, as on one thread.
    """
    step = max(1, step)
    parts = [slice(first, min(first + step, count)) for first in range(0, count, step)]
    for_each(len(parts), lambda k: task(parts[k]))

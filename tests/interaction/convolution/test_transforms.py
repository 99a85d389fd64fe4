"""Transforms in kept arrays against numpy's, for every shape that follows another."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.convolution.transforms import Transforms, along_y

Numbers = NDArray[Any]
SHAPES = [(3, 40, 30), (5, 7, 11), (1, 1, 1), (9, 60, 50), (2, 600, 90)]


def there_and_back(
    transforms: Transforms, fields: Numbers, padded: tuple[int, int]
) -> tuple[Numbers, Numbers]:
    """The spectra, and twice the fields by way of two components, of which the second is added."""
    count, rows, columns = fields.shape
    waves = transforms.forward(count, rows, padded, lambda part: fields[:, part])
    product = transforms.product(waves, 2)
    product[:] = waves
    kept, found = waves.copy(), np.zeros(fields.shape)

    def take(part: slice, back: Numbers) -> None:
        found[:, part] += back[..., :columns].sum(axis=0)

    transforms.back(product, rows, padded[1], take)
    return kept, found


@pytest.mark.parametrize(("kind", "exact"), [(np.float32, 3e-6), (np.float64, 1e-14)])
def test_there_and_back(kind: type[np.float32 | np.float64], exact: float) -> None:
    """To rounding of the largest number; what an earlier, larger shape has left does not show."""
    transforms, rng = Transforms(kind), np.random.default_rng(0)
    for shape in [*SHAPES, *SHAPES[::-1]]:
        fields: Numbers = rng.standard_normal(shape).astype(kind)
        padded = 2 * (shape[1] // 2 + 3), 2 * (shape[2] // 2 + 2)
        waves, found = there_and_back(transforms, fields, padded)
        expected = np.fft.rfft2(fields, padded)
        np.testing.assert_allclose(waves, expected, atol=exact * float(np.abs(expected).max()))
        np.testing.assert_allclose(found, 2.0 * fields, atol=exact * float(np.abs(fields).max()))


def test_same_bits_on_any_number_of_threads() -> None:
    fields = np.random.default_rng(1).standard_normal((4, 200, 170)).astype(np.float32)
    before, results = numba.get_num_threads(), []
    for threads in (1, before):
        numba.set_num_threads(threads)
        results.append(there_and_back(Transforms(np.float32), fields, (240, 180)))
    numba.set_num_threads(before)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_transform_that_is_not_in_place_is_taken_over() -> None:
    """Scipy may work in place but need not."""
    fields = np.random.default_rng(2).standard_normal((5, 12, 7)).astype(np.complex128)
    expected = np.fft.fft(fields, axis=1)
    along_y(lambda array, axis, **_: np.fft.fft(array, axis=axis), fields)
    np.testing.assert_allclose(fields, expected, atol=1e-14 * float(np.abs(expected).max()))

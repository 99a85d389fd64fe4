"""Own exponential, cosine and sine: as exact as the library's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.physics.elementary import cos_sin, exp_of_negative

Floats = NDArray[np.float64]


@kernel
def exponentials(x: Floats) -> Floats:
    out = np.empty_like(x)
    for i in range(x.size):
        out[i] = exp_of_negative(x[i])
    return out


@kernel
def cosines_and_sines(x: Floats) -> tuple[Floats, Floats]:
    cosine, sine = np.empty_like(x), np.empty_like(x)
    for i in range(x.size):
        cosine[i], sine[i] = cos_sin(x[i])
    return cosine, sine


def test_exponential_to_rounding() -> None:
    """3e-14 relative over the whole range, 1e-15 where the potential is not tiny."""
    x = -np.concatenate([np.linspace(0, 5, 500), np.linspace(5, 690, 2000)])
    values = exponentials(x)
    assert np.max(np.abs(values / np.exp(x) - 1)) < 3e-14
    assert np.max(np.abs(values[:500] / np.exp(x[:500]) - 1)) < 1e-15


@pytest.mark.parametrize("largest", [1.0, 10.0, 1e5, 1e12])
def test_cosine_and_sine_to_rounding(largest: float) -> None:
    """2.2e-16 absolute, one unit in the last place of 1, for turned angles of any size."""
    rng = np.random.default_rng(0)
    quarters = 0.5 * np.pi * np.arange(-40, 41)
    x = np.concatenate([rng.uniform(-largest, largest, 100_000), quarters, quarters + 1e-9])
    cosine, sine = cosines_and_sines(x)
    assert np.max(np.abs(cosine - np.cos(x))) < 2.3e-16
    assert np.max(np.abs(sine - np.sin(x))) < 2.3e-16


def test_small_sines_keep_all_digits() -> None:
    x = np.array([0.0, 1e-300, 1e-160, -1e-9, 1e-3])
    assert np.allclose(cosines_and_sines(x)[1], np.sin(x), rtol=2e-16, atol=0.0)


@pytest.mark.parametrize("x", [math.inf, -math.inf, math.nan])
def test_no_angle_has_no_cosine(x: float) -> None:
    cosine, sine = cosines_and_sines(np.array([x]))
    assert math.isnan(cosine[0])
    assert math.isnan(sine[0])

"""Linear flows are exact, everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.analytic import LINEAR_FLOWS, analytic_flow


@pytest.mark.parametrize("name", LINEAR_FLOWS)
def test_linear_flow_is_exact(name: str) -> None:
    """Psi is quadratic, a cubic spline reproduces it: 1e-12 of the size, also far away."""
    flow = LINEAR_FLOWS[name]
    x, y = np.random.default_rng(0).uniform(-20.0, 20.0, (2, 500))
    sample = analytic_flow(name).evaluate(x, y)
    np.testing.assert_allclose(sample.velocity_x, flow.xx * x + flow.xy * y, atol=1e-12)
    np.testing.assert_allclose(sample.velocity_y, flow.yx * x - flow.xx * y, atol=1e-12)
    np.testing.assert_allclose(sample.dux_dx, flow.xx, atol=1e-12)
    np.testing.assert_allclose(sample.dux_dy, flow.xy, atol=1e-12)
    np.testing.assert_allclose(sample.duy_dx, flow.yx, atol=1e-12)
    assert sample.inside.all()


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1.0, 1e6, 1e9, 2.0**150])
@pytest.mark.parametrize("name", LINEAR_FLOWS)
def test_it_keeps_its_digits_in_any_unit(name: str, size: float) -> None:
    """All over the domain that it is for, 1e-14 of the largest velocity; of one far away likewise."""
    flow = LINEAR_FLOWS[name]
    for low, high in ((-1.0, 1.0), (0.9, 1.0)):
        side = low * size, high * size
        x, y = np.random.default_rng(0).uniform(*side, (2, 500))
        sample = analytic_flow(name, domain=(side, side)).evaluate(x, y)
        off = 1e-14 * size
        np.testing.assert_allclose(sample.velocity_x, flow.xx * x + flow.xy * y, atol=off)
        np.testing.assert_allclose(sample.velocity_y, flow.yx * x - flow.xx * y, atol=off)
        np.testing.assert_allclose(sample.dux_dy, flow.xy, atol=1e-12)
        np.testing.assert_allclose(sample.duy_dx, flow.yx, atol=1e-12)


def test_nan_is_outside_even_without_bounds() -> None:
    assert not analytic_flow("rotation").evaluate(np.nan, 0.0).inside.item()


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match="top_bottom, rotation, shear"):
        analytic_flow("vortex")

"""Which angular potentials tell heads from tails: asked of their formulas."""

from __future__ import annotations

import pytest

from ellipsoid_coupling.physics.angular import Axis, Sine, is_polar


@pytest.mark.parametrize(
    ("potential", "polar"), [(None, False), (Axis(2.0, 0.3), False), (Sine(2.0), True)]
)
def test_a_potential_with_period_pi_is_not_polar(
    potential: Axis | Sine | None, polar: bool
) -> None:
    assert is_polar(potential) == polar

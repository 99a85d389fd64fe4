"""Which way is chosen, and what is refused."""

from __future__ import annotations

from typing import cast

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction import (
    DirectInteraction,
    HarmonicInteraction,
    choose_interaction,
)
from ellipsoid_coupling.interaction.select import Method
from ellipsoid_coupling.physics.potential import potential_shape

ELLIPSE = potential_shape(0.05, 0.025)


def test_harmonics_where_they_pay_else_the_direct_sum() -> None:
    assert isinstance(choose_interaction((100, 100), 0.01, ELLIPSE, 1.0, 5e-2), HarmonicInteraction)
    assert isinstance(choose_interaction((100, 100), 0.01, ELLIPSE, 1.0, 1e-9), DirectInteraction)
    needle = potential_shape(0.05, 0.005)
    assert isinstance(choose_interaction((100, 100), 0.01, needle, 1.0, 1e-3), DirectInteraction)


@pytest.mark.parametrize(
    ("method", "kind"), [("direct", DirectInteraction), ("harmonics", HarmonicInteraction)]
)
def test_a_named_method_is_taken(method: Method, kind: type) -> None:
    assert isinstance(choose_interaction((12, 12), 0.05, ELLIPSE, 1.0, 1e-2, method), kind)


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(InputError, match="tolerance: expected a positive number"):
        choose_interaction((10, 10), 0.05, ELLIPSE, 1.0, 0.0)
    with pytest.raises(InputError, match="method: expected auto, direct or harmonics"):
        choose_interaction((10, 10), 0.05, ELLIPSE, 1.0, 1e-2, cast("Method", "fast"))
    with pytest.raises(InputError, match="at least one cell"):
        choose_interaction((0, 10), 0.05, ELLIPSE, 1.0, 1e-2)

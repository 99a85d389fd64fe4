"""Scales of a flow against a closed form, and the largest rectangle against all rectangles."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.scales import flow_scales, largest_rectangle, roomiest_box

BOX = ((0.0, 2.0), (0.0, 1.0))


def field(inside: np.ndarray | None = None) -> FlowField:
    """The flow u = y^2, psi = y^3/3: exact for the cubic spline but at its ends."""
    x, y = np.linspace(0.0, 2.0, 41), np.linspace(0.0, 1.0, 21)
    psi = np.tile((y**3 / 3.0)[:, None], (1, x.size))
    return FlowField.from_stream_function(psi, x, y, "", inside=inside)


def test_scales_are_those_of_the_flow() -> None:
    """Largest speed 1, rms 1/5^(1/2), largest shear 2, up to half a point of 200."""
    scales = flow_scales(field(), BOX)
    assert scales.largest == pytest.approx(1.0, abs=0.01)
    assert scales.typical == pytest.approx(np.sqrt(0.2), abs=2e-3)
    assert scales.shear == pytest.approx(2.0, abs=0.02)
    nothing = flow_scales(field(np.zeros((20, 40), bool)), BOX)
    assert nothing == (0.0, 0.0, 0.0, 0.0)


def test_the_roomiest_box_leaves_a_solid_out() -> None:
    """A block over x < 1, y < 1/2: the right half is larger than the upper one."""
    inside = np.ones((20, 40), bool)
    inside[:10, :20] = False
    assert roomiest_box(field(inside), BOX) == ((1.0, 2.0), (0.0, 1.0))
    assert roomiest_box(field(np.zeros((20, 40), bool)), BOX) is None


@given(st.lists(st.lists(st.booleans(), min_size=5, max_size=5), min_size=1, max_size=5))
def test_no_rectangle_is_larger(rows: list[list[bool]]) -> None:
    inside = np.array(rows)
    best = 0
    for low, high in combinations(range(len(rows) + 1), 2):
        for left, right in combinations(range(6), 2):
            if inside[low:high, left:right].all():
                best = max(best, (high - low) * (right - left))
    found = largest_rectangle(inside)
    if found is None:
        assert best == 0
    else:
        (left, right), (low, high) = found
        assert inside[low:high, left:right].all()
        assert (high - low) * (right - left) == best

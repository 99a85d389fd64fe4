"""Colours of axes: the same after half a turn, evenly apart, and visible."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.output.colours import axis_colours

ANGLES = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 361)


def test_both_ends_are_one_axis() -> None:
    """To rounding."""
    np.testing.assert_allclose(axis_colours(ANGLES), axis_colours(ANGLES + np.pi), atol=1e-12)


def test_colours_can_be_shown_and_are_seen_on_white_and_black() -> None:
    """Between 0 and 1, and of a luminance between 0.15 and 0.6 (white is 1)."""
    colours = axis_colours(ANGLES)
    assert colours.min() >= 0.0
    assert colours.max() <= 1.0
    luminance = colours**2.2 @ [0.2126, 0.7152, 0.0722]
    assert luminance.min() > 0.15
    assert luminance.max() < 0.6


def test_equal_turns_look_alike() -> None:
    """No step in sRGB is more than five times the mean one, as no map of hues alone is."""
    steps = np.linalg.norm(np.diff(axis_colours(ANGLES), axis=0), axis=1)
    assert steps.max() < 5.0 * steps.mean()
    assert steps.min() > 0.1 * steps.mean()


def test_axes_across_each_other_differ_most() -> None:
    """At a right angle: 0.4 apart in sRGB at least (black and white are 1.7), all the way round."""
    apart = np.linalg.norm(axis_colours(ANGLES) - axis_colours(ANGLES + 0.5 * np.pi), axis=1)
    assert apart.min() > 0.4

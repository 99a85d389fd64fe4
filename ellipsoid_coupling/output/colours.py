"""One colour for each axis, the same for theta and theta + pi, for figures and for ParaView."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# In Oklab's lightness and chroma; all of these colours can be shown on a screen.
_LIGHTNESS, _CHROMA = 0.66, 0.125
# The hue of an axis along x; blue, so that one along y is orange, which nobody takes for it.
_ALONG_X = np.deg2rad(260.0)
# Axes at +45 and -45 degrees are green and red: the lightness tells them apart as well.
_SWING = 0.08

# Oklab to the cube roots of cone responses, and those to linear sRGB (B. Ottosson, 2020).
_TO_CONES = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_TO_LINEAR = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def axis_colours(angle: Floats) -> Floats:
    """Colours (..., 3) in sRGB, between 0 and 1, of axes at these angles in radian; the period is pi.

    The hue goes once around evenly: equal differences of angles look alike.
    """
    hue = _ALONG_X - 2.0 * angle
    lightness = _LIGHTNESS + _SWING * np.sin(2.0 * angle)
    colour = np.stack([lightness, _CHROMA * np.cos(hue), _CHROMA * np.sin(hue)], axis=-1)
    linear = np.clip((colour @ _TO_CONES.T) ** 3 @ _TO_LINEAR.T, 0.0, 1.0)
    bright = 1.055 * linear ** (1.0 / 2.4) - 0.055
    return np.asarray(np.where(linear <= 0.0031308, 12.92 * linear, bright))

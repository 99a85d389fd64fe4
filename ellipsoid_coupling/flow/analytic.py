"""Flows given by a formula: u = G r with constant, trace-free G, so psi is a quadratic form.

    psi = G_xx x y + G_xy y^2 / 2 - G_yx x^2 / 2

One spline cell reproduces a quadratic to rounding, and its polynomial holds everywhere.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.field import FlowArrays, FlowField


class LinearFlow(NamedTuple):
    """u = (xx x + xy y, yx x - xx y), in 1/time, and how a reader of a log knows it."""

    xx: float
    xy: float
    yx: float
    formula: str


LINEAR_FLOWS = {
    "top_bottom": LinearFlow(-1.0, 0.0, 0.0, "u = (-x, y)"),
    "rotation": LinearFlow(0.0, 1.0, -1.0, "u = (y, -x)"),
    "shear": LinearFlow(0.0, 1.0, 0.0, "u = (y, 0)"),
}

# The one cell is [-HALF, HALF]^2: near the size of the scenes, so that rounding stays rounding.
HALF = 8.0


def linear_flow(gradient: LinearFlow) -> FlowField:
    """The flow u = G r, defined everywhere, exact to rounding near the scenes' size."""
    h = 2.0 * HALF
    # A quadratic's B-spline coefficient is its value at the node, less h^2/6 times its Laplacian.
    nodes = HALF * np.array([-3.0, -1.0, 1.0, 3.0])
    y, x = np.meshgrid(nodes, nodes, indexing="ij")
    xx, xy, yx, formula = gradient
    psi = xx * x * y + 0.5 * xy * y**2 - 0.5 * yx * x**2
    coefficients = psi - h**2 / 6.0 * (xy - yx)
    everywhere = (-math.inf, math.inf, -math.inf, math.inf)
    mask = np.ones((1, 1), np.uint8)
    arrays = FlowArrays(coefficients, -HALF, -HALF, 1.0 / h, 1.0 / h, *everywhere, mask)
    return FlowField(arrays, f"formula {formula}")


def analytic_flow(name: str) -> FlowField:
    """The flow of that name in `LINEAR_FLOWS`; InputError, listing the known ones, otherwise."""
    if name not in LINEAR_FLOWS:
        raise InputError(
            "analytic flow", "one of " + ", ".join(LINEAR_FLOWS), repr(name),
            "Correct the name, or give an OpenFOAM case.",
        )  # fmt: skip
    return linear_flow(LINEAR_FLOWS[name])

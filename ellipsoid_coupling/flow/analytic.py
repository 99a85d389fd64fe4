"""Flows given by a formula: linear ones, and any stream function that is registered.

A linear flow is u = G r with constant, trace-free G, so psi is a quadratic form.

    psi = G_xx x y + G_xy y^2 / 2 - G_yx x^2 / 2

One spline cell reproduces a quadratic to rounding, and its polynomial holds everywhere. Other stream
functions are sampled on the scene's domain (`register_flow`).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.field import FlowArrays, FlowField
from ellipsoid_coupling.scenes.scene import Domain, Flow

# (x, y, **parameters) -> psi
StreamFunction = Callable[..., NDArray[np.float64]]
Rectangle = tuple[tuple[float, float], tuple[float, float]]


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

_STREAM_FUNCTIONS: dict[str, StreamFunction] = {}

# The one cell is [-HALF, HALF]^2 for places up to that and down to an eighth of 1, which the scenes' are;
# for others it is as large as their largest coordinate. Far beyond it, and far within, digits cancel.
HALF = 8.0


def reach_of(domain: Rectangle) -> float:
    """The largest coordinate of a rectangle."""
    return max(abs(end) for ends in domain for end in ends)


def linear_flow(gradient: LinearFlow, reach: float = 1.0) -> FlowField:
    """The flow u = G r, defined everywhere, exact to rounding at the places it is for.

    reach : float
        The largest coordinate of these places.
    """
    within = 1.0 / HALF <= reach <= HALF
    half = HALF if within else 2.0 ** math.ceil(math.log2(reach))
    h = 2.0 * half
    # A quadratic's B-spline coefficient is its value at the node, less h^2/6 times its Laplacian.
    nodes = half * np.array([-3.0, -1.0, 1.0, 3.0])
    y, x = np.meshgrid(nodes, nodes, indexing="ij")
    xx, xy, yx, formula = gradient
    psi = xx * x * y + 0.5 * xy * y**2 - 0.5 * yx * x**2
    coefficients = psi - h**2 / 6.0 * (xy - yx)
    everywhere = (-math.inf, math.inf, -math.inf, math.inf)
    mask = np.ones((1, 1), np.uint8)
    arrays = FlowArrays(coefficients, -half, -half, 1.0 / h, 1.0 / h, *everywhere, mask)
    return FlowField(arrays, f"formula {formula}")


def register_flow(name: str, psi: StreamFunction) -> None:
    """Add a flow by its stream function, for ``[flow] source = "closed_form"`` and its `field`.

    Parameters
    ----------
    name : str
        What scene files call it.
    psi : callable
        ``(x, y, **parameters)`` -> psi, with u = (d psi/dy, -d psi/dx): numpy arrays (ny+1, nx+1) of
        places, and psi there. Its further arguments are the keys of `[flow.parameters]`; those with a
        default may be left out.

    Raises
    ------
    ValueError
        For a name that is taken.
    """
    if name in _known_flows():
        raise ValueError(f"a flow {name} is registered already")
    _STREAM_FUNCTIONS[name] = psi


def _known_flows() -> list[str]:
    return [*LINEAR_FLOWS, *_STREAM_FUNCTIONS]


def analytic_flow(
    name: str,
    parameters: Mapping[str, float] | None = None,
    domain: Rectangle | None = None,
    cells: int = 100,
) -> FlowField:
    """The flow of that name: a linear one, everywhere, or a registered one, on a rectangle.

    Parameters
    ----------
    name : str
        One of `LINEAR_FLOWS`, or registered with `register_flow`.
    parameters : mapping, optional
        Numbers by name.
    domain : ((x_low, x_high), (y_low, y_high))
        Where a flow that is not linear is sampled, and a linear one keeps its digits.
    cells : int
        Of the spline a side, 4 at least: psi is exact to the fourth order of their size, u and its
        gradient to the third and second.

    Raises
    ------
    InputError
        For an unknown name or parameter, one that is missing, or a value that is not finite.
    """
    given = dict(parameters or {})
    if name in LINEAR_FLOWS:
        _check_parameters(name, given, {})
        return linear_flow(LINEAR_FLOWS[name], 1.0 if domain is None else reach_of(domain))
    if name not in _STREAM_FUNCTIONS:
        raise InputError(
            "analytic flow", "one of " + ", ".join(_known_flows()), repr(name),
            "Correct the name, register it, or give an OpenFOAM case.",
        )  # fmt: skip
    if domain is None:
        raise InputError(f"flow {name}", "a domain to sample it on", "none", "Give one.")
    psi = _STREAM_FUNCTIONS[name]
    _check_parameters(name, given, _wanted_parameters(psi))
    x, y = (np.linspace(low, high, cells + 1) for low, high in domain)
    values = np.asarray(psi(*np.meshgrid(x, y), **given), np.float64)
    if values.shape != (y.size, x.size) or not np.isfinite(values).all():
        found = (
            f"shape {values.shape}" if np.isfinite(values).all() else "values that are not finite"
        )
        expected = f"finite values of shape {(y.size, x.size)} from its stream function"
        raise InputError(f"flow {name}", expected, found, "Correct its formula or its parameters.")
    numbers = "".join(f", {key} = {value:g}" for key, value in sorted(given.items()))
    return FlowField.from_stream_function(values, x, y, f"formula {name}{numbers}")


def closed_form_flow(part: Flow, domain: Domain) -> FlowField:
    """`analytic_flow` of a scene's [flow], on its domain."""
    return analytic_flow(part.name, part.parameters, (domain.x, domain.y), part.cells)


def _wanted_parameters(psi: StreamFunction) -> dict[str, bool]:
    """The parameters of a stream function, and whether each must be given."""
    _x, _y, *others = inspect.signature(psi).parameters.values()
    return {one.name: one.default is one.empty for one in others}


def _check_parameters(name: str, given: dict[str, float], wanted: dict[str, bool]) -> None:
    unknown = sorted(set(given) - set(wanted))
    missing = [key for key, needed in wanted.items() if needed and key not in given]
    if unknown or missing:
        raise InputError(
            f"flow {name}, key flow.parameters",
            ", ".join(wanted) or "none",
            f"{', '.join(unknown)}, unknown" if unknown else f"no {', '.join(missing)}",
            "Remove or rename it." if unknown else "Add it.",
        )

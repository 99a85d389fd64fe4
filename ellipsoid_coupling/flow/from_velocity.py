"""A flow from velocities on a grid or by a formula: the stream function that fits them best.

Along the edges between neighbouring nodes psi jumps by

    psi(x, y + dy) - psi(x, y) = int u_x dy,      psi(x + dx, y) - psi(x, y) = -int u_y dx,

integrals of the cubic spline through the nodes, exact to the fourth order. psi is what misses them least,

    sum over edges of (psi_b - psi_a - jump)^2 / length^2  ->  min,

a Poisson equation on the nodes, which the cosine transform solves. A velocity without divergence is met to
the order of the spline; of any other the part without divergence is left, and the rest is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import SupportsIndex, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dctn, idctn
from scipy.interpolate import CubicSpline

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.mesh_flow import NO_FLUX
from ellipsoid_coupling.flow.misfit import LARGEST_MISFIT
from ellipsoid_coupling.flow.openfoam.plane import SINGLE
from ellipsoid_coupling.flow.rectangle import constant_on
from ellipsoid_coupling.flow.spline import WallVelocity
from ellipsoid_coupling.flow.user_methods import Formula, Rectangle

Array = NDArray[np.float64]

LEAST_CELLS = 4


def flow_of_formula(
    formula: Formula, domain: Rectangle, cells: SupportsIndex, origin: str
) -> FlowField:
    """See `FlowField.from_function`."""
    where = f"flow from {origin}"
    whole = isinstance(cells, int | np.integer) and not isinstance(cells, bool)
    if not whole or int(cells) < LEAST_CELLS:
        expected = f"a whole number of {LEAST_CELLS} or more"
        raise InputError(f"{where}, cells", expected, repr(cells), "Give more cells.")
    x, y = (_nodes(where, name, side, int(cells)) for name, side in zip("xy", domain, strict=True))
    parts = _values(where, formula, *np.meshgrid(x, y))
    if len(parts) > 2:
        raise InputError(where, "two components", f"{len(parts)}", "Return (u_x, u_y), or psi.")
    if len(parts) == 2:
        return flow_of_velocity(parts[0], parts[1], x, y, origin)
    _require_finite(where, {"psi": parts[0]})
    return FlowField.from_stream_function(parts[0], x, y, origin)


def _values(where: str, formula: Formula, x: Array, y: Array) -> list[Array]:
    """The components that the formula gives, or psi alone, each of the shape of x."""
    try:
        values = formula(x, y)
        several = isinstance(values, tuple | list) or np.ndim(values) == 3
        parts = list(cast("Sequence[ArrayLike]", values)) if several else [values]
        return [np.broadcast_to(np.asarray(part, np.float64), x.shape) for part in parts]
    except (TypeError, ValueError) as error:
        raise InputError(
            where, f"(u_x, u_y) or psi for arrays x, y of shape {x.shape}", str(error),
            "Use numpy's functions (np.sin, np.where), or wrap it by np.vectorize.",
        ) from error  # fmt: skip


def _nodes(where: str, name: str, side: tuple[float, float], cells: int) -> Array:
    low, high = side
    if not (np.isfinite([low, high]).all() and low < high):
        found = f"{name} = {list(side)}"
        raise InputError(f"{where}, domain", "[low, high] with low < high", found, "Change it.")
    return np.linspace(low, high, cells + 1)


def flow_of_velocity(u: Array, v: Array, x: Array, y: Array, origin: str) -> FlowField:
    """See `FlowField.from_velocity`."""
    where = f"flow from {origin}"
    _check_nodes(where, x, y)
    shape = y.size, x.size
    if not u.shape == v.shape == shape:
        raise InputError(
            where, f"u and v of shape {shape}, axis order (y, x)", f"{u.shape} and {v.shape}",
            "Transpose them, or give the nodes that belong to them.",
        )  # fmt: skip
    _require_finite(where, {"u": u, "v": v})
    through = (v[0, :], u[:, -1], v[-1, ::-1], u[::-1, 0])
    top = NO_FLUX * float(np.hypot(u, v).max())
    closed = [bool(np.abs(normal).max() <= top) for normal in through]
    psi = constant_on(closed, _best_psi(u, v, x, y))
    walls = WallVelocity(left=v[:, 0], right=v[:, -1], bottom=u[0], top=u[-1])
    field = FlowField.from_stream_function(psi, x, y, origin, walls)
    misfit = _misfit(field, u, v, x, y)
    if misfit > LARGEST_MISFIT:
        raise InputError(
            where, f"a velocity without divergence, to {LARGEST_MISFIT:.0%} (rms)",
            f"one that is {misfit:.2g} of itself off the nearest such flow",
            "Correct it, or give it on more nodes where it varies fast.",
        )  # fmt: skip
    told = f"{origin}, {100.0 * misfit:.2g} % off the velocity (rms)"
    return FlowField(field.arrays, told, field.outline)


def _check_nodes(where: str, x: Array, y: Array) -> None:
    for name, nodes in (("x", x), ("y", y)):
        if nodes.ndim != 1 or nodes.size <= LEAST_CELLS or not np.isfinite(nodes).all():
            expected = f"at least {LEAST_CELLS + 1} nodes, finite, in one row"
            raise InputError(f"{where}, {name}", expected, f"shape {nodes.shape}", "Give more.")
        even = np.linspace(nodes[0], nodes[-1], nodes.size)
        if not nodes[0] < nodes[-1] or np.abs(even - nodes).max() > SINGLE * np.ptp(nodes):
            raise InputError(
                f"{where}, {name}", "rising, evenly spaced nodes", "others",
                "Interpolate to such nodes, or give a function (FlowField.from_function).",
            )  # fmt: skip


def _require_finite(where: str, arrays: dict[str, Array]) -> None:
    for name, values in arrays.items():
        wrong = np.argwhere(~np.isfinite(values))
        if wrong.size:
            found = f"NaN or infinity at {name}{wrong[0].tolist()}"
            raise InputError(where, "finite numbers", found, "Give a domain where they are.")


def _best_psi(u: Array, v: Array, x: Array, y: Array) -> Array:
    """(ny+1, nx+1), up to a constant; see the module."""
    ny, nx = y.size, x.size
    dx, dy = (x[-1] - x[0]) / (nx - 1), (y[-1] - y[0]) / (ny - 1)
    up = np.diff(CubicSpline(y, u, axis=0).antiderivative()(y), axis=0)
    along = -np.diff(CubicSpline(x, v, axis=1).antiderivative()(x), axis=1)
    # Every edge pulls its two ends; what pulls at a node is the right side.
    pull = -np.diff(up, axis=0, prepend=0.0, append=0.0) / dy**2
    pull -= np.diff(along, axis=1, prepend=0.0, append=0.0) / dx**2
    of_y, of_x = ((2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n)) for n in (ny, nx))
    factor = of_y[:, None] / dy**2 + of_x / dx**2
    factor[0, 0] = 1.0  # psi's mean, which is free
    return np.asarray(idctn(dctn(pull) / factor))


def _misfit(field: FlowField, u: Array, v: Array, x: Array, y: Array) -> float:
    """How far the field is off (u, v) at the nodes, rms over rms."""
    sample = field.evaluate(*np.meshgrid(x, y))
    off = np.mean((sample.velocity_x - u) ** 2 + (sample.velocity_y - v) ** 2)
    size = np.mean(u**2 + v**2)
    return float(np.sqrt(off / size)) if size > 0.0 else 0.0

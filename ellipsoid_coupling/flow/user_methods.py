"""What a user calls on a flow: made from formulas and arrays, drawn, and shown in one line or a table."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, SupportsIndex, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ellipsoid_coupling.scenes.summary import Summarised, Summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ellipsoid_coupling.flow.field import FlowField

Array = NDArray[np.float64]
# (x, y) -> (u_x, u_y), or psi; numpy arrays of one shape, or numbers where it is constant.
Formula = Callable[[Array, Array], ArrayLike | tuple[ArrayLike, ArrayLike]]
Rectangle = tuple[tuple[float, float], tuple[float, float]]


class FlowMethods(Summarised):
    """Methods of `FlowField` that do not know how it is stored."""

    @staticmethod
    def from_function(
        u: Formula, domain: Rectangle, cells: SupportsIndex = 100, origin: str = "a formula"
    ) -> FlowField:
        """The flow of a formula, sampled on a rectangle.

        ec.FlowField.from_function(lambda x, y: (y, -x), domain=((-1, 1), (-1, 1)))

        Parameters
        ----------
        u : callable
            ``u(x, y)`` -> (u_x, u_y), or psi with u = (d psi/dy, -d psi/dx); x and y are arrays
            (ny+1, nx+1), and so are the values, or numbers.
        domain : ((x_low, x_high), (y_low, y_high))
        cells : int
            Of the spline along each side, 4 at least: u is exact to the third order of their size.
        origin : str
            Where the flow came from, one line.

        Raises
        ------
        InputError
            For values that are not finite or of another shape, or a velocity that is more than 5 % (rms)
            off every flow without divergence.
        """
        from ellipsoid_coupling.flow.from_velocity import flow_of_formula

        return flow_of_formula(u, domain, cells, origin)

    @staticmethod
    def from_velocity(
        u: ArrayLike, v: ArrayLike, x: ArrayLike, y: ArrayLike, origin: str = "velocities on a grid"
    ) -> FlowField:
        """The flow that is nearest to velocities on a grid; `origin` says how near, in per cent.

        Parameters
        ----------
        u, v : (ny+1, nx+1) float64, axis order (y, x)
            u_x and u_y at the nodes.
        x, y : (nx+1,), (ny+1,) float64
            The nodes, rising and evenly spaced, 5 each way at least; the flow ends at the outer ones.
        origin : str
            Where they came from, one line.

        Raises
        ------
        InputError
            As `from_function`, and for nodes that are not evenly spaced.
        """
        from ellipsoid_coupling.flow.from_velocity import flow_of_velocity

        velocity = np.asarray(u, np.float64), np.asarray(v, np.float64)
        return flow_of_velocity(
            *velocity, np.asarray(x, np.float64), np.asarray(y, np.float64), origin
        )

    def plot(
        self, domain: Rectangle | None = None, *, time: float = 0.0, path: str | Path | None = None
    ) -> Figure:
        """Arrows of the velocity, in colours of the speed.

        Parameters
        ----------
        domain : ((x_low, x_high), (y_low, y_high)), optional
            What is shown; the flow's rectangle without it, [-1, 1] x [-1, 1] of a flow without end.
        time : float
            Of a flow that changes.
        path : path, optional
            A PNG that is written too.
        """
        # By name: figures stand above flows, and matplotlib is loaded when it is needed.
        draw = import_module("ellipsoid_coupling.output.figures.at_a_glance").flow_at_a_glance
        return cast("Figure", draw(self, domain, time, path))

    def _summary(self) -> Summary:
        flow = cast("FlowField", self)
        ny, nx = flow.cells
        x_low, x_high, y_low, y_high = flow.bounds
        everywhere = bool(np.isinf(x_low))
        rows = [
            ("", flow.origin),
            ("in", "the whole plane" if everywhere else f"{[x_low, x_high]} x {[y_low, y_high]}"),
            ("on", f"{nx} x {ny} cells"),
        ]
        if flow.outline is not None:
            rows.append(("patches", ", ".join(flow.outline.names)))
        return Summary(type(self).__name__, rows)

"""The fluid velocity as a bicubic stream function: divergence-free, C1, tight at walls.

    u = (d psi/dy, -d psi/dx),   psi(x, y) = sum_ij c_ij B((y - y_i)/dy) B((x - x_j)/dx)

with the cubic B-spline B, so velocity and gradient come from the same 16 coefficients. A flow with sources
has a potential chi besides, on the same nodes, and u = rot psi + grad chi; see `slopes`.

        j=0  1   2  ...  nx+2        coefficients, (ny+3, nx+3), axis order (y, x)
         o   o   o   o   o
         o   +---+---+   o           + nodes, (ny+1, nx+1); coefficient [i+1, j+1] is on [i, j]
         o   |   |   |   o
         o   +---+---+   o           cell [i, j] uses the coefficients [i:i+4, j:j+4]
         o   o   o   o   o
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.rows import element
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow.case_plane import FLAT, CasePlane
from ellipsoid_coupling.flow.misfit import Misfit
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.saved import outline_arrays, read_saved
from ellipsoid_coupling.flow.slopes import Chi, slopes, velocity_of
from ellipsoid_coupling.flow.spline import WallVelocity, stream_coefficients
from ellipsoid_coupling.flow.stream_values import divergence_values
from ellipsoid_coupling.flow.user_methods import FlowMethods

if TYPE_CHECKING:
    from ellipsoid_coupling.flow.interval import Interval

Array = NDArray[np.float64]

# A particle that a wall reflects may end on the wall's other side by rounding: still inside.
RIM = 1e-9
# Each way, where the largest speed is looked for.
_POINTS = 401


class FlowArrays(NamedTuple):
    """What compiled kernels get of a `FlowField`.

    coefficients : float64 (ny+3, nx+3), axis order (y, x), of psi; with chi twice as many rows
    x0, y0 : the lower left node; inverse_dx, inverse_dy : cells per unit length
    x_low ... y_high : where the field is defined, rim included; infinite for analytic flows
    mask : uint8 (ny, nx), 1 where the cell lies in the flow
    chi : where the coefficients of chi begin; None for a flow without sources
    """

    coefficients: Array
    x0: float
    y0: float
    inverse_dx: float
    inverse_dy: float
    x_low: float
    x_high: float
    y_low: float
    y_high: float
    mask: NDArray[np.uint8]
    chi: Chi | None = None


class FlowSample(NamedTuple):
    """Velocity and gradient at points, arrays of one shape; without sources duy_dy is -dux_dx."""

    velocity_x: Array
    velocity_y: Array
    dux_dx: Array
    dux_dy: Array
    duy_dx: Array
    inside: NDArray[np.bool_]
    duy_dy: Array

    @property
    def stretch(self) -> Array:
        """(dux_dx - duy_dy)/2, all that Jeffery's term takes of both."""
        return np.asarray(0.5 * (self.dux_dx - self.duy_dy))


@inline_kernel
def _cell(position: float, cells: int) -> int:
    """The cell of a position in units of cells, the nearest one from outside, 0 for NaN."""
    # Comparisons, not min and max: they keep NaN from becoming an index.
    low = max(0.0, position)
    inside = low if low < cells else cells - 1.0
    return int(inside)


@inline_kernel
def in_mesh(flow: FlowArrays, x: float, y: float) -> bool:
    """`inside` of `sample_flow` alone: whether a point lies in the rectangle and in a cell of the flow."""
    ny, nx = flow.mask.shape
    column, row = (x - flow.x0) * flow.inverse_dx, (y - flow.y0) * flow.inverse_dy
    within = (flow.x_low <= x) & (x <= flow.x_high) & (flow.y_low <= y) & (y <= flow.y_high)
    inside: bool = within & (flow.mask[_cell(row, ny), _cell(column, nx)] != 0)
    return inside


@inline_kernel
def nearest(
    rim: tuple[float, float, float, float] | None, x: float, y: float
) -> tuple[float, float]:
    """The nearest point of a rectangle (x_low, x_high, y_low, y_high); the point itself without one.

    The velocity there stays that of the rim, where a cell's continued cubic would grow for ever.
    """
    if rim is None:
        return x, y
    # In this order NaN stays NaN.
    return min(max(x, rim[0]), rim[1]), min(max(y, rim[2]), rim[3])


@inline_kernel
def sample_flow(
    flow: FlowArrays, x: float, y: float
) -> tuple[float, float, float, float, float, bool]:
    """(ux, uy, stretch, dux_dy, duy_dx, inside) at one point; for the stretch see `velocity_of`.

    Outside, the polynomial of the nearest cell is continued and `inside` is False; a position that
    is not a number is outside.
    """
    c = flow.coefficients
    ny, nx = flow.mask.shape
    per = flow.inverse_dx, flow.inverse_dy
    t, r = (x - flow.x0) * per[0], (y - flow.y0) * per[1]
    j, i = _cell(t, nx), _cell(r, ny)
    first, place = i * c.shape[1] + j, (t - j, r - i)
    psi = slopes(c, first, place, per)
    ux, uy, stretch, dux_dy, duy_dx = velocity_of(flow.chi, psi, c, first, place, per)
    # `and` would branch, which takes as long as all of the above.
    inside = (flow.x_low <= x) & (x <= flow.x_high) & (flow.y_low <= y) & (y <= flow.y_high)
    inside = inside & (element(flow.mask, i * nx + j) != 0)
    return ux, uy, stretch, dux_dy, duy_dx, inside


@kernel
def _sample_many(
    flow: FlowArrays, x: Array, y: Array, out: Array, inside: NDArray[np.bool_]
) -> None:
    """`sample_flow` at the points x, y (n,) into out (5, n) and inside (n,)."""
    for k in range(x.size):
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k], inside[k] = sample_flow(
            flow, x[k], y[k]
        )


@dataclass(frozen=True, repr=False)
class FlowField(FlowMethods):
    """A stationary plane flow.

    arrays : what compiled kernels take, see `FlowArrays` and `sample_flow`
    origin : where the flow came from, one line
    outline : where the fluid ends, patch by patch; None where nothing is known of that
    misfit : how far it is off the U of the solver that it was read from; None where there is none
    plane : of the case that it was read from, in its space
    """

    arrays: FlowArrays
    origin: str
    outline: Outline | None = None
    misfit: Misfit | None = None
    plane: CasePlane = FLAT

    @classmethod
    def from_stream_function(
        cls,
        psi: Array,
        x: Array,
        y: Array,
        origin: str,
        wall_velocity: WallVelocity | None = None,
        inside: NDArray[np.bool_] | None = None,
        outline: Outline | None = None,
    ) -> FlowField:
        """The spline through psi at the nodes, with the walls' tangential velocity as end slopes.

        Parameters
        ----------
        psi : (ny+1, nx+1), axis order (y, x)
        x, y : (nx+1,) and (ny+1,), the nodes, evenly spaced
        origin : one line
        wall_velocity : tangential velocity at the four sides' nodes; missing ones (None or
            NaN) follow from psi by one-sided differences
        inside : (ny, nx), the cells that lie in the flow; all of them by default
        outline : where the fluid ends
        """
        nx, ny = x.size - 1, y.size - 1
        width, height = float(x[-1] - x[0]), float(y[-1] - y[0])
        if psi.shape != (ny + 1, nx + 1) or min(nx, ny) < 4:
            raise InputError(
                "stream function", "nodes (ny+1, nx+1) with at least 4 cells each way",
                f"psi of shape {psi.shape} on {ny + 1} x {nx + 1} nodes", "Give psi[y, x].",
            )  # fmt: skip
        coefficients = stream_coefficients(psi, width / nx, height / ny, wall_velocity)
        cells = np.ones((ny, nx), bool) if inside is None else inside
        return cls.from_coefficients(coefficients, x, y, origin, cells, outline)

    @classmethod
    def from_coefficients(
        cls,
        coefficients: Array,
        x: Array,
        y: Array,
        origin: str,
        inside: NDArray[np.bool_],
        outline: Outline | None = None,
    ) -> FlowField:
        """The field of coefficients (ny+3, nx+3); the rest as `from_stream_function`."""
        ny, nx = inside.shape
        width, height = float(x[-1] - x[0]), float(y[-1] - y[0])
        arrays = FlowArrays(
            coefficients, float(x[0]), float(y[0]), nx / width, ny / height,
            float(x[0]) - RIM * width, float(x[-1]) + RIM * width,
            float(y[0]) - RIM * height, float(y[-1]) + RIM * height, inside.astype(np.uint8),
        )  # fmt: skip
        return cls(arrays, origin, outline)

    @functools.cached_property
    def digest(self) -> str:
        """What tells two flows apart: a hash of their numbers, whatever they are called, in any plane."""
        digest = hashlib.sha256()
        for part in self.arrays[:10] if self.arrays.chi is None else self.arrays:
            digest.update(np.ascontiguousarray(part).tobytes())
        if self.outline is not None:
            for numbers in self.outline[:3]:
                digest.update(np.ascontiguousarray(numbers).tobytes())
            digest.update(repr(self.outline[3:]).encode())
        return digest.hexdigest()[:16]

    @property
    def cells(self) -> tuple[int, int]:
        """(ny, nx), the spline's cells."""
        ny, nx = self.arrays.mask.shape
        return ny, nx

    @property
    def has_sources(self) -> bool:
        """Whether it is not free of divergence: u = rot psi + grad chi."""
        return self.arrays.chi is not None

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x_low, x_high, y_low, y_high) of the flow's rectangle; infinite for analytic flows."""
        flow = self.arrays
        if math.isinf(flow.x_low):
            return flow.x_low, flow.x_high, flow.y_low, flow.y_high
        ny, nx = self.cells
        return flow.x0, flow.x0 + nx / flow.inverse_dx, flow.y0, flow.y0 + ny / flow.inverse_dy

    @property
    def in_time(self) -> FlowArrays | Interval:
        """What `interval.sample_at` takes in kernels, together with the time."""
        return self.arrays

    @property
    def until(self) -> float:
        """The time until which `in_time` holds."""
        return math.inf

    def at(self, t: float) -> FlowField:
        """The flow at a time, which for this one does not matter."""
        del t
        return self

    def steady_fields(self) -> Iterator[FlowField]:
        """The flow at each of the times that it is given at: once."""
        yield self

    def given_times(self, until: float) -> tuple[Array, NDArray[np.int64]]:
        """Times that hold [0, until] at which it is given, linear in between, (n,) with n >= 2.

        And which of `steady_fields` each of them is, (n,).
        """
        return np.array([0.0, until]), np.zeros(2, np.int64)

    @functools.cached_property
    def largest_speed(self) -> float:
        """The largest speed inside the flow's rectangle, on a grid of points."""
        x_low, x_high, y_low, y_high = self.bounds
        axes = np.linspace(x_low, x_high, _POINTS), np.linspace(y_low, y_high, _POINTS)
        sample = self.evaluate(*np.meshgrid(*axes))
        return float((np.hypot(sample.velocity_x, sample.velocity_y) * sample.inside).max())

    def evaluate(self, x: ArrayLike, y: ArrayLike) -> FlowSample:
        """Velocity and gradient at points of any (common) shape; `inside` tells where they hold."""
        points = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        shape = points[0].shape
        out = np.empty((5, points[0].size))
        inside = np.empty(points[0].size, np.bool_)
        _sample_many(self.arrays, points[0].ravel(), points[1].ravel(), out, inside)
        ux, uy, stretch, dux_dy, duy_dx = out.reshape(5, *shape)
        half = 0.5 * divergence_values(self.arrays, *points)
        dux_dx, duy_dy = stretch + half, half - stretch
        return FlowSample(ux, uy, dux_dx, dux_dy, duy_dx, inside.reshape(shape), duy_dy)

    def continued(self, x: ArrayLike, y: ArrayLike) -> FlowSample:
        """As `evaluate`, at the nearest point of the flow's rectangle: ghost cells see walls."""
        x_low, x_high, y_low, y_high = self.bounds
        return self.evaluate(np.clip(x, x_low, x_high), np.clip(y, y_low, y_high))

    def save(self, path: Path) -> None:
        """Write an .npz that `load` reads; a kill at any moment leaves the old file or the new."""
        arrays = {
            "coefficients": self.arrays.coefficients,
            "numbers": np.array(self.arrays[1:9]),
            "mask": self.arrays.mask,
            "origin": np.array(self.origin),
            "plane": np.array(self.plane, np.float64),
            **({} if self.outline is None else outline_arrays(self.outline)),
            **({} if self.misfit is None else {"misfit": np.array(self.misfit)}),
        }
        with whole_file(path) as scratch, scratch.open("wb") as file:
            np.savez_compressed(
                file,
                allow_pickle=False,
                **arrays,
            )

    @classmethod
    def load(cls, path: Path) -> FlowField:
        """Read what `save` wrote; InputError where the file is missing or is something else."""
        saved = read_saved(path)
        x0, y0, gx, gy, x_low, x_high, y_low, y_high = saved.numbers
        limits = (x_low, x_high, y_low, y_high)
        return cls(
            FlowArrays(saved.coefficients, x0, y0, gx, gy, *limits, saved.mask, saved.chi),
            saved.origin,
            saved.outline,
            saved.misfit,
            saved.plane,
        )

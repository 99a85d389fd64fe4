"""A flow between two times: the coefficients of psi are linear in time there.

    u(t) = (1 - s) u_0 + s u_1,      s = (t - t_0)/(t_1 - t_0)

So u stays free of divergence and tight at walls at every time. Both ends are met to the bit: a run that
passes from one interval to the next sees no jump, not even one of rounding.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel, plain
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow.field import FlowArrays, FlowField, FlowSample, sample_flow

if TYPE_CHECKING:
    from ellipsoid_coupling.flow.series import FlowSeries

Array = NDArray[np.float64]
Sample = tuple[float, float, float, float, float, bool]

# Entries of `Interval.span`.
START, END, PER_TIME = range(3)


class Interval(NamedTuple):
    """What compiled kernels get of a flow between two times.

    Attributes
    ----------
    first : FlowArrays
        At t_0.
    last : (ny+3, nx+3) float64
        The coefficients at t_1; all else is the same.
    span : (3,) float64
        t_0, t_1 and 1/(t_1 - t_0).
    """

    first: FlowArrays
    last: Array
    span: Array


def set_span(span: Array, start: float, end: float) -> None:
    """Set an interval's `span`, in place."""
    span[:] = start, end, 1.0 / (end - start)


@inline_kernel
def part_of(span: Array, t: float) -> float:
    """How much of an interval has passed at the time t, from 0 to 1, both exact at its ends."""
    part = max(0.0, (t - span[START]) * span[PER_TIME])
    # Rounding may miss 1 at the end.
    return 1.0 if t >= span[END] else min(part, 1.0)


@inline_kernel
def between(part: float, first: float, last: float) -> float:
    """(1 - s) first + s last, exact for s = 0, for s = 1, and where both are the same."""
    near = part < 0.5
    base = first if near else last
    weight = part if near else part - 1.0
    return base + weight * (last - first)


@chosen_by_type
def sample_at(flow: FlowArrays | Interval, t: float, x: float, y: float) -> Sample:
    """`sample_flow` at the time t: (ux, uy, stretch, dux_dy, duy_dx, inside)."""
    raise NotImplementedError


@inline_kernel
def _sample_steady(
    flow: FlowArrays,
    t: float,  # noqa: ARG001 (of the contract)
    x: float,
    y: float,
) -> Sample:
    return sample_flow(flow, x, y)


@inline_kernel
def _sample_between(flow: Interval, t: float, x: float, y: float) -> Sample:
    s = part_of(flow.span, t)
    # Of the same numbers, so that the compiler finds the weights of the place once for both.
    last = FlowArrays(flow.last, *flow.first[1:])
    ux, uy, stretch, dux_dy, duy_dx, inside = sample_flow(flow.first, x, y)
    later_ux, later_uy, later_stretch, later_xy, later_yx, _ = sample_flow(last, x, y)
    return (
        between(s, ux, later_ux),
        between(s, uy, later_uy),
        between(s, stretch, later_stretch),
        between(s, dux_dy, later_xy),
        between(s, duy_dx, later_yx),
        inside,
    )


register_formula(sample_at, FlowArrays, _sample_steady)
register_formula(sample_at, Interval, _sample_between)


@dataclass(frozen=True)
class MovingFlow(FlowField):
    """A flow between two times, as a run has it; see `window.Window`, which moves it on in place.

    `arrays` are those of the interval's start: the place of the mesh, but no velocity.

    Attributes
    ----------
    interval : Interval
    series : FlowSeries
        The flow at all times.
    """

    interval: Interval = field(kw_only=True)
    series: FlowSeries = field(kw_only=True)

    @functools.cached_property
    def digest(self) -> str:
        """That of the whole series."""
        return self.series.digest

    @property
    def in_time(self) -> FlowArrays | Interval:
        """The interval."""
        return self.interval

    @property
    def until(self) -> float:
        """The end of the interval."""
        return float(self.interval.span[END])

    def at(self, t: float) -> FlowField:
        """The flow at a time of the interval; beyond it, at its nearest end."""
        first, last, span = self.interval
        mean = blend(float(plain(part_of)(span, t)), first.coefficients, last)
        arrays = first._replace(coefficients=mean)
        return FlowField(arrays, self.origin, self.outline, plane=self.plane)

    def steady_fields(self) -> Iterator[FlowField]:
        """Those of the whole series."""
        yield from self.series.steady_fields()

    def given_times(self, until: float) -> tuple[Array, NDArray[np.int64]]:
        """Those of the whole series."""
        return self.series.given_times(until)

    def evaluate(self, x: ArrayLike, y: ArrayLike) -> FlowSample:
        """Nothing: without a time there is no velocity. Raises RunError."""
        del x, y
        raise without_a_time()


def without_a_time() -> RunError:
    """The error of a flow that changes in time and is taken as if it did not."""
    return RunError(
        "A flow that changes in time was asked for its velocity without a time. Take "
        "flow.at(t).evaluate(x, y); in a model's kernels, flow.in_time of its Setup."
    )


def blend(part: float, first: Array, last: Array) -> Array:
    """`between` for arrays of one shape."""
    near = part < 0.5
    base, weight = (first, part) if near else (last, part - 1.0)
    return base + weight * (last - first)

"""Where samples start that move without noise: evenly spread, nearer along the axis that is drawn out.

Along each axis of the start box samples are to be as near to each other, at the worst of all times, as
along the other one: a potential that falls between two rows of samples is not felt. How far a flow draws
an axis out is seen from some particles that follow the fluid and nothing else, in the flow of time 0, as
long as they are in the domain.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.boundaries import box_of_sides, periodic_axes
from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges
from ellipsoid_coupling.models.base import Setup

Floats = NDArray[np.float64]

# Particles along an axis, and steps to the last save time.
_PROBES, _STEPS = 32, 128
# Axes that are drawn out alike to this factor are taken for equal; a larger ratio than the last is not
# followed, since columns must resolve the potential at the start.
_ALIKE, _MOST = 1.5, 16.0
# Rows are a multiple of this, so that blocks hold several of them.
_ROWS = 16


class Lattice(NamedTuple):
    """Samples start at the midpoints of rows x columns equal parts of the start box."""

    rows: int
    columns: int


def sample_lattice(setup: Setup, samples: int) -> Lattice:
    """As near to `samples` in all as rows and columns of the right ratio are."""
    side = max(1, round(math.sqrt(samples)))
    ratio = _rows_per_column(setup)
    if samples < _ROWS**2 or 1.0 / _ALIKE < ratio < _ALIKE:
        return Lattice(side, side)
    rows = _ROWS * max(1, round(math.sqrt(samples * ratio) / _ROWS))
    return Lattice(rows, max(1, round(samples / rows)))


def flow_map_columns(setup: Setup, edges: FluidEdges | None, columns: int) -> int:
    """The columns of samples whose places are points of one smooth flow map; 0 where none is.

    Noise, sides that particles wrap round and patches that catch some tear the map.
    """
    scene, terms = setup.scene, setup.terms
    torn = terms.noise or terms.angular_noise or any(periodic_axes(scene)) or edges is not None
    start = scene.start
    return 0 if torn or start.places() or start.file is not None else columns


def _rows_per_column(setup: Setup) -> float:
    """How much longer the start box's upright lines become than its level ones, each at its longest."""
    start = setup.scene.start
    probes = even_points(start.x, start.y, _PROBES, _PROBES)
    domain = setup.scene.domain
    low, high = np.array([domain.x, domain.y]).T[:, :, None, None]
    longest = np.zeros(2)
    for places in (probes, *_carried(setup, probes)):
        inside = np.all((low <= places) & (places <= high), axis=0)
        longest = np.maximum(longest, _spacings(places, inside))
    level, upright = longest
    ratio = upright / level if level > 0.0 else 1.0
    return float(np.clip(ratio, 1.0 / _MOST, _MOST)) if math.isfinite(ratio) else 1.0


def _spacings(places: Floats, inside: NDArray[np.bool_]) -> Floats:
    """Mean distances of neighbours in a row and in a column, of those places (2, rows, columns) inside."""
    found = np.zeros(2)
    pairs = inside[:, 1:] & inside[:, :-1], inside[1:] & inside[:-1]
    for k, both in enumerate(pairs):
        apart = np.hypot(*np.diff(places, axis=2 - k))
        found[k] = apart[both].mean() if both.any() else 0.0
    return found


def _carried(setup: Setup, places: Floats) -> list[Floats]:
    """Places of particles at rest that the drag takes along, step by step; none without a fluid."""
    scene = setup.scene
    if setup.flow is None or scene.flow is None:
        return []
    flow, box = setup.flow.at(0.0), box_of_sides(scene, "reflect")
    dt = scene.times[-1] / _STEPS
    left = math.exp(-scene.flow.drag * dt)
    velocity, found = np.zeros_like(places), list[Floats]()
    for _ in range(_STEPS):
        fluid = flow.continued(*places)
        velocity = left * velocity + (1.0 - left) * np.array([fluid.velocity_x, fluid.velocity_y])
        places = places + dt * velocity
        if box is not None:
            places = np.clip(places, box[:, 0, None, None], box[:, 1, None, None])
        found.append(places)
    return found

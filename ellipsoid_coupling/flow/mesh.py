"""A solved plane case as a reader hands it over."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.case_plane import FLAT, CasePlane
from ellipsoid_coupling.flow.polygons import Edges, Polygons
from ellipsoid_coupling.flow.stream_function import Patch, Rim, given_on_edges

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MeshFlow:
    """One solved plane case.

    points : (P, 2), the mesh points of one plane
    edges : between them; a thin plate is two edges in one place, each beside one cell
    cells : the polygons that the edges lie around
    velocity : (C, 2) in them
    patches : by name, without the empty ones
    rim : where their faces are among the edges
    flux : (E,), what the solver says of the flux through edges, as a jump of psi; None if it says nothing
    where, origin : the folder for messages, the line for `FlowField.origin`
    corner : (2,), the place in the case from which points are measured
    plane : the plane of the case that it lies in
    """

    points: Array
    edges: Edges
    cells: Polygons
    velocity: Array
    patches: Mapping[str, Patch]
    rim: Rim
    flux: Array | None
    where: str
    origin: str
    corner: Array
    plane: CasePlane = FLAT

    @functools.cached_property
    def centres(self) -> Array:
        """(C, 2), the cells' centroids."""
        return self.cells.centroids(self.points)

    @functools.cached_property
    def given(self) -> Array:
        """(E, 2), the boundary's velocity in the middle of its edges, see `given_on_edges`."""
        return given_on_edges(self.edges, self.velocity, self.patches, self.rim)

    @functools.cached_property
    def middles(self) -> Array:
        """(E, 2), of the edges."""
        return np.asarray(self.points[self.edges.points].mean(axis=1))

    @functools.cached_property
    def top_speed(self) -> float:
        """The largest speed in cells and on the boundary."""
        known = np.isfinite(self.given[:, 0])
        return float(np.hypot(*np.concatenate((self.velocity, self.given[known])).T).max())

    def lengths(self) -> Array:
        """(E,), of the edges."""
        way = self.points[self.edges.points[:, 1]] - self.points[self.edges.points[:, 0]]
        return np.asarray(np.hypot(way[:, 0], way[:, 1]))

"""From the plane z = 0, in which meshes are made here, to the plane of the flow's case."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ellipsoid_coupling.flow.case_plane import FLAT, CasePlane

if TYPE_CHECKING:
    import pyvista

# The arrays that have a direction; `scale` has three sizes along an ellipse's own axes.
_VECTORS = ("velocity", "orientation")


def placed(mesh: pyvista.DataSet, plane: CasePlane) -> pyvista.DataSet:
    """A mesh at z = 0, image data or polygons, moved in place into a plane, with its vectors.

    Image data keep the order of their points and cells: one axis of three has no extent before and after.
    """
    import pyvista

    if plane == FLAT:
        return mesh
    if isinstance(mesh, pyvista.ImageData):
        flat = np.array([mesh.dimensions, mesh.spacing, mesh.origin], np.float64)
        flat[2, 2] = plane.level
        dimensions, mesh.spacing, mesh.origin = map(tuple, plane.turned(flat).tolist())
        mesh.dimensions = tuple(map(int, dimensions))
    elif isinstance(mesh, pyvista.PolyData):
        points = np.array(mesh.points, np.float64)
        points[:, 2] = plane.level
        mesh.points = plane.turned(points)
    for data in (mesh.point_data, mesh.cell_data):
        for name in _VECTORS:
            if name in data:
                data[name] = plane.turned(np.asarray(data[name]))
    return mesh


def placed_series(
    meshes: Iterable[tuple[float, pyvista.DataSet]], plane: CasePlane
) -> Iterator[tuple[float, pyvista.DataSet]]:
    """The same of (time, mesh), one by one."""
    for time, mesh in meshes:
        yield time, placed(mesh, plane)

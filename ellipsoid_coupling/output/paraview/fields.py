"""Densities and their fields as image data: one VTK cell for each cell of the grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.fluid_cells import fluid_cells
from ellipsoid_coupling.geometry.orientation import Complexes, as_axis, mean_axis
from ellipsoid_coupling.geometry.patches import is_outlined
from ellipsoid_coupling.output.orientation import axis_moment, axis_moments
from ellipsoid_coupling.output.paraview.series import vectors
from ellipsoid_coupling.result import Result

if TYPE_CHECKING:
    import pyvista

Floats = NDArray[np.float64]
Interval = tuple[float, float]

# VTK's vtkDataSetAttributes::HIDDENCELL.
HIDDEN_CELL = 32
# Below this part of the largest density, velocity and angle are those of nothing: written as 0.
VACUUM = 1e-12


def cell_image(
    x: Interval, y: Interval, shape: tuple[int, int], arrays: Mapping[str, Floats]
) -> pyvista.ImageData:
    """Image data of `shape` (ny, nx) cells over the rectangle x times y, flat at z = 0.

    arrays : cell data, (ny, nx) in axis order (y, x), or (ny * nx, 3) with x running fastest
    """
    import pyvista

    ny, nx = shape
    width, height = (x[1] - x[0]) / nx, (y[1] - y[0]) / ny
    image = pyvista.ImageData(
        dimensions=(nx + 1, ny + 1, 1), spacing=(width, height, width), origin=(x[0], y[0], 0.0)
    )
    for name, values in arrays.items():
        image.cell_data[name] = values.ravel() if values.size == nx * ny else values
    return image


def grid_images(
    result: Result, flow: FlowField | None = None
) -> Iterator[tuple[float, pyvista.ImageData]]:
    """(time, image) of a "rho" or "q" result; see `grid_fields` for the arrays.

    With a flow that patches bound, cells in solids are hidden: ParaView draws nothing there.
    """
    domain = result.scene.domain
    hidden = _hidden(result, flow)
    for index, time in enumerate(result.times):
        fields = grid_fields(result, index)
        image = cell_image(domain.x, domain.y, fields["density"].shape, fields)
        if hidden is not None:
            image.cell_data["vtkGhostType"] = hidden
        yield float(time), image


def _hidden(result: Result, flow: FlowField | None) -> NDArray[np.uint8] | None:
    """VTK's mark of cells that are not in the fluid, (ny * nx,), x running fastest; None of a rectangle."""
    if flow is None or not is_outlined(result.scene, flow):
        return None
    x, y = result.coordinates["x"], result.coordinates["y"]
    cells = fluid_cells(flow.outline, x, y, result.scene.domain.width / x.size)
    return np.where(cells.inside, 0, HIDDEN_CELL).astype(np.uint8).ravel()


def histogram_images(result: Result, cells: int) -> Iterator[tuple[float, pyvista.ImageData]]:
    """(time, image) of a particle result's density on cells x cells bins, with S and the mean axes."""
    domain, shape = result.scene.domain, (cells, cells)
    moments = axis_moments(result, shape)
    for time, density, moment in zip(result.times, result.density(cells), moments, strict=True):
        yield (
            float(time),
            cell_image(domain.x, domain.y, shape, {"density": density} | axes(moment)),
        )


def axes(moment: Complexes) -> dict[str, Floats]:
    """What <e^{2 i theta}> in cells (ny, nx) tells: order, mean axes, and arrays for lines along them.

    S : (ny, nx); angle : (ny, nx), of the mean axis, modulo pi; orientation : (ny * nx, 3) unit vectors
    along it, 0 where S is 0
    """
    order, angle = np.abs(moment), mean_axis(moment)
    some = (order > 0.0).astype(np.float64)
    return {
        "S": order,
        "angle": as_axis(angle),
        "orientation": vectors(some * np.cos(angle), some * np.sin(angle)),
    }


def grid_fields(result: Result, index: int) -> dict[str, Floats]:
    """The fields of a grid at one saved time; `axes` has the others.

    density, mean_angle (radian), speed, angular_velocity : (ny, nx), axis order (y, x)
    velocity : (ny * nx, 3), x running fastest
    alignment : (ny, nx), q only: the length of the mean of (cos theta, sin theta), 1 where all
        particles of a cell have one angle, near 0 where the mean angle says nothing
    """
    values = {name: array[index] for name, array in result.variables.items()}
    fields = _r_fields(values) if result.layout == "rho" else _q_fields(values, result)
    density = fields["density"]
    filled = density > VACUUM * density.max()
    velocity = [np.where(filled, fields.pop(f"velocity_{axis}"), 0.0) for axis in "xy"]
    return fields | {
        "mean_angle": np.where(filled, fields["mean_angle"], 0.0),
        "angular_velocity": np.where(filled, fields["angular_velocity"], 0.0),
        "velocity": vectors(*velocity),
        "speed": np.hypot(*velocity),
        **axes(np.where(filled, axis_moment(result, index, filled.shape), 0.0)),
    }


def _r_fields(values: Mapping[str, Floats]) -> dict[str, Floats]:
    names = ("density", "mean_angle", "velocity_x", "velocity_y", "angular_velocity")
    return {name: values[name] for name in names}


def _q_fields(values: Mapping[str, Floats], result: Result) -> dict[str, Floats]:
    """Density integrated over the angle, means weighted with it, the angle's mean on the circle."""
    q, angles = values["density"], result.coordinates["angle"][:, None, None]
    total = q.sum(axis=0)
    divisor = np.where(total > 0.0, total, 1.0)
    cosine, sine = ((q * wave(angles)).sum(axis=0) / divisor for wave in (np.cos, np.sin))
    means = {
        name: (q * values[name]).sum(axis=0) / divisor
        for name in ("velocity_x", "velocity_y", "angular_velocity")
    }
    return means | {
        "density": total * 2.0 * np.pi / q.shape[0],
        "mean_angle": np.mod(np.arctan2(sine, cosine), 2.0 * np.pi),
        "alignment": np.hypot(cosine, sine),
    }

"""One flow, looked at wherever it is used: nodes, particles, cells, and the ghosts of the walls."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.finite_volume.grid import scene_grid
from ellipsoid_coupling.flow import FlowField, FlowSample
from ellipsoid_coupling.flow.inside import in_fluid
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.stream_values import psi_coefficients
from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.geometry.orientation import as_axis
from ellipsoid_coupling.geometry.patches import is_outlined
from ellipsoid_coupling.interaction.walls import GhostParticles
from ellipsoid_coupling.models.from_scene import flow_edges, scene_ghosts, scene_walls
from ellipsoid_coupling.output.outlines import square_outlines
from ellipsoid_coupling.output.paraview.fields import HIDDEN_CELL, cell_image
from ellipsoid_coupling.output.paraview.particles import glyph_arrays, points, polygons
from ellipsoid_coupling.output.paraview.placed import placed
from ellipsoid_coupling.output.paraview.series import save_mesh, save_together, vectors
from ellipsoid_coupling.physics.bspline import spline_weights
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene

if TYPE_CHECKING:
    import pyvista

Floats = NDArray[np.float64]


def export_flow(
    flow: FlowField, scene: Scene, folder: Path, result: Result | None = None
) -> list[Path]:
    """Write the flow as each part of the package sees it.

        flow.vti                 velocity and stream function, on the nodes of the flow's spline
                                 (a formula's: on the corners of the scene's cells)
        flow_particles.vtp       velocity at the particles: the result's first saved ones, else an
                                 even lattice of the scene's number of them in the start box
        flow_cells.vti           velocity at the finite-volume cells
        flow_ghost_particles.vtp velocity of the wall at the ghost particles on it, the lid's too
        flow_ghost_cells.vtp     the wall's velocity continued to the ghost cells beyond, as squares
        walls.vtp                where the fluid ends: lines, with the number of their patch

    Ghosts only for scenes with [walls], ghost cells only where these are sides of the domain (patches that
    bound the fluid have none), and walls.vtp for flows of a case, in whose plane all of it lies. Of a flow
    that changes each is a series, flow.pvd and so on, with the flow (and the particles) as of each
    saved time, or of the scene's without a result. `inside` is 1 where a point lies in the flow; ghosts
    take the velocity of the nearest point of the flow's rectangle. With velocity stands `speed`.

    Parameters
    ----------
    flow : FlowField
    scene : Scene, for domain, cells, start box and walls
    folder : Path, made where it is missing
    result : Result, optional, whose particles of realisation 0 are taken

    Returns
    -------
    The paths written.

    Raises
    ------
    InputError
        If the domain is not a whole number of the scene's cells.
    """
    times = list(scene.times if result is None else result.times)
    if flow.at(times[0] if times else 0.0) is flow:
        meshes = _meshes(flow, scene, result, 0)
        return [save_mesh(mesh, folder / name) for name, mesh in meshes.items()]
    at_times = ((time, _meshes(flow.at(time), scene, result, k)) for k, time in enumerate(times))
    return save_together(at_times, folder)


def _meshes(
    flow: FlowField, scene: Scene, result: Result | None, time: int
) -> dict[str, pyvista.DataSet]:
    """The flow on each mesh of `export_flow`, by file; the particles are those of saved time `time`."""
    meshes: dict[str, pyvista.DataSet] = {
        "flow.vti": flow_nodes(flow, scene),
        "flow_particles.vtp": flow_at_particles(flow, scene, result, time),
        "flow_cells.vti": flow_at_cells(flow, scene),
    }
    ghosts = None if scene.walls is None else scene_ghosts(scene, flow_edges(scene, flow))
    if ghosts is not None:
        meshes["flow_ghost_particles.vtp"] = flow_at_ghosts(flow, scene, ghosts)
    if ghosts is not None and not is_outlined(scene, flow):
        meshes["flow_ghost_cells.vtp"] = flow_at_ghost_cells(flow, scene)
    if flow.outline is not None:
        meshes["walls.vtp"] = outline_lines(flow.outline)
    return {name: placed(mesh, flow.plane) for name, mesh in meshes.items()}


def flow_at_ghosts(flow: FlowField, scene: Scene, ghosts: GhostParticles) -> pyvista.PolyData:
    """Velocity of the walls at the ghost particles on them."""
    size = (scene.particles.length, scene.particles.width)
    arrays = glyph_arrays(ghosts.angle, size)
    arrays |= _flow_arrays(flow.continued(ghosts.x, ghosts.y))
    return points(ghosts.x, ghosts.y, arrays)


def flow_at_ghost_cells(flow: FlowField, scene: Scene) -> pyvista.PolyData:
    """The walls' velocity continued to the ghost cells beyond the domain, as squares."""
    walls = scene_walls(scene, potential_shape(scene.particles.length, scene.particles.width))
    assert walls is not None
    cells = walls.ghost_cells(scene.numerics.cell)
    arrays = {"density": cells.density, "angle": as_axis(cells.angle)}
    arrays |= _flow_arrays(flow.continued(cells.x, cells.y))
    return polygons(square_outlines(cells.x, cells.y, scene.numerics.cell), arrays)


def outline_lines(outline: Outline) -> pyvista.PolyData:
    """The edges of an outline as lines, with the patch of each, its flux, and the patches' names."""
    import pyvista

    count = len(outline.ends)
    ends = outline.ends.reshape(-1, 2)
    lines = np.column_stack((np.full(count, 2), np.arange(2 * count).reshape(-1, 2)))
    mesh = pyvista.PolyData(vectors(ends[:, 0], ends[:, 1]), lines=lines.ravel())
    mesh.cell_data["patch"], mesh.cell_data["outflow"] = outline.patch, outline.outflow
    mesh.field_data["patch_names"] = np.array(outline.names, dtype=np.str_)
    return mesh


def _flow_arrays(sample: FlowSample) -> dict[str, Floats]:
    return {
        "velocity": vectors(sample.velocity_x, sample.velocity_y),
        "speed": np.hypot(sample.velocity_x, sample.velocity_y).ravel(),
        "inside": sample.inside.ravel().astype(np.float64),
    }


def flow_at_cells(flow: FlowField, scene: Scene) -> pyvista.ImageData:
    """Velocity at the centres of the scene's cells, as cell data."""
    grid = scene_grid(scene)
    sample = flow.evaluate(*np.meshgrid(grid.x, grid.y))
    return cell_image(scene.domain.x, scene.domain.y, grid.shape, _flow_arrays(sample))


def flow_at_particles(
    flow: FlowField, scene: Scene, result: Result | None = None, time: int = 0
) -> pyvista.PolyData:
    """Velocity at particles: see `export_flow` for which."""
    if result is not None and result.layout == "particles" and result.times.size:
        there = np.ones(result.variables["x"].shape[2], np.bool_)
        if result.unborn is not None:
            there = ~result.unborn[time, 0]
        x, y, angle = (result.variables[name][time, 0][there] for name in ("x", "y", "angle"))
    else:
        x, y = start_lattice(scene)
        angle = np.full(x.shape, scene.start.angle)
    arrays = glyph_arrays(angle, (scene.particles.length, scene.particles.width))
    return points(x, y, arrays | _flow_arrays(flow.evaluate(x, y)))


def start_lattice(scene: Scene) -> tuple[Floats, Floats]:
    """x, y (n,) of about the scene's number of particles, evenly over the start box; or its points."""
    start = scene.start
    if start.points is not None:
        places = np.array(start.places())
        return places[:, 0], places[:, 1]
    width, height = start.x[1] - start.x[0], start.y[1] - start.y[0]
    columns = max(1, round(math.sqrt(scene.particles.number * width / height)))
    rows = max(1, round(scene.particles.number / columns))
    x, y = even_points(start.x, start.y, columns, rows).reshape(2, -1)
    return x, y


def flow_nodes(flow: FlowField, scene: Scene) -> pyvista.ImageData:
    """Velocity, stream function and `inside` as point data on the nodes, see `export_flow`.

    Cells between nodes that lie in solids are hidden: ParaView draws nothing there.
    """
    import pyvista

    x, y = node_axes(flow, scene)
    image = pyvista.ImageData(
        dimensions=(x.size, y.size, 1),
        spacing=(x[1] - x[0], y[1] - y[0], x[1] - x[0]),
        origin=(x[0], y[0], 0.0),
    )
    for name, values in _flow_arrays(flow.evaluate(*np.meshgrid(x, y))).items():
        image.point_data[name] = values
    image.point_data["stream_function"] = stream_function(flow, x, y).ravel()
    if flow.outline is not None:
        # Of cells, not nodes: those lie on the walls as well.
        centres = np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
        fluid = in_fluid(flow.outline.ends, centres[0].ravel(), centres[1].ravel())
        if not fluid.all():
            image.cell_data["vtkGhostType"] = np.where(fluid, 0, HIDDEN_CELL).astype(np.uint8)
    return image


def node_axes(flow: FlowField, scene: Scene) -> tuple[Floats, Floats]:
    """The nodes of the flow's spline, or the cells' corners for a flow that has no bounds."""
    if math.isinf(flow.bounds[0]):
        grid = scene_grid(scene)
        return grid.x_edges, grid.y_edges
    ny, nx = flow.cells
    x_low, x_high, y_low, y_high = flow.bounds
    return np.linspace(x_low, x_high, nx + 1), np.linspace(y_low, y_high, ny + 1)


def stream_function(flow: FlowField, x: Floats, y: Floats) -> Floats:
    """The psi of u = (d psi/dy, -d psi/dx), without sources, on the lattice x (nx,), y (ny,): (ny, nx)."""
    arrays = flow.arrays
    ny, nx = flow.cells
    along_x = _weight_matrix((x - arrays.x0) * arrays.inverse_dx, nx)
    along_y = _weight_matrix((y - arrays.y0) * arrays.inverse_dy, ny)
    return np.asarray(along_y @ psi_coefficients(arrays) @ along_x.T)


def _weight_matrix(position: Floats, cells: int) -> Floats:
    """Weights (n, cells + 3) of a uniform cubic B-spline's coefficients at positions in cells.

    Beyond the ends the polynomial of the nearest cell is continued, as `sample_flow` does.
    """
    index = np.clip(np.floor(position), 0, cells - 1).astype(np.int64)
    weights = np.zeros((position.size, cells + 3))
    rows = np.arange(position.size)
    for k, weight in enumerate(plain(spline_weights)(position - index)):
        weights[rows, index + k] = weight
    return weights

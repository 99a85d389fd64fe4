"""One result as ParaView files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.case_plane import FLAT, CasePlane
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.paraview.fields import grid_images, histogram_images
from ellipsoid_coupling.output.paraview.flow import export_flow
from ellipsoid_coupling.output.paraview.particles import (
    check_realisation,
    particle_ellipses,
    particle_points,
)
from ellipsoid_coupling.output.paraview.placed import placed_series
from ellipsoid_coupling.output.paraview.series import save_series
from ellipsoid_coupling.result import Result

if TYPE_CHECKING:
    import pyvista

HISTOGRAM_CELLS = 60
SCRIPT = "open_in_paraview.py"
# Lines of mean axes along the longer side of the domain.
LINES_ACROSS = 40
# Of densities: above it they share one colour.
PERCENTILE = 99.5


def export(
    result: Result, folder: Path, flow: FlowField | None = None, realisation: int | None = 0
) -> Path:
    """Write a result's saved times, and the flow, into a folder for ParaView.

    A grid result gives

        fields.pvd      one .vti a time; cell data density, velocity, speed, angular_velocity; S, angle
                        and orientation of the mean axis (see `fields.axes`); mean_angle (and
                        alignment for the q equations, which are integrated over the angle;
                        mean_angle is then the mean on the circle); with a flow that patches bound,
                        cells in solids are hidden

    and a particle result

        particles.pvd   one .vtp of points a time: length, width, angle (modulo pi), orientation (unit
                        vector), scale, velocity, speed, angular_velocity, realisation (and frozen or
                        fate, not 0 for those that have left the flow, which are in no other file)
        ellipses.pvd    one .vtp of polygons a time, one realisation: looks right as it is
        histogram.pvd   one .vti a time: density of all realisations on 60 x 60 bins, with S, angle and
                        orientation of the mean axis in bins of four particles at least

    With a flow, the files of `export_flow` come along. Places and vectors are those of the flow's case: in
    its plane, in the middle of its mesh. Without a case the plane is z = 0.

    open_in_paraview.py opens all of them: ``paraview --script=open_in_paraview.py``, or File > Load
    State. By hand, to draw the points as ellipses, open particles.pvd and add the filter Glyph with

        Glyph Type          Sphere, its Radius 0.5 (the default)
        Orientation Array   orientation
        Scale Array         scale
        Vector Scale Mode   Scale by Components
        Scale Factor        1
        Glyph Mode          All Points

    A sphere of diameter 1 is then stretched to (L, D, D) and turned into the main axis; seen along
    z, it is the ellipse to scale.

    Parameters
    ----------
    result : Result
    folder : Path
        Made where it is missing; files of the same name are replaced.
    flow : FlowField, optional
    realisation : int or None
        Which one's particles are written; None: all in particles.pvd, number 0 in ellipses.pvd.

    Returns
    -------
    The folder.

    Raises
    ------
    InputError
        For a realisation that the result does not have.
    """
    plane = FLAT if flow is None else flow.plane
    for name, suffix, meshes in _series(result, flow, realisation):
        save_series(placed_series(meshes, plane), folder, name, suffix)
    if flow is not None:
        export_flow(flow, result.scene, folder, result)
    write_script(folder, result, plane)
    return folder


def _series(
    result: Result, flow: FlowField | None, realisation: int | None
) -> Iterator[tuple[str, str, Iterator[tuple[float, pyvista.DataSet]]]]:
    """Name, suffix and meshes of each series that shows a result."""
    if result.layout == "particles":
        check_realisation(result, realisation)
        yield "particles", ".vtp", particle_points(result, realisation)
        yield "ellipses", ".vtp", particle_ellipses(result, realisation or 0)
        yield "histogram", ".vti", histogram_images(result, HISTOGRAM_CELLS)
    else:
        yield "fields", ".vti", grid_images(result, flow)


def write_script(folder: Path, result: Result, plane: CasePlane) -> Path:
    """The script that opens the folder in ParaView.

    It is the file of this package, with the folder, the length of lines, the end of the densities' colours,
    the colours of axes and the plane filled in.
    """
    domain = result.scene.domain
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 33)
    points = np.column_stack((angles, axis_colours(angles))).round(4).ravel().tolist()
    normal, up = plane.facing()
    values = {
        "FOLDER": repr(str(folder.absolute())),
        "LINE": repr(max(domain.width, domain.height) / LINES_ACROSS),
        "DENSITY": repr(density_scale(result)),
        "AXIS_COLOURS": repr(points),
        "NORMAL": repr(normal.tolist()),
        "UP": repr(up.tolist()),
    }
    text = Path(__file__).with_name(SCRIPT).read_text("utf-8")
    for name, value in values.items():
        # The backslashes of a path are no groups of the pattern.
        line = f"{name} = {value}".replace("\\", r"\\")
        text = re.sub(f"(?m)^{name} = .*$", line, text)
    with whole_file(folder / SCRIPT) as beside:
        beside.write_text(text, encoding="utf-8")
    return folder / SCRIPT


def density_scale(result: Result) -> float:
    """Where the colours of densities end: at the 99.5th percentile over all cells and saved times.

    A few cells at a caustic would otherwise take all of the colours.
    """
    cells = result.layout != "particles"
    density = result.cell_density() if cells else result.density(HISTOGRAM_CELLS)
    if not density.size:
        return 1.0
    return float(np.percentile(density, PERCENTILE) or density.max()) or 1.0

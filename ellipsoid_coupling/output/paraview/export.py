"""One result as ParaView files."""

from __future__ import annotations

from pathlib import Path

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.paraview.fields import grid_images, histogram_images
from ellipsoid_coupling.output.paraview.flow import export_flow
from ellipsoid_coupling.output.paraview.particles import (
    check_realisation,
    particle_ellipses,
    particle_points,
)
from ellipsoid_coupling.output.paraview.series import save_series
from ellipsoid_coupling.result import Result

HISTOGRAM_CELLS = 60


def export(
    result: Result, folder: Path, flow: FlowField | None = None, realisation: int | None = 0
) -> Path:
    """Write a result's saved times, and the flow, into a folder for ParaView.

    A grid result gives

        fields.pvd      one .vti a time; cell data density, mean_angle, orientation, velocity,
                        angular_velocity (and alignment for the q equations, which are integrated
                        over the angle; mean_angle is then the mean on the circle); with a flow
                        that patches bound, cells in solids are hidden

    and a particle result

        particles.pvd   one .vtp of points a time: length, width, angle, orientation (unit vector),
                        scale, velocity, angular_velocity, realisation (and frozen or fate, not 0 for
                        those that have left the flow, which are in no other file)
        ellipses.pvd    one .vtp of polygons a time, one realisation: looks right as it is
        histogram.pvd   one .vti a time: density of all realisations on 60 x 60 bins

    With a flow, the files of `export_flow` come along.

    To draw the points as ellipses, open particles.pvd and add the filter Glyph with

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
    if result.layout == "particles":
        check_realisation(result, realisation)
        save_series(particle_points(result, realisation), folder, "particles", ".vtp")
        save_series(particle_ellipses(result, realisation or 0), folder, "ellipses", ".vtp")
        save_series(histogram_images(result, HISTOGRAM_CELLS), folder, "histogram", ".vti")
    else:
        save_series(grid_images(result, flow), folder, "fields", ".vti")
    if flow is not None:
        export_flow(flow, result.scene, folder, result)
    return folder

"""Particles as points for glyphs, and as ellipse polygons that need no filter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.geometry.fate_codes import INSIDE
from ellipsoid_coupling.geometry.orientation import as_axis
from ellipsoid_coupling.output.outlines import ellipse_outlines
from ellipsoid_coupling.output.paraview.series import vectors
from ellipsoid_coupling.result import FATE, FROZEN, MARKS, Result

if TYPE_CHECKING:
    import pyvista

Floats = NDArray[np.float64]
Size = tuple[float, float]


def points(x: Floats, y: Floats, arrays: Mapping[str, Floats]) -> pyvista.PolyData:
    """Points (n,) at z = 0, each a vertex cell, with point data (n,) or (n, 3)."""
    import pyvista

    mesh = pyvista.PolyData(vectors(x, y))
    for name, values in arrays.items():
        mesh.point_data[name] = values
    return mesh


def polygons(outlines: Floats, arrays: Mapping[str, Floats]) -> pyvista.PolyData:
    """Polygons of corners (n, k, 2) at z = 0, with cell data (n,) or (n, 3)."""
    import pyvista

    number, corners, _ = outlines.shape
    faces = np.empty((number, corners + 1), np.int64)
    faces[:, 0] = corners
    faces[:, 1:] = np.arange(number * corners).reshape(number, corners)
    mesh = pyvista.PolyData(vectors(outlines[..., 0], outlines[..., 1]), faces=faces.ravel())
    for name, values in arrays.items():
        mesh.cell_data[name] = values
    return mesh


def glyph_arrays(angle: Floats, size: Size) -> dict[str, Floats]:
    """The arrays from which a glyph filter draws ellipses, for angles (n,).

    length, width : (n,); angle : (n,) modulo pi, in [-pi/2, pi/2), which colours axes;
    orientation : (n, 3) unit vectors along the main axes, heads included; scale : (n, 3), (L, D, D)
    """
    length, width = np.full(angle.shape, size[0]), np.full(angle.shape, size[1])
    return {
        "length": length,
        "width": width,
        "angle": as_axis(angle),
        "orientation": vectors(np.cos(angle), np.sin(angle)),
        "scale": np.stack([length, width, width], axis=-1),
    }


def particle_arrays(result: Result, index: int, realisation: int | None) -> dict[str, Floats]:
    """x, y and the data of the particles at one saved time, (n,) or (n, 3).

    Without those that an inlet has not fed in yet; `scale` is 0 of those that have left the flow.

    realisation : None for all of them, one after the other
    """
    count, number = result.variables["x"].shape[1:]
    chosen = slice(None) if realisation is None else slice(realisation, realisation + 1)
    flat = {name: array[index, chosen].ravel() for name, array in result.variables.items()}
    particles = result.scene.particles
    arrays: dict[str, Any] = {
        "x": flat["x"],
        "y": flat["y"],
        **glyph_arrays(flat["angle"], (particles.length, particles.width)),
        "velocity": vectors(flat["velocity_x"], flat["velocity_y"]),
        "speed": np.hypot(flat["velocity_x"], flat["velocity_y"]),
        "angular_velocity": flat["angular_velocity"],
        "realisation": np.repeat(np.arange(count)[chosen], number),
        **{name: flat[name] for name in MARKS["particles"] if name in flat},
    }
    if result.frozen is not None:
        # A glyph of those that have left is nothing.
        arrays["scale"] = arrays["scale"] * ~result.frozen[index, chosen].reshape(-1, 1)
    if result.unborn is None:
        return arrays
    there = ~result.unborn[index, chosen].ravel()
    return {name: values[there] for name, values in arrays.items()}


def particle_points(
    result: Result, realisation: int | None
) -> Iterator[tuple[float, pyvista.PolyData]]:
    """(time, points) of a particle result, see `particle_arrays`."""
    for index, time in enumerate(result.times):
        arrays = particle_arrays(result, index, realisation)
        yield float(time), points(arrays.pop("x"), arrays.pop("y"), arrays)


def particle_ellipses(result: Result, realisation: int) -> Iterator[tuple[float, pyvista.PolyData]]:
    """(time, polygons) of one realisation: 32 corners on each particle's ellipse.

    Without those that have left the flow.
    """
    size = (result.scene.particles.length, result.scene.particles.width)
    for index, time in enumerate(result.times):
        arrays = particle_arrays(result, index, realisation)
        for mark in (FROZEN, FATE):
            if mark in arrays:
                kept = arrays.pop(mark) == INSIDE
                arrays = {name: values[kept] for name, values in arrays.items()}
        axis = arrays["orientation"]
        angle = np.arctan2(axis[:, 1], axis[:, 0])
        outlines = ellipse_outlines(arrays.pop("x"), arrays.pop("y"), angle, size)
        del arrays["scale"]
        yield float(time), polygons(outlines, arrays)


def check_realisation(result: Result, realisation: int | None) -> None:
    """Raise InputError for a realisation that the result does not have."""
    count = result.variables["x"].shape[1]
    if realisation is not None and not 0 <= realisation < count:
        raise InputError(
            "ParaView export",
            f"a realisation from 0 to {count - 1}, or all",
            str(realisation),
            "Change it.",
        )

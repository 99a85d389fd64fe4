"""Writing VTK files, and the .pvd files that tie one of them to each time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.files.writing import whole_file

if TYPE_CHECKING:
    import pyvista

Floats = NDArray[np.float64]


def save_mesh(mesh: pyvista.DataSet, path: Path) -> Path:
    """Write a mesh, binary, in the format of the path's suffix; the file is whole or not there."""
    with whole_file(path) as beside:
        mesh.save(beside)
    return path


def save_series(
    meshes: Iterable[tuple[float, pyvista.DataSet]], folder: Path, name: str, suffix: str
) -> Path:
    """Write NAME_0000.SUFFIX, NAME_0001.SUFFIX, ... and NAME.pvd with their times.

    Parameters
    ----------
    meshes : of (time, mesh), taken one by one, so that a generator keeps one mesh in memory
    folder : made where it is missing
    name, suffix : such as "fields" and ".vti"

    Returns
    -------
    Path of the .pvd, which is written last and so never names a file that is not there.
    """
    together = ((time, {f"{name}{suffix}": mesh}) for time, mesh in meshes)
    paths = save_together(together, folder)
    return paths[0] if paths else write_pvd([], folder / f"{name}.pvd")


def save_together(
    meshes: Iterable[tuple[float, Mapping[str, pyvista.DataSet]]], folder: Path
) -> list[Path]:
    """`save_series` of several series at once, by their names with suffix: ``fields.vti``.

    meshes : of (time, meshes by name), taken one by one
    """
    entries: dict[str, list[tuple[float, str]]] = {}
    for index, (time, by_name) in enumerate(meshes):
        for name, mesh in by_name.items():
            stem, _, suffix = name.partition(".")
            # ParaView shows this number when a file is opened without its series.
            mesh.field_data["TimeValue"] = np.array([time])
            path = save_mesh(mesh, folder / f"{stem}_{index:04d}.{suffix}")
            entries.setdefault(stem, []).append((float(time), path.name))
    return [write_pvd(files, folder / f"{stem}.pvd") for stem, files in entries.items()]


def write_pvd(entries: Iterable[tuple[float, str]], path: Path) -> Path:
    """Write a ParaView collection of (time, file name relative to the .pvd); times are exact."""
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
        "  <Collection>",
    ]
    for time, name in entries:
        # repr is the shortest text that reads back as the same number.
        where = f'timestep="{time!r}" group="" part="0" file={quoteattr(name)}'
        lines.append(f"    <DataSet {where}/>")
    lines += ["  </Collection>", "</VTKFile>", ""]
    with whole_file(path) as beside:
        beside.write_text("\n".join(lines), encoding="utf-8")
    return path


def vectors(x: Floats, y: Floats, z: Floats | float = 0.0) -> Floats:
    """Three components per point or cell, (n, 3), from arrays of any one shape in C order."""
    columns = np.broadcast_arrays(x, y, z)
    return np.stack([np.ravel(column) for column in columns], axis=-1)

"""results.nc: all points of a sweep on common bins, over its parameters, for xarray alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.distances import ANGLE_BINS, DENSITY_CELLS
from ellipsoid_coupling.files.cf import CONVENTIONS
from ellipsoid_coupling.files.netcdf import write_netcdf
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.geometry.histograms import FULL_TURN
from ellipsoid_coupling.models import kind_named
from ellipsoid_coupling.scenes import Scene, load_scene
from ellipsoid_coupling.sweeps.description import Sweep
from ellipsoid_coupling.sweeps.records import NUMBERS, SERIES, Record

if TYPE_CHECKING:
    import xarray as xr

Place = tuple[int, ...]
Floats = NDArray[np.float64]

# Dimensions behind those of the parameters, units and long name.
_ARRAYS = {
    "density": (("time", "y", "x"), "1", "probability density, per unit of area"),
    "angle_distribution": (("time", "angle"), "1", "probability density of the angle, per radian"),
    **{name: (("time",), *described) for name, described in SERIES.items()},
}
_ERRORS = {
    "density_error": "L1 distance of the density from the reference's",
    "angle_error": "L1 distance of the angle distribution from the reference's",
}
_COORDINATES = {
    "time": ("1", "time"),
    "x": ("1", "centres of bins, x"),
    "y": ("1", "centres of bins, y"),
    "angle": ("rad", "centres of bins, angle of the main axis against the x axis"),
}


def assemble(
    sweep: Sweep, records: Mapping[Place, Record], run_names: Mapping[Place, str]
) -> xr.Dataset:
    """The data set of a sweep; values of points that have none are NaN.

    Parameters
    ----------
    records : dict
        By the points' places; a place that is left out has the status "missing".
    run_names : dict
        The folder of each place's run, seen from the sweep's.

    Returns
    -------
    xarray.Dataset
        Dimensions: model, the swept keys (or point, where they were taken in pairs), seed; then time, y
        and x, or angle. No variable of the runs shares a name with a dimension.
    """
    import xarray as xr

    scene = load_scene(sweep.scene)
    data = xr.Dataset(
        _variables(sweep, scene, records, run_names),
        coords=_parameters(sweep) | _axes(sweep, scene),
        attrs={
            "Conventions": CONVENTIONS,
            "title": scene.title or scene.name,
            "scene": scene.name,
            "scheme": sweep.lists.scheme,
            "package_version": version("ellipsoid_coupling"),
        },
    )
    reference = reference_model(sweep)
    if reference is not None:
        for name, values in _errors(data, reference).items():
            data[name] = values
            data[name].attrs = {"units": "1", "long_name": _ERRORS[name]}
        data.attrs["reference"] = reference
    return data


def _variables(
    sweep: Sweep, scene: Scene, records: Mapping[Place, Record], run_names: Mapping[Place, str]
) -> dict[str, tuple[Any, ...]]:
    names, shape = tuple(sweep.dimensions), tuple(sweep.dimensions.values())
    sizes = {"time": len(scene.times), "x": DENSITY_CELLS, "y": DENSITY_CELLS, "angle": ANGLE_BINS}
    made: dict[str, tuple[Any, ...]] = {}
    for name, (further, units, text) in _ARRAYS.items():
        values = np.full(shape + tuple(sizes[k] for k in further), np.nan)
        for place, record in records.items():
            if name in record.arrays:
                values[place] = record.arrays[name]
        made[name] = names + further, values, {"units": units, "long_name": text}
    for name, (units, text) in NUMBERS.items():
        values = np.full(shape, np.nan)
        for place, record in records.items():
            values[place] = record.numbers.get(name, np.nan)
        made[name] = names, values, {"units": units, "long_name": text}
    statuses = {place: record.status for place, record in records.items()}
    made["status"] = names, _texts(shape, statuses, "missing"), {"long_name": "how it ended"}
    made["run"] = names, _texts(shape, run_names, ""), {"long_name": "folder of the run"}
    return made


def _texts(shape: Place, texts: Mapping[Place, str], default: str) -> NDArray[np.object_]:
    values = np.full(shape, default, dtype=object)
    for place, text in texts.items():
        values[place] = text
    return values


def _parameters(sweep: Sweep) -> dict[str, tuple[str, Any]]:
    """The coordinates that are parameters: numbers, or texts."""
    return {
        name: (dimension, np.array(values, dtype=object if isinstance(values[0], str) else None))
        for name, (dimension, values) in sweep.coordinates.items()
    }


def _axes(sweep: Sweep, scene: Scene) -> dict[str, tuple[Any, ...]]:
    """Times and centres of bins; bins of domains that differ have no centres in common."""
    made = {"time": np.array(scene.times), "angle": np.arange(ANGLE_BINS) * FULL_TURN / ANGLE_BINS}
    if not any(key.split(".")[0] == "domain" for key in sweep.lists.keys):
        for axis, (low, high) in (("x", scene.domain.x), ("y", scene.domain.y)):
            made[axis] = low + (np.arange(DENSITY_CELLS) + 0.5) * (high - low) / DENSITY_CELLS
    described = {
        name: dict(zip(("units", "long_name"), _COORDINATES[name], strict=True)) for name in made
    }
    return {name: (name, values, described[name]) for name, values in made.items()}


def reference_model(sweep: Sweep) -> str | None:
    """The model that the others are compared with: the one highest in the hierarchy; None if alone."""
    models = sweep.lists.models
    return min(models, key=lambda name: kind_named(name).rank) if len(models) > 1 else None


def _errors(data: xr.Dataset, reference: str) -> dict[str, xr.DataArray]:
    """L1 distances from the reference at the same values of all parameters; NaN of the reference itself."""
    other = data.sel(model=reference, drop=True)
    width = FULL_TURN / ANGLE_BINS
    density = abs(data["density"] - other["density"]).sum(("y", "x"), skipna=False)
    angle = abs(data["angle_distribution"] - other["angle_distribution"])
    rest = data["model"] != reference
    return {
        "density_error": (density * data["bin_area"]).where(rest),
        "angle_error": (angle.sum("angle", skipna=False) * width).where(rest),
    }


def save(data: xr.Dataset, path: Path) -> None:
    """Write results.nc (NetCDF-4), whole or not at all.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    further = sorted(str(name) for name in data.coords if name not in data.dims)
    # So xarray tells these from the variables.
    named = data.assign_attrs(coordinates=" ".join(further)) if further else data
    with whole_file(path) as beside:
        write_netcdf(named, beside)

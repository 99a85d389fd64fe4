"""What a run gives: the saved times of one model on one scene, and how it went."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling import histograms
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files import whole_file
from ellipsoid_coupling.inputs import exists, is_folder
from ellipsoid_coupling.limits import memory_limit
from ellipsoid_coupling.scenes import Scene, parse_toml, scene_from_table
from ellipsoid_coupling.seal import read_sealed, sealed

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
Layout = Literal["particles", "rho", "q"]

DIMENSIONS: dict[Layout, tuple[str, ...]] = {
    "particles": ("time", "realisation", "particle"),
    "q": ("time", "angle", "y", "x"),
    "rho": ("time", "y", "x"),
}

_MOTION = ("velocity_x", "velocity_y", "angular_velocity")
VARIABLES: dict[Layout, tuple[str, ...]] = {
    "particles": ("x", "y", "angle", *_MOTION),
    "q": ("density", *_MOTION),
    "rho": ("density", "mean_angle", *_MOTION),
}

# units and long_name of every variable and coordinate
_DESCRIPTION: dict[str, tuple[str, str]] = {
    "time": ("1", "time"),
    "x": ("1", "position, x"),
    "y": ("1", "position, y"),
    "angle": ("rad", "angle of the main axis against the x axis"),
    "velocity_x": ("1", "velocity, x"),
    "velocity_y": ("1", "velocity, y"),
    "angular_velocity": ("rad", "angular velocity, per unit of time"),
    "density": ("1", "probability density"),
    "mean_angle": ("rad", "mean angle of the main axis against the x axis"),
}


@dataclass(frozen=True)
class Result:
    """The saved times of one run.

    Attributes
    ----------
    scene : Scene
    model, scheme : str
    layout : "particles", "rho" or "q"
        Which of the three sets of variables, and dimensions, `variables` has (see `DIMENSIONS`).
    times : (T,) float64
        The scene's save times (those reached, where the run failed).
    variables : dict of (T, ...) float64
    coordinates : dict
        Cell centres of the grid's axes.
    attributes : dict
        status, seed, steps, wall_seconds (without compiling), compile_seconds, mass_start, ...
    """

    scene: Scene
    model: str
    scheme: str
    layout: Layout
    times: Floats
    variables: dict[str, Floats]
    coordinates: dict[str, Floats]
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """How it ended: "completed", or "failed: ..." with the reason."""
        return str(self.attributes.get("status", ""))

    def density(self, cells: int = 30) -> Floats:
        """The particles' probability density on cells x cells bins of the domain.

        Returns
        -------
        (T, cells, cells) float64, axis order (time, y, x), per unit of area.
        """
        ranges = (self.scene.domain.x, self.scene.domain.y)
        if self.layout == "particles":
            places = zip(self.variables["x"], self.variables["y"], strict=True)
            return np.array([histograms.particle_density(x, y, *ranges, cells) for x, y in places])
        return np.array([histograms.grid_density(d, *ranges, cells) for d in self.cell_density()])

    def cell_density(self) -> Floats:
        """The density on the grid's own cells, (T, ny, nx), integrated over the angle for q."""
        density = self.variables["density"]
        if self.layout == "q":
            return np.asarray(density.sum(axis=1) * histograms.FULL_TURN / density.shape[1])
        return density

    def angle_distribution(self, bins: int = 60) -> Floats:
        """The probability density of the angle on [0, 2 pi), (T, bins), per radian."""
        if self.layout == "particles":
            return np.array([histograms.particle_angles(a, bins) for a in self.variables["angle"]])
        if self.layout == "q":
            mass = self.variables["density"].sum(axis=(2, 3))
            total = mass.sum(axis=1, keepdims=True) * histograms.FULL_TURN / mass.shape[1]
            return np.array([histograms.regrid_angles(m, bins) for m in mass / total])
        pairs = zip(self.variables["mean_angle"], self.variables["density"], strict=True)
        return np.array([histograms.field_angles(a, d, bins) for a, d in pairs])

    def to_dataset(self) -> xr.Dataset:
        """The result as xarray data set, as it stands in result.nc."""
        import xarray as xr

        dimensions = DIMENSIONS[self.layout]
        data = xr.Dataset(
            {name: (dimensions, values) for name, values in self.variables.items()},
            coords={"time": self.times, **self.coordinates},
            attrs={"scene": self.scene.name, "model": self.model, "scheme": self.scheme}
            | self.attributes,
        )
        for name in data.variables:
            units, long_name = _DESCRIPTION[str(name)]
            data[name].attrs = {"units": units, "long_name": long_name}
        return data

    def save(self, path: Path) -> None:
        """Write result.nc (NetCDF-4) with a checksum behind it, whole or not there.

        Made in memory first: the HDF5 library does not survive a full disk.

        Raises
        ------
        WriteError
            If it cannot be written.
        """
        from ellipsoid_coupling.scenes import scene_to_toml

        data = self.to_dataset()
        data.attrs["scene_toml"] = scene_to_toml(self.scene)
        memory = io.BytesIO()
        data.to_netcdf(memory, engine="h5netcdf")
        with whole_file(path) as beside:
            beside.write_bytes(sealed(memory.getvalue()))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a result.nc, or the one in a run folder.

        Raises
        ------
        InputError
            If there is none, it is not one of this package, or its parts do not fit together.
        """
        import xarray as xr

        file = Path(path)
        file = file / "result.nc" if is_folder(file) else file
        if not exists(file):
            raise InputError(str(path), "a run folder or a result.nc", "none", "Check the path.")
        content = read_sealed(file, "a result file", memory_limit())
        try:
            # Values stay as they were written: no decoding of times and fill values.
            with xr.open_dataset(io.BytesIO(content), engine="h5netcdf", decode_cf=False) as data:
                data.load()
            attributes: Mapping[str, Any] = {str(k): v for k, v in data.attrs.items()}
            toml = str(attributes["scene_toml"])
            layout = next(k for k, dims in DIMENSIONS.items() if {*dims} == {*map(str, data.dims)})
        except (OSError, ValueError, KeyError, TypeError, RuntimeError, StopIteration) as error:
            found = str(error) or "none of the known sets of dimensions"
            remedy = "Give a result.nc that this package wrote."
            raise InputError(str(file), "a result file", found, remedy) from None
        scene = scene_from_table(parse_toml(toml, str(file)), str(file))
        result = cls._from_dataset(data, attributes, scene, layout)
        result._check(str(file))
        return result

    def _check(self, where: str) -> None:
        """InputError unless the variables are those of the layout, finite, at the scene's times."""
        remedy = "Give a result.nc that this package wrote."
        count = self.times.size
        if not np.array_equal(self.times, self.scene.times[:count]):
            expected = f"the scene's times {self.scene.times}"
            raise InputError(f"{where}, time", expected, str(self.times), remedy)
        wanted = VARIABLES[self.layout]
        if set(self.variables) != set(wanted):
            found = ", ".join(sorted(self.variables)) or "none"
            raise InputError(where, f"the variables {', '.join(wanted)}", found, remedy)
        shapes = {array.shape for array in self.variables.values()}
        dimensions = DIMENSIONS[self.layout]
        for name, array in self.variables.items():
            if array.ndim != len(dimensions) or len(shapes) > 1 or array.dtype.kind != "f":
                expected = f"floats over ({', '.join(dimensions)}), alike for all variables"
                found = f"{array.dtype} {array.shape}"
                raise InputError(f"{where}, {name}", expected, found, remedy)
            if not np.isfinite(array).all():
                bad = np.argwhere(~np.isfinite(array))[0].tolist()
                raise InputError(
                    f"{where}, {name}{bad}", "a finite number", "NaN or infinity", remedy
                )

    @classmethod
    def _from_dataset(
        cls, data: xr.Dataset, attributes: Mapping[str, Any], scene: Scene, layout: Layout
    ) -> Self:
        named = ("scene", "model", "scheme", "scene_toml")
        return cls(
            scene=scene,
            model=str(attributes.get("model", "")),
            scheme=str(attributes.get("scheme", "")),
            layout=layout,
            times=np.asarray(data["time"].values, dtype=np.float64),
            variables={str(k): np.asarray(v.values) for k, v in data.data_vars.items()},
            coordinates={str(k): np.asarray(data[k].values) for k in data.coords if k != "time"},
            attributes={k: _plain(v) for k, v in attributes.items() if k not in named},
        )


def _plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value

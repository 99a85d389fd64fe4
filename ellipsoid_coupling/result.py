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
from ellipsoid_coupling.scenes import Scene, scene_from_table

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
Layout = Literal["particles", "rho", "q"]

DIMENSIONS: dict[Layout, tuple[str, ...]] = {
    "particles": ("time", "realisation", "particle"),
    "q": ("time", "angle", "y", "x"),
    "rho": ("time", "y", "x"),
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
        """Write result.nc (NetCDF-4), whole or not there.

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
            beside.write_bytes(memory.getbuffer())

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a result.nc, or the one in a run folder.

        Raises
        ------
        InputError
            If there is none, or it is not one of this package.
        """
        import tomllib

        import xarray as xr

        file = Path(path)
        file = file / "result.nc" if file.is_dir() else file
        if not file.is_file():
            raise InputError(str(path), "a run folder or a result.nc", "none", "Check the path.")
        try:
            with xr.open_dataset(file, engine="h5netcdf") as data:
                data.load()
            attributes: Mapping[str, Any] = {str(k): v for k, v in data.attrs.items()}
            table = tomllib.loads(str(attributes["scene_toml"]))
        except (OSError, ValueError, KeyError) as error:
            remedy = "Give a result.nc that this package wrote."
            raise InputError(str(file), "a result file", str(error), remedy) from None
        return cls._from_dataset(data, attributes, scene_from_table(table, str(file)))

    @classmethod
    def _from_dataset(cls, data: xr.Dataset, attributes: Mapping[str, Any], scene: Scene) -> Self:
        named = ("scene", "model", "scheme", "scene_toml")
        layout = next(
            key for key, dims in DIMENSIONS.items() if set(dims) == set(map(str, data.dims))
        )
        return cls(
            scene=scene,
            model=str(attributes["model"]),
            scheme=str(attributes["scheme"]),
            layout=layout,
            times=np.asarray(data["time"].values, dtype=np.float64),
            variables={str(k): np.asarray(v.values) for k, v in data.data_vars.items()},
            coordinates={str(k): np.asarray(data[k].values) for k in data.coords if k != "time"},
            attributes={k: _plain(v) for k, v in attributes.items() if k not in named},
        )


def _plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value

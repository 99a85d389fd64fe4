"""The result of a run: the saved times of one model on one scene, and the log of the run."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, shown
from ellipsoid_coupling.files.netcdf import Stored, read_netcdf, write_netcdf
from ellipsoid_coupling.files.reading import exists, is_folder
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.geometry import histograms
from ellipsoid_coupling.geometry.fate_codes import INSIDE, NOT_YET
from ellipsoid_coupling.scenes import Scene, parse_toml, scene_from_table, terms_of

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

# A variable of some runs only: 1 for a particle that has left the flow's mesh, from then on.
FROZEN = "frozen"
# Likewise, of runs whose particles can end at patches or come in: codes, whole numbers.
FATE = "fate"
MARKS: dict[Layout, tuple[str, ...]] = {"particles": (FROZEN, FATE), "q": (), "rho": ()}

# The attribute that tells of further variables, those of a model from outside: a line each, "name, units,
# long name".
FURTHER = "further_variables"

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
    FROZEN: ("1", "1 where the particle has left the flow's mesh and stays where it left it"),
    FATE: ("1", "what has become of the particle: the patch at which it ended, and where it stays"),
}

# Attributes that the package shows, and those that it counts with; others may be anything.
_TEXTS = (
    "model", "scheme", "status", "warnings", "resolution", "flow", "flow_digest", "package_version",
    "step_limits", "fates", "fate_meanings", "mass_left_by_patch", FURTHER,
)  # fmt: skip
_NUMBERS = (
    "seed", "steps", "rejected_steps", "mass_start", "mass_end", "mass_left", "wall_seconds",
    "compile_seconds", "particles_outside_flow", "particles_at_start", "mass_came_in",
)  # fmt: skip
_LONGEST = 10_000
# A code of `fate` and its meaning, in a list.
_FLAG = re.compile(r"(?:^|, )(-?\d{1,9}) ([^\s,]+)(?=, |$)")
_REMEDY = "Give a result.nc that this package wrote."


def further_text(variables: Sequence[tuple[str, str, str]]) -> dict[str, str]:
    """The attribute that tells of further variables (name, units, long name); none where there are none."""
    return {FURTHER: "\n".join(map(", ".join, variables))} if variables else {}


def further_variables(attributes: dict[str, Any]) -> dict[str, tuple[str, str]]:
    """Units and long names of further variables, by name."""
    lines = str(attributes.get(FURTHER, "")).splitlines()
    parts = ((*line.split(", ", 2), "", "") for line in lines)
    return {name: (units, long_name) for name, units, long_name, *_ in parts}


def _flags(meanings: str) -> dict[str, Any]:
    """The attributes of a variable of codes, from "0 inside, 3 stick@cylinder"."""
    pairs = _FLAG.findall(meanings)
    return {
        "flag_values": np.array([int(code) for code, _ in pairs], np.int32),
        "flag_meanings": " ".join(word for _, word in pairs),
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
        `fate` alone is int32.
    coordinates : dict
        Cell centres of the grid's axes.
    attributes : dict
        status, seed, steps, wall_seconds (without compiling), compile_seconds, mass_start, ...; further
        variables as `further_text` puts them.
    """

    scene: Scene
    model: str
    scheme: str
    layout: Layout
    times: Floats
    variables: dict[str, Floats]
    coordinates: dict[str, Floats]
    # Any: a number or a text, which the name decides.
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """How it ended: "completed", or "failed: ..." with the reason."""
        return str(self.attributes.get("status", ""))

    @property
    def warnings(self) -> list[str]:
        """Warnings of a run that was completed, as sentences; none if all is well."""
        return str(self.attributes.get("warnings", "")).splitlines()

    def density(self, cells: int = 30) -> Floats:
        """The particles' probability density on cells x cells bins of the domain.

        Particles that have left the flow, or have not come in yet, are in no bin. Each of the others has
        the mass 1/N, with N of them at the start.

        Returns
        -------
        (T, cells, cells) float64, axis order (time, y, x), per unit of area.
        """
        ranges = (self.scene.domain.x, self.scene.domain.y)
        if self.layout == "particles":
            places = zip(self.variables["x"], self.variables["y"], self._frozen(), strict=True)
            part = self.variables["x"][0].size / self._particles_at_start
            return np.array(
                [
                    part * histograms.particle_density(x, y, *ranges, cells, gone)
                    for x, y, gone in places
                ]
            )
        return np.array([histograms.grid_density(d, *ranges, cells) for d in self.cell_density()])

    @property
    def _particles_at_start(self) -> float:
        """How many particles hold a mass of 1."""
        number = float(self.attributes.get("particles_at_start", 0.0))
        return number if number >= 1.0 else float(self.variables["x"][0].size)

    @property
    def frozen(self) -> NDArray[np.bool_] | None:
        """The particles that take no part, (T, R, N), as they have left the flow or have not come in yet.

        None where there can be none.
        """
        marks = self.variables.get(FATE, self.variables.get(FROZEN))
        return None if marks is None else marks != INSIDE

    @property
    def unborn(self) -> NDArray[np.bool_] | None:
        """The particles that an inlet has not fed in yet, (T, R, N); None where there can be none."""
        codes = self.variables.get(FATE)
        return None if codes is None else codes == NOT_YET

    def _frozen(self) -> Sequence[NDArray[np.bool_] | None]:
        """`frozen` of each saved time."""
        gone = self.frozen
        return [None] * self.times.size if gone is None else list(gone)

    def cell_density(self) -> Floats:
        """The density on the grid's own cells, (T, ny, nx), integrated over the angle for q.

        Cells in solids hold 0, not NaN, so that any two densities can be subtracted.
        """
        density = self.variables["density"]
        if self.layout == "q":
            return np.asarray(density.sum(axis=1) * histograms.FULL_TURN / density.shape[1])
        return density

    def angle_distribution(self, bins: int = 60) -> Floats:
        """The probability density of the angle on [0, 2 pi), (T, bins), per radian."""
        if self.layout == "particles":
            angles = zip(self.variables["angle"], self._frozen(), strict=True)
            return np.array([histograms.particle_angles(a, bins, gone) for a, gone in angles])
        if self.layout == "q":
            if self.variables["density"].shape[1] == 1 and not terms_of(self.scene).angle:
                return self._held_angles(bins)
            mass = self.variables["density"].sum(axis=(2, 3))
            total = mass.sum(axis=1, keepdims=True) * histograms.FULL_TURN / mass.shape[1]
            return np.array([histograms.regrid_angles(m, bins) for m in mass / total])
        pairs = zip(self.variables["mean_angle"], self.variables["density"], strict=True)
        return np.array([histograms.field_angles(a, d, bins) for a, d in pairs])

    def _held_angles(self, bins: int) -> Floats:
        """The start angles' distribution, at all times: one cell holds all angles, and nothing turns."""
        start = self.scene.start
        angles = [angle for _, _, angle in start.places()] or [start.own_angle]
        held = histograms.particle_angles(np.array(angles) + start.turns, bins)
        return np.tile(held, (self.times.size, 1))

    def to_dataset(self) -> xr.Dataset:
        """The result as an xarray data set that may be merged with those of other models.

        Grids are as they stand in result.nc. The variables of particles, over (time, realisation,
        particle), are called particle_x, particle_y, particle_angle, particle_velocity_x, ...: there
        they share names with the axes and fields of grids, which xarray would take for the same
        quantity and spread over all axes of both (terabytes).
        """
        data = self._file_dataset()
        if self.layout != "particles":
            return data
        return data.rename_vars({name: f"particle_{name}" for name in self.variables})

    def _file_dataset(self) -> xr.Dataset:
        """With the names of result.nc."""
        import xarray as xr

        dimensions = DIMENSIONS[self.layout]
        data = xr.Dataset(
            {name: (dimensions, values) for name, values in self.variables.items()},
            coords={"time": self.times, **self.coordinates},
            attrs={"scene": self.scene.name, "model": self.model, "scheme": self.scheme}
            | self.attributes,
        )
        described = further_variables(self.attributes) | _DESCRIPTION
        for name in data.variables:
            units, long_name = described[str(name)]
            data[name].attrs = {"units": units, "long_name": long_name}
        if FATE in data:
            data[FATE].attrs |= _flags(str(self.attributes.get("fate_meanings", "")))
        return data

    def save(self, path: Path) -> None:
        """Write result.nc (NetCDF-4) with a checksum behind it, whole or not there.

        Raises
        ------
        WriteError
            If it cannot be written.
        """
        from ellipsoid_coupling.scenes import scene_to_toml

        data = self._file_dataset()
        texts = {name: value for name, value in data.attrs.items() if isinstance(value, str)}
        data.attrs |= {name: shown(text)[: _LONGEST - 1] for name, text in texts.items()}
        data.attrs["scene_toml"] = scene_to_toml(self.scene)
        with whole_file(path) as beside:
            write_netcdf(data, beside)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a result.nc, or the one in a run folder.

        Raises
        ------
        InputError
            If there is none, it is not one of this package, or its parts do not fit together.
        """
        file = Path(path)
        file = file / "result.nc" if is_folder(file) else file
        if not exists(file):
            raise InputError(str(path), "a run folder or a result.nc", "none", "Check the path.")
        stored, where = read_netcdf(file), str(file)
        layout = next((k for k, dims in DIMENSIONS.items() if {*dims} == {*stored.sizes}), None)
        toml = stored.attributes.get("scene_toml")
        if layout is None or not isinstance(toml, str):
            found = "none of the known sets of dimensions" if layout is None else "no scene_toml"
            raise InputError(where, "a result file", found, _REMEDY)
        result = cls._from_stored(stored, scene_from_table(parse_toml(toml, where), where), layout)
        result._check(where, tuple(stored.sizes[name] for name in DIMENSIONS[layout]))
        return result

    @classmethod
    def _from_stored(cls, stored: Stored, scene: Scene, layout: Layout) -> Self:
        arrays, attributes = stored.arrays, stored.attributes
        named = ("scene", "model", "scheme", "scene_toml")
        axes = [k for k in DIMENSIONS[layout] if k != "time" and k in arrays]
        return cls(
            scene=scene,
            model=str(attributes.get("model", "")),
            scheme=str(attributes.get("scheme", "")),
            layout=layout,
            times=np.asarray(arrays.get("time", ()), dtype=np.float64),
            variables={k: v for k, v in arrays.items() if k not in ("time", *axes)},
            coordinates={k: arrays[k] for k in axes},
            attributes={k: v for k, v in attributes.items() if k not in named},
        )

    def _check(self, where: str, shape: tuple[int, ...]) -> None:
        """InputError unless the variables are those of the layout, finite, at the scene's times."""
        count = self.times.size
        if not np.array_equal(self.times, self.scene.times[:count]):
            expected = f"the scene's times {self.scene.times}"
            raise InputError(f"{where}, time", expected, str(self.times), _REMEDY)
        wanted = (*VARIABLES[self.layout], *further_variables(self.attributes))
        if set(self.variables) - set(MARKS[self.layout]) != set(wanted):
            found = ", ".join(sorted(self.variables)) or "none"
            raise InputError(where, f"the variables {', '.join(wanted)}", found, _REMEDY)
        for name, array in self.variables.items():
            wanted_type = np.int32 if name == FATE else np.float64
            if array.shape != shape or array.dtype != wanted_type:
                over = ", ".join(DIMENSIONS[self.layout])
                expected = (
                    f"{np.dtype(wanted_type)} over ({over}) = {shape}, alike for all variables"
                )
                found = f"{array.dtype} {array.shape}"
                raise InputError(f"{where}, {name}", expected, found, _REMEDY)
        axes = {k for k in DIMENSIONS[self.layout] if k in _DESCRIPTION} - {"time"}
        if set(self.coordinates) != axes:
            raise InputError(where, f"numbers for the axes {', '.join(axes)}", "none", _REMEDY)
        for name, array in (self.variables | self.coordinates).items():
            wrong = ~np.isfinite(array)
            if self.unborn is not None and name in self.variables:
                wrong &= ~self.unborn
            if wrong.any():
                raise InputError(
                    f"{where}, {name}{np.argwhere(wrong)[0].tolist()}", "a finite number",
                    "NaN or infinity", _REMEDY,
                )  # fmt: skip
        self._check_attributes(where)

    def _check_attributes(self, where: str) -> None:
        """InputError unless the attributes that the package shows or computes with have their type."""
        attributes = {"model": self.model, "scheme": self.scheme, **self.attributes}
        for name, value in attributes.items():
            is_text, is_number = isinstance(value, str), isinstance(value, int | float)
            if name in _TEXTS and not (is_text and shown(value) == value and len(value) < _LONGEST):
                expected = f"text of at most {_LONGEST} printable characters"
                raise InputError(f"{where}, attribute {name}", expected, repr(value), _REMEDY)
            if name in _NUMBERS and not (is_number and math.isfinite(value)):
                raise InputError(
                    f"{where}, attribute {name}", "a finite number", repr(value), _REMEDY
                )

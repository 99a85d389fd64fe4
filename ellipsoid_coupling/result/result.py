"""The result of a run: the saved times of one model on one scene, and the log of the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, shown
from ellipsoid_coupling.files.netcdf import Stored, read_netcdf, write_netcdf
from ellipsoid_coupling.files.reading import exists, is_folder
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.geometry import flow_map, histograms
from ellipsoid_coupling.geometry.boundaries import box_of_sides
from ellipsoid_coupling.geometry.fate_codes import FIRST_PATCH, INSIDE, NOT_YET
from ellipsoid_coupling.geometry.orientation import order_of, phase_of
from ellipsoid_coupling.result.checks import LONGEST_TEXT, REMEDY, check
from ellipsoid_coupling.result.dataset import NOT_KEPT, derived, empty_cells, file_dataset
from ellipsoid_coupling.result.layouts import DIMENSIONS, FATE, FROZEN, SAMPLES_ACROSS, Layout
from ellipsoid_coupling.result.orientation import mean_wave
from ellipsoid_coupling.scenes import Scene, parse_toml, scene_from_table, terms_of
from ellipsoid_coupling.scenes.summary import Summarised, Summary

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Result(Summarised):
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
        `fate` alone is int32. Where a grid's density is 0 so are all others (NaN in result.nc).
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
        the mass 1/N, with N of them at the start. Samples that started evenly spread and all still move
        (`mckean_vlasov` without noise) tell of what lies between them, too: see `geometry.flow_map`.

        Returns
        -------
        (T, cells, cells) float64, axis order (time, y, x), per unit of area.
        """
        if self.layout == "particles":
            part = self.variables["x"][0].size / self._particles_at_start
            return np.array([part * self._density_at(k, cells) for k in range(self.times.size)])
        ranges = (self.scene.domain.x, self.scene.domain.y)
        return np.array([histograms.grid_density(d, *ranges, cells) for d in self.cell_density()])

    def _density_at(self, k: int, cells: int) -> Floats:
        """Of particles at saved time k."""
        ranges = (self.scene.domain.x, self.scene.domain.y)
        places = self._flow_map(k, "x", "y")
        if places is not None:
            box = box_of_sides(self.scene, "reflect")
            return flow_map.mapped_density(places, ranges, cells, box)
        x, y = self.variables["x"][k], self.variables["y"][k]
        return histograms.particle_density(x, y, *ranges, cells, self._frozen()[k])

    def _flow_map(self, k: int, *names: str) -> Floats | None:
        """Variables at saved time k of samples that started evenly spread, (names, rows, columns).

        None for particles that are counted one by one: others, and where some have left.
        """
        size, across = self.variables["x"][k].size, int(self.attributes.get(SAMPLES_ACROSS, 0))
        gone = self._frozen()[k]
        if across < 1 or size % across or (gone is not None and gone.any()):
            return None
        return np.array([self.variables[name][k].reshape(-1, across) for name in names])

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

    @property
    def ended(self) -> NDArray[np.bool_]:
        """The particles that have ended at a patch, (T, R, N)."""
        codes = self.variables.get(FATE)
        return np.zeros(self.variables["x"].shape, bool) if codes is None else codes >= FIRST_PATCH

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
        """The probability density of the angle on [0, 2 pi), (T, bins), per radian.

        Evenly spread samples count as in `density`.
        """
        if self.layout == "particles":
            return np.array([self._angles_at(k, bins) for k in range(self.times.size)])
        if self.layout == "q":
            if self.holds_all_angles:
                held = histograms.particle_angles(self.held_angles(), bins)
                return np.tile(held, (self.times.size, 1))
            mass = self.variables["density"].sum(axis=(2, 3))
            total = mass.sum(axis=1, keepdims=True) * histograms.FULL_TURN / mass.shape[1]
            return np.array([histograms.regrid_angles(m, bins) for m in mass / total])
        pairs = zip(self.variables["mean_angle"], self.variables["density"], strict=True)
        return np.array([histograms.field_angles(a, d, bins) for a, d in pairs])

    def _angles_at(self, k: int, bins: int) -> Floats:
        """Of particles at saved time k."""
        angles = self._flow_map(k, "angle")
        if angles is not None:
            return flow_map.mapped_angles(angles[0], bins)
        return histograms.particle_angles(self.variables["angle"][k], bins, self._frozen()[k])

    @property
    def holds_all_angles(self) -> bool:
        """Whether the one angle cell of a q-grid stands for all angles, as nothing turns."""
        one = self.layout == "q" and self.variables["density"].shape[1] == 1
        return one and not terms_of(self.scene).angle

    def held_angles(self) -> Floats:
        """The start's angles, (n,), radian: all the time those of a result that `holds_all_angles`."""
        start = self.scene.start
        angles = [angle for _, _, angle in start.places()] or [start.own_angle]
        return np.array(angles) + start.turns

    def order_parameter(self, cells: int | None = None) -> Floats:
        """How parallel the main axes are: S = abs(<e^{2 i theta}>).

        1 where all are parallel, 0 where no axis is preferred; of n particles whose angles are chance S
        is about (pi/(4n))^(1/2). Of `rho` results each cell has one angle: S is that of the angles of the
        cells in a bin, weighted with their mass.

        Parameters
        ----------
        cells : int, optional
            Bins each way, those of `density`.

        Returns
        -------
        (T,) float64 over the whole domain, or (T, cells, cells) bin by bin, axis order (time, y, x); NaN
        where there is no mass.
        """
        return order_of(mean_wave(self, 2, cells))

    def director(self, cells: int | None = None) -> Floats:
        """The mean axis, arg(<e^{2 i theta}>)/2 in [0, pi), radian; an axis has no head.

        Says little where `order_parameter` is near 0. Parameters and shapes as there.
        """
        return phase_of(mean_wave(self, 2, cells), 2)

    def mean_angle(self, cells: int | None = None) -> Floats:
        """The mean direction, arg(<e^{i theta}>) in [0, 2 pi), radian; opposite directions cancel.

        Parameters and shapes as in `order_parameter`.
        """
        return phase_of(mean_wave(self, 1, cells), 1)

    def plot(self, time: int = -1, *, path: str | Path | None = None) -> Figure:
        """Density and angle distribution at one saved time.

        Parameters
        ----------
        time : int
            Which of the saved times; -1 is the last one.
        path : path, optional
            A PNG that is written too.
        """
        # By name: figures stand above results, and matplotlib is loaded when it is needed.
        draw = import_module("ellipsoid_coupling.output.figures.at_a_glance").result_at_a_glance
        return cast("Figure", draw(self, time, path))

    def _summary(self) -> Summary:
        told = self.attributes
        shape = next(iter(self.variables.values())).shape
        sizes = zip(DIMENSIONS[self.layout], shape, strict=True)
        rows = [
            ("", self.status),
            ("scheme", self.scheme),
            ("times", ", ".join(f"{time:g}" for time in self.times[:6]) + " ..." * (shape[0] > 6)),
            ("over", ", ".join(f"{name} {size}" for name, size in sizes)),
            ("resolution", str(told.get("resolution", ""))),
            ("seed", str(told.get("seed", ""))),
            ("steps", f"{told['steps']:g}" if "steps" in told else ""),
            ("seconds", f"{float(told.get('wall_seconds', 0.0)):.3g}"),
            *(("warning", line) for line in self.warnings),
        ]
        head = f"Result of {self.model} on {self.scene.name}"
        return Summary(head, [(name, text) for name, text in rows if text])

    def to_dataset(self) -> xr.Dataset:
        """The result as an xarray data set that may be merged with those of other models.

        Grids are as they stand in result.nc. The variables of particles, over (time, realisation,
        particle), are called particle_x, particle_y, particle_angle, particle_velocity_x, ...: there
        they share names with the axes and fields of grids, which xarray would take for the same
        quantity and spread over all axes of both (terabytes).
        """
        data = file_dataset(self)
        if self.layout == "particles":
            return data.rename_vars({name: f"particle_{name}" for name in self.variables})
        empty = empty_cells(self)
        if empty is not None:
            for name in derived(self):
                data[name] = data[name].where(~empty)
        return data

    def save(self, path: Path) -> None:
        """Write result.nc (NetCDF-4) with a checksum behind it, whole or not there.

        Raises
        ------
        WriteError
            If it cannot be written.
        """
        data = file_dataset(self)
        texts = {name: value for name, value in data.attrs.items() if isinstance(value, str)}
        data.attrs |= {name: shown(text)[: LONGEST_TEXT - 1] for name, text in texts.items()}
        data.attrs["scene_toml"] = self.scene.to_toml()
        empty = empty_cells(self)
        if empty is not None or self.unborn is not None:
            for name in derived(self):
                data.variables[name].attrs["_FillValue"] = np.nan
        with whole_file(path) as beside:
            write_netcdf(data, beside, empty)

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
            raise InputError(where, "a result file", found, REMEDY)
        result = cls._from_stored(stored, scene_from_table(parse_toml(toml, where), where), layout)
        check(result, where, tuple(stored.sizes[name] for name in DIMENSIONS[layout]))
        return result

    @classmethod
    def _from_stored(cls, stored: Stored, scene: Scene, layout: Layout) -> Self:
        arrays, attributes = stored.arrays, stored.attributes
        axes = [k for k in DIMENSIONS[layout] if k != "time" and k in arrays]
        variables = {k: v for k, v in arrays.items() if k not in ("time", *axes)}
        if layout != "particles" and "density" in variables:
            _fill_empty(variables)
        return cls(
            scene=scene,
            # As they stand there: whether they are texts is checked later.
            model=attributes.get("model", ""),
            scheme=attributes.get("scheme", ""),
            layout=layout,
            times=np.asarray(arrays.get("time", ()), dtype=np.float64),
            variables=variables,
            # Particles are numbered, which needs no coordinates.
            coordinates={} if layout == "particles" else {k: arrays[k] for k in axes},
            attributes={k: v for k, v in attributes.items() if k not in NOT_KEPT},
        )


# Any: of whatever type the file has, which is checked later.
def _fill_empty(variables: dict[str, NDArray[Any]]) -> None:
    """Write 0 in cells of density 0, where the file has NaN: a product with the density is then 0."""
    empty = variables["density"] == 0.0
    for name, values in variables.items():
        if name != "density" and values.shape == empty.shape and values.dtype == np.float64:
            values[empty & np.isnan(values)] = 0.0

"""A result as an xarray data set by the CF conventions, under the names of result.nc."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.files import cf
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.result.layouts import DIMENSIONS, FATE, further_variables

if TYPE_CHECKING:
    import xarray as xr

    from ellipsoid_coupling.result.result import Result

# Attributes that say what stands elsewhere in a `Result`, or is the same for all of them.
NOT_KEPT = (
    "scene", "model", "scheme", "scene_toml", "Conventions", "title", "source", "references",
)  # fmt: skip
# A code of `fate` and its meaning, in a list.
_FLAG = re.compile(r"(?:^|, )(-?\d{1,9}) ([^\s,]+)(?=, |$)")


def file_dataset(result: Result) -> xr.Dataset:
    """Variables as they are in memory; empty cells are not yet NaN, see `empty_cells`."""
    import xarray as xr

    dimensions = DIMENSIONS[result.layout]
    data = xr.Dataset(
        {name: (dimensions, values) for name, values in result.variables.items()},
        coords={"time": result.times, **_numbers(result), **result.coordinates},
        attrs=_whole(result) | result.attributes,
    )
    further = further_variables(result.attributes)
    for key, variable in data.variables.items():
        name = str(key)
        if name in further:
            described = dict(zip(("units", "long_name"), further[name], strict=True))
        else:
            si = result.scene.units == "SI"
            described = cf.attributes_of(name, tuple(map(str, variable.dims)), si=si)
        # Of the variable itself: a DataArray around it takes ten times as long to make.
        variable.attrs |= described
    if FATE in data.variables:
        data.variables[FATE].attrs |= _flags(str(result.attributes.get("fate_meanings", "")))
    return data


def _whole(result: Result) -> dict[str, str]:
    """Attributes of the whole file."""
    scene = result.scene
    return {
        "Conventions": cf.CONVENTIONS,
        "title": scene.title or scene.name,
        "source": f"ellipsoid_coupling {version('ellipsoid_coupling')}, model {result.model}",
        "references": cf.REFERENCES,
        "scene": scene.name,
        "model": result.model,
        "scheme": result.scheme,
    }


def _numbers(result: Result) -> dict[str, NDArray[np.int32]]:
    """The numbers of realisations, in the whole run if this is a part of one, and of particles."""
    if result.layout != "particles":
        return {}
    _, realisations, particles = result.variables["x"].shape
    first = int(result.attributes.get("first_realisation", 0))
    return {
        "realisation": np.arange(first, first + realisations, dtype=np.int32),
        "particle": np.arange(particles, dtype=np.int32),
    }


def empty_cells(result: Result) -> NDArray[np.bool_] | None:
    """Where a grid's density is 0, so that nothing has a velocity or an angle; None where nowhere."""
    if result.layout == "particles":
        return None
    empty = result.variables["density"] == 0.0
    return empty if empty.any() else None


def derived(result: Result) -> list[str]:
    """The names of the variables that empty cells do not have."""
    return [name for name in result.variables if name not in ("density", FATE)]


# Any: texts and arrays of whole numbers.
def _flags(meanings: str) -> dict[str, Any]:
    """The attributes of a variable of codes, from "0 inside, 3 stick@cylinder"."""
    pairs = _FLAG.findall(meanings)
    return {
        "flag_values": np.array([int(code) for code, _ in pairs], np.int32),
        "flag_meanings": " ".join(word for _, word in pairs),
    }

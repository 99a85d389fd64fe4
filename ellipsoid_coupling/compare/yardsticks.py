"""Stored yardsticks: the bins of solutions that take minutes, how far they may be off, and their origin.

`workflows/yardsticks.py` makes them, one file a scene. A file belongs to a digest of all that the limit of
infinite N depends on besides the fluid: the scene without its numerics and without what it is called. It
holds the fluid's velocity at some points, and serves for a flow that has the same there, but for what
solvers differ by. A scene without such a file has its reference computed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.distances import ANGLE_BINS, DENSITY_CELLS, Errors
from ellipsoid_coupling.compare.error_budget import MOST_GROUPS, Bins
from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.limits import MOST_YARDSTICK_BYTES
from ellipsoid_coupling.files.reading import Arrays, read_arrays
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow import FlowField, FlowSeries
from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

FOLDER = Path(__file__).parent / "stored_yardsticks"

_EXPECTED = "a yardstick"
_REMEDY = "Remove it, or make it again with workflows/yardsticks.py."
_NUMBERS = ("density", "angle", "density_error", "angle_error", "times", "samples", "fluid")
_TEXTS = ("model", "origin")
# Masses are kept in single precision and sum to 1, or less where some have left.
_ROUNDING = 1e-5
# Points along a side of the domain where flows are compared, and how far they may differ, as a part of the
# largest velocity. Two runs of a solver differ by 1e-11; a start that is off by 1e-6 moves bins by 1e-4.
_POINTS, _SAME_FLUID = 16, 1e-5


class Yardstick(NamedTuple):
    """A solution on the common bins.

    model : the model that was refined
    times : (T,) float64
    bins : Bins; several groups where samples are random
    error : how far density and angle may be off at each saved time, L1
    fluid : the velocity at even points of the domain, see `fluid_velocity`
    origin : one line: version, resolution, and what the error is
    """

    model: str
    times: Floats
    bins: Bins
    error: Errors
    fluid: Floats
    origin: str


def scene_digest(scene: Scene) -> str:
    """What tells two limits apart, but for the fluid: 16 hexadecimal digits.

    The number of particles counts where there are walls, whose ghosts are so many times weaker. Keys that
    have their default do not, so that keys to come change no digest.
    """
    table = scene.model_dump(mode="json", exclude_defaults=True)
    particles = table["particles"]
    particles.pop("realisations", None)
    if scene.walls is None:
        particles.pop("number", None)
    if scene.flow is not None:
        table["flow"] = [scene.flow.drag, scene.flow.angular_drag]
    for name in ("name", "title", "numerics"):
        table.pop(name, None)
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()[:16]


def yardstick_path(scene: Scene) -> Path:
    """Where a built-in scene's yardstick is, or would be."""
    return FOLDER / f"{scene.name}-{scene_digest(scene)}.npz"


def fluid_velocity(scene: Scene, flow: FlowField | None) -> Floats:
    """The velocity at 16 x 16 even points of the domain, (2, 16, 16); (2, 0, 0) without a fluid."""
    if flow is None:
        return np.empty((2, 0, 0))
    fluid = flow.continued(*even_points(scene.domain.x, scene.domain.y, _POINTS, _POINTS))
    return np.array([fluid.velocity_x, fluid.velocity_y])


def find_yardstick(scene: Scene, flow: FlowField | None) -> Yardstick | None:
    """The stored yardstick of a scene in a flow of one time; None where there is none.

    Raises
    ------
    InputError
        For a file of that digest that is no yardstick.
    """
    if isinstance(flow, FlowSeries):
        return None
    for path in sorted(FOLDER.glob(f"*-{scene_digest(scene)}.npz")):
        found = load_yardstick(path)
        if not np.array_equal(found.times, scene.times):
            raise _wrong(path, "the scene's times", str(found.times))
        if _is_same(found.fluid, fluid_velocity(scene, flow)):
            return found
    return None


def _is_same(one: Floats, other: Floats) -> bool:
    allowed = _SAME_FLUID * np.abs(other).max(initial=0.0)
    return one.shape == other.shape and bool((np.abs(one - other) <= allowed).all())


def save_yardstick(path: Path, yardstick: Yardstick) -> None:
    """Write it, whole or not at all; the bins in single precision.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    bins, error = yardstick.bins, yardstick.error
    arrays: Arrays = {
        "density": bins.density.astype(np.float32),
        "angle": bins.angle.astype(np.float32),
        "density_error": error.density,
        "angle_error": error.angle,
        "times": yardstick.times,
        "samples": np.array(float(bins.samples)),
        "fluid": yardstick.fluid,
        "model": np.array(yardstick.model),
        "origin": np.array(yardstick.origin),
    }
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def load_yardstick(path: Path) -> Yardstick:
    """Read what `save_yardstick` wrote.

    Raises
    ------
    InputError
        For a file that is damaged or something else.
    """
    names = (*_NUMBERS, *_TEXTS)
    file = read_arrays(path, _EXPECTED, MOST_YARDSTICK_BYTES, len(names))
    if set(file) != set(names):
        raise _wrong(path, f"the arrays {', '.join(names)}", ", ".join(sorted(file)) or "none")
    for problem in _problems(file):
        raise _wrong(path, *problem)
    model, origin = (readable(str(file[name])) for name in _TEXTS)
    numbers = {name: file[name].astype(np.float64) for name in _NUMBERS}
    bins = Bins(numbers["density"], numbers["angle"], int(numbers["samples"]))
    error = Errors(numbers["density_error"], numbers["angle_error"])
    return Yardstick(model, numbers["times"], bins, error, numbers["fluid"], origin)


def _wrong(path: Path, expected: str, found: str) -> InputError:
    return InputError(str(path), f"{_EXPECTED} with {expected}", found, _REMEDY)


def _problems(file: Arrays) -> Iterator[tuple[str, str]]:
    """What is expected and what is there, of arrays that no yardstick has."""
    for name in _NUMBERS:
        if file[name].dtype.str not in ("<f4", "<f8") or not np.isfinite(file[name]).all():
            yield f"finite numbers in {name}", f"{file[name].dtype}"
            return
    for name in _TEXTS:
        if file[name].dtype.kind != "U" or file[name].shape != ():
            yield f"a text in {name}", f"{file[name].dtype} {file[name].shape}"
            return
    groups, count = (*file["density"].shape, 0, 0)[:2]
    shapes = {
        "density": (groups, count, DENSITY_CELLS**2),
        "angle": (groups, count, ANGLE_BINS),
        "density_error": (count,),
        "angle_error": (count,),
        "times": (count,),
        "samples": (),
        "fluid": (2, *2 * ((_POINTS,) if file["fluid"].size else (0,))),
    }
    for name, shape in shapes.items():
        if file[name].shape != shape or not 1 <= groups <= MOST_GROUPS or count < 1:
            yield f"{name} of shape {shape}", str(file[name].shape)
            return
    for name in ("density", "angle"):
        mass = file[name].astype(np.float64).sum(axis=-1)
        if file[name].min() < 0.0 or mass.max() > 1.0 + _ROUNDING:
            yield f"masses in {name}, 0 or more and 1 in all at most", f"a sum of {mass.max():g}"
            return
    if min(file[name].min() for name in ("density_error", "angle_error", "samples")) < 0.0:
        yield "errors and a number of samples from 0 on", "less"

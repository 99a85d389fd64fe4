"""Whether what was read from a result file is a result: its variables, axes and attributes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ellipsoid_coupling.errors import InputError, shown
from ellipsoid_coupling.files.limits import LARGEST_NUMBER
from ellipsoid_coupling.result.layouts import (
    DIMENSIONS,
    END_TIME,
    FATE,
    FURTHER,
    MARKS,
    SAMPLES_ACROSS,
    VARIABLES,
    further_variables,
)

if TYPE_CHECKING:
    from ellipsoid_coupling.result.result import Result

REMEDY = "Give a result.nc that this package wrote."
LONGEST_TEXT = 10_000
# How far a density may be below 0, of its largest, and an axis off, of its length.
_ROUNDING, _UNEVEN = 1e-9, 2e-6

# Attributes that the package shows, and those that it counts with; others may be anything.
_TEXTS = (
    "model", "scheme", "status", "warnings", "resolution", "flow", "flow_digest", "package_version",
    "step_limits", "fates", "fate_meanings", "mass_left_by_patch", FURTHER,
)  # fmt: skip
_NUMBERS = (
    "seed", "steps", "rejected_steps", "mass_start", "mass_end", "mass_left", "wall_seconds",
    "compile_seconds", "particles_outside_flow", "particles_at_start", "mass_came_in",
    "first_realisation", SAMPLES_ACROSS,
)  # fmt: skip


def check(result: Result, where: str, shape: tuple[int, ...]) -> None:
    """InputError unless the variables are those of the layout, finite, at the scene's times."""
    count = result.times.size
    if not np.array_equal(result.times, result.scene.times[:count]):
        expected = f"the scene's times {result.scene.times}"
        raise InputError(f"{where}, time", expected, str(result.times), REMEDY)
    wanted = (*VARIABLES[result.layout], *further_variables(result.attributes))
    if set(result.variables) - set(MARKS[result.layout]) != set(wanted):
        found = ", ".join(sorted(result.variables)) or "none"
        raise InputError(where, f"the variables {', '.join(wanted)}", found, REMEDY)
    for name, array in result.variables.items():
        wanted_type = np.int32 if name == FATE else np.float64
        if array.shape != shape or array.dtype != wanted_type:
            over = ", ".join(DIMENSIONS[result.layout])
            expected = f"{np.dtype(wanted_type)} over ({over}) = {shape}, alike for all variables"
            found = f"{array.dtype} {array.shape}"
            raise InputError(f"{where}, {name}", expected, found, REMEDY)
    axes = set() if result.layout == "particles" else {*DIMENSIONS[result.layout]} - {"time"}
    if set(result.coordinates) != axes:
        raise InputError(where, f"numbers for the axes {', '.join(axes)}", "none", REMEDY)
    for name, array in (result.variables | result.coordinates).items():
        wrong = ~np.isfinite(array)
        if result.unborn is not None and name in result.variables:
            wrong &= ~result.unborn
        if name == END_TIME:
            wrong &= result.ended
        if wrong.any():
            raise InputError(
                f"{where}, {name}{np.argwhere(wrong)[0].tolist()}", "a finite number",
                "NaN or infinity", REMEDY,
            )  # fmt: skip
    _check_sizes(result, where)
    _check_axes(result, where)
    _check_attributes(result, where)


def _check_sizes(result: Result, where: str) -> None:
    """InputError for a negative density, or numbers that leave double precision when multiplied."""
    domain = result.scene.domain
    for name, array in result.variables.items():
        is_density = name == "density" and result.layout != "particles"
        # A density is small where the domain is large: what is within bounds is its mass.
        most = LARGEST_NUMBER / (domain.width * domain.height if is_density else 1.0)
        wrong = np.abs(array) > most
        expected = f"a number of at most {most:g}"
        if is_density and not wrong.any():
            wrong = array < -_ROUNDING * array.max(initial=0.0)
            expected = "a density that is not negative"
        if wrong.any():
            place = tuple(np.argwhere(wrong)[0].tolist())
            raise InputError(f"{where}, {name}{[*place]}", expected, f"{array[place]:g}", REMEDY)


def _check_axes(result: Result, where: str) -> None:
    """InputError unless the axes of a grid are centres of equal cells: of the domain, of a whole turn.

    How many cells is the model's own choice.
    """
    domain = result.scene.domain
    for name, found in result.coordinates.items():
        if name == "angle":
            low, width, shift = 0.0, 2.0 * np.pi, 0.0
        else:
            low, high = domain.x if name == "x" else domain.y
            width, shift = high - low, 0.5
        expected = low + width * (np.arange(found.size) + shift) / found.size
        # A cell's width may divide the domain to some rounding only, see `scene_grid`.
        if not np.allclose(found, expected, rtol=1e-12, atol=_UNEVEN * width):
            told = f"the centres of {found.size} equal cells from {low:g} to {low + width:g}"
            raise InputError(f"{where}, {name}", told, "other numbers", REMEDY)


def _check_attributes(result: Result, where: str) -> None:
    """InputError unless the attributes that the package shows or computes with have their type."""
    attributes = {"model": result.model, "scheme": result.scheme, **result.attributes}
    for name, value in attributes.items():
        is_text, is_number = isinstance(value, str), isinstance(value, int | float)
        fits = is_text and shown(value) == value and len(value) < LONGEST_TEXT
        if name in _TEXTS and not fits:
            expected = f"text of at most {LONGEST_TEXT} printable characters"
            raise InputError(f"{where}, attribute {name}", expected, repr(value), REMEDY)
        if name in _NUMBERS and not (is_number and math.isfinite(value)):
            raise InputError(f"{where}, attribute {name}", "a finite number", repr(value), REMEDY)

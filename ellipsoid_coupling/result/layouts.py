"""The layouts of results: dimensions and variables of particles and grids, and what models add."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

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
# And when the particle ended, NaN before.
END_TIME = "end_time"
MARKS: dict[Layout, tuple[str, ...]] = {"particles": (FROZEN, FATE, END_TIME), "q": (), "rho": ()}

# The attribute of samples that started at the midpoints of equal parts of a box, row by row: columns.
SAMPLES_ACROSS = "samples_across"

# The attribute that tells of further variables, those of a model from outside: a line each, "name, units,
# long name".
FURTHER = "further_variables"


def further_text(variables: Sequence[tuple[str, str, str]]) -> dict[str, str]:
    """The attribute that tells of further variables (name, units, long name); none where there are none."""
    return {FURTHER: "\n".join(map(", ".join, variables))} if variables else {}


def further_variables(attributes: dict[str, Any]) -> dict[str, tuple[str, str]]:
    """Units and long names of further variables, by name."""
    lines = str(attributes.get(FURTHER, "")).splitlines()
    parts = ((*line.split(", ", 2), "", "") for line in lines)
    return {name: (units, long_name) for name, units, long_name, *_ in parts}

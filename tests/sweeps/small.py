"""A small sweep for the tests of this folder: all of them use the same kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import ellipsoid_coupling as ec
from ellipsoid_coupling.sweeps import Sweep, scene_table
from ellipsoid_coupling.sweeps.description import checked_lists

# Particles in a trap, with noise, that do not feel one another.
SETTINGS: dict[str, Any] = {
    "interaction": None,
    "particles.number": 10,
    "particles.realisations": 2,
    "times": [0.05, 0.1],
}
ON_COMMAND_LINE = [
    "interaction=none", "particles.number=10", "particles.realisations=2", "times=[0.05, 0.1]",
]  # fmt: skip
MODEL = "microscopic"


def small_scene(**settings: Any) -> ec.Scene:
    return ec.load_scene("stationary", SETTINGS | settings)


def small_sweep(swept: Mapping[str, Sequence[str]] | None = None, **lists: Any) -> Sweep:
    """A sweep over `swept`, texts by key; `lists` are further entries of sweep.toml."""
    swept = swept or {}
    table = {"models": [MODEL], "keys": list(swept), "values": [list(v) for v in swept.values()]}
    return Sweep(checked_lists(table | lists, "sweep"), scene_table(small_scene()))


def same_variables(one: ec.Result, other: ec.Result) -> bool:
    """Whether all variables of two results have the same bits."""
    return set(one.variables) == set(other.variables) and all(
        one.variables[name].tobytes() == other.variables[name].tobytes() for name in one.variables
    )


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}

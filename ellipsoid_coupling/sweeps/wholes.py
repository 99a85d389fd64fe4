"""Runs whose realisations were split among points: put together, they are the bits of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import resolution_text, scheme_named
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.simulation import checked_setup, identity
from ellipsoid_coupling.storage.run_folder import RunFolder
from ellipsoid_coupling.storage.start_file import earlier_state, keep_start

# How the counts of the pieces add up; what is not here (what limited the steps) is the pieces' own.
_LARGEST = ("steps", "longest_step")
_SUMS = (
    "rejected_steps", "particles_outside_flow", "particles_at_start", "wall_seconds", "compile_seconds",
)  # fmt: skip
_MEANS = ("mass_start", "mass_end", "mass_left")
_ALIKE = (
    "status", "seed", "flow", "flow_digest", "package_version", "further_variables", "fate_meanings",
    "first_realisation",  # the first piece's
)  # fmt: skip


def join(pieces: Sequence[Result]) -> Result:
    """The result of all realisations from those of the pieces, in the order of their numbers.

    The variables have the bits of one run of all of them.
    """
    first = pieces[0]
    variables = {
        name: np.concatenate([piece.variables[name] for piece in pieces], axis=1)
        for name in first.variables
    }
    realisations = variables["x"].shape[1]
    text = resolution_text(first.model, first.scheme, first.scene, realisations)
    attributes = _attributes(pieces) | {"resolution": text}
    return replace(first, variables=variables, attributes=attributes)


def _attributes(pieces: Sequence[Result]) -> dict[str, Any]:
    told = [piece.attributes for piece in pieces]
    counts = [piece.variables["x"].shape[1] for piece in pieces]
    joined: dict[str, Any] = {name: told[0][name] for name in _ALIKE if name in told[0]}
    for names, how in ((_LARGEST, max), (_SUMS, sum)):
        joined |= {name: how(one[name] for one in told) for name in names if name in told[0]}
    for name in _MEANS:
        joined[name] = float(np.average([one[name] for one in told], weights=counts))
    shortest = [one for one in told if "shortest_step" in one]
    if shortest:
        least = min(shortest, key=lambda one: float(one["shortest_step"]))
        joined |= {name: least[name] for name in ("shortest_step", "shortest_step_time")}
    warnings = dict.fromkeys(line for piece in pieces for line in piece.warnings)
    return joined | ({"warnings": "\n".join(warnings)} if warnings else {})


def keep(whole: Result, numbers: range, flow: FlowField | None, path: Path) -> None:
    """Write an ordinary run folder of the whole run; one that is there already is made anew.

    Raises
    ------
    WriteError, InputError
        As `RunFolder`.
    """
    scheme, seed = scheme_named(whole.scheme).name, int(whole.attributes["seed"])
    setup = checked_setup(whole.scene, whole.model, scheme, seed, numbers)
    setup = replace(setup, flow=flow, earlier=earlier_state(whole.scene))
    folder = RunFolder(path, force=True)
    with folder.claimed(*identity(whole.model, setup), flow):
        keep_start(whole.scene, folder)
        whole.save(folder.result)

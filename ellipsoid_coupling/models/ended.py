"""What a run of particles says of those that ended at patches or came in: counts, masses and meanings."""

from __future__ import annotations

import re

import numpy as np

from ellipsoid_coupling.geometry.edge_grid import ENDS
from ellipsoid_coupling.geometry.fate_codes import FIRST_PATCH, INSIDE, NOT_YET
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges
from ellipsoid_coupling.models.base import Counts, listed
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.fates import Fates


def counts_by_boundary(fates: Fates, edges: FluidEdges) -> dict[str, int]:
    """How many particles have ended at each boundary where they can, by name."""
    ending = np.unique(edges.grid.patches[edges.grid.acts == ENDS])
    ended = np.bincount(fates.code[fates.code >= FIRST_PATCH] - FIRST_PATCH, minlength=1)
    padded = np.zeros(len(edges.names), np.int64)
    padded[: len(ended)] = ended
    return {edges.names[p]: int(padded[p]) for p in ending}


def meanings(edges: FluidEdges) -> str:
    """The codes of `Fates` that can occur and what each means, such as "0 inside, 3 stick@cylinder"."""
    ending = np.unique(edges.grid.patches[edges.grid.acts == ENDS])
    words = [(NOT_YET, "not_yet"), (INSIDE, "inside")]
    words += [(FIRST_PATCH + int(p), f"{edges.parts[p].kind}@{edges.names[p]}") for p in ending]
    # As the conventions of NetCDF files allow.
    return ", ".join(f"{code} {re.sub(r'[^A-Za-z0-9_.+@-]', '_', word)}" for code, word in words)


def count_inside(fates: Fates) -> int:
    """How many particles are in the fluid."""
    return int(np.count_nonzero(fates.code == INSIDE))


def fate_log(fates: Fates, births: Births | None, edges: FluidEdges, start: int) -> Counts:
    """Attributes of a result whose particles can end, or come in.

    start : how many particles there were at the start, which hold a mass of 1
    """
    ended = counts_by_boundary(fates, edges)
    came_in = 0 if births is None else int(births.born.sum())
    inside, out = count_inside(fates), sum(ended.values())
    return {
        "mass_start": 1.0,
        "mass_end": inside / start,
        "mass_left": (out - came_in) / start,
        "mass_came_in": came_in / start,
        "mass_left_by_patch": listed({name: count / start for name, count in ended.items()}),
        "particles_at_start": float(start),
        "fates": listed(ended | {"inside": inside}),
        "fate_meanings": meanings(edges),
    }

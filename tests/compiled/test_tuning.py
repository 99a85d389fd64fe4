"""No bit of a result depends on a number of the first part of `tuning`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

# Sweeps of both kinds, integrals on both grids, the crossing, what monitors look at.
PROGRAM = """
import hashlib, sys
from ellipsoid_coupling.compiled import tuning
if sys.argv[1] == "changed":
    tuning.SPINS = 100
    tuning.TASKS_PER_THREAD, tuning.MOST_TASKS_AT_ONCE = 3, 2
    tuning.ROW_TASKS, tuning.CELLS_PER_THREAD = 7, 10
    tuning.CACHE_LINES_AT_ONCE, tuning.LINES_AHEAD, tuning.FAR_CELLS = 5, 16, 1
    tuning.WIDE_BUNDLE, tuning.NARROW_BUNDLE, tuning.MANY_LINES = 16, 8, 3
    tuning.SUM_ROWS, tuning.SUM_LINES = 2, 1
    tuning.KY_AT_ONCE, tuning.TRANSFORM_NUMBERS, tuning.SERIES_TASKS = 5, 500, 3
    tuning.SAMPLES_AT_ONCE, tuning.SAMPLE_PARTS = 5, 3
    tuning.LEAST_SORTED, tuning.LEAST_INTERPOLATED = 30, 30
import numpy as np
from ellipsoid_coupling.finite_volume import q_grid
from ellipsoid_coupling.finite_volume.crossing import largest_compression
from ellipsoid_coupling.finite_volume.diagnostics import survey_cells
from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force
from ellipsoid_coupling.finite_volume.sweep import Runs, bundle_width, sweep_runs
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.interaction.q_grid import AngleGridInteraction
from ellipsoid_coupling.interaction.select import choose_interaction
from ellipsoid_coupling.physics.potential import potential_shape

def tell(name, *arrays):
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    print(name, digest.hexdigest())

rng, shape = np.random.default_rng(0), potential_shape(0.1, 0.05)
start = np.zeros((4, 4 + 8, 4 + 20, 4 + 37))
inner = q_grid.inside(start)
inner[0] = rng.random(inner[0].shape)
inner[1:] = 0.3 * rng.standard_normal(inner[1:].shape) * inner[0]
padded = start.shape[1:]
index = np.arange(start[0].size).reshape(padded)[2:-2, 2:-2, 2:-2]
for flux in (Force(0.5), Ballistic((0.05, 0.1, 0.1, 0.1))):
    fields = start.reshape(4, -1).copy()
    ends = index[:, :, 0].ravel()
    sweep_runs(flux, fields, Runs(ends, np.full(ends.size, 37), np.ones(ends.size, int)), 1, 1, 0.3)
    bundle = bundle_width(37, 8)
    first = index[:, 0, ::bundle]
    width = np.broadcast_to(np.minimum(bundle, 37 - np.arange(0, 37, bundle)), first.shape)
    runs = Runs(first.ravel(), np.full(first.size, 20), width.ravel().copy())
    sweep_runs(flux, fields, runs, padded[2], 2, 0.3)
    first = index[0, :, ::bundle]
    width = np.broadcast_to(np.minimum(bundle, 37 - np.arange(0, 37, bundle)), first.shape)
    runs = Runs(first.ravel(), np.full(first.size, 8), width.ravel().copy())
    plane = padded[1] * padded[2]
    sweep_runs(flux, fields, runs, plane, 3, 0.3, (int(index[0, 0, 0]), 8 * plane))
    tell(type(flux).__name__, fields)
fields = fields.reshape(start.shape)
tell("crossing and survey", [largest_compression(fields, 0.1)], survey_cells(fields)[1])
forces = AngleGridInteraction((8, 20, 37), 0.02, shape, 1.0).forces(q_grid.inside(start)[0])
tell("q integral", *forces)
forces = choose_interaction((50, 60), 0.02, shape, 1.0, 5e-3, "harmonics")(
    rng.random((50, 60)), rng.random((50, 60)))
tell("rho integral", *forces)
place = rng.random((1, 3, 400))
force = np.zeros_like(place)
square = Region((0.0, 1.0), (0.0, 1.0))
SampleInteraction(square, shape, 0.05, 1.0, 2e-2).add_forces(place, (1.0, 1.0), force)
tell("samples", force)
"""


def digests(which: str, cache: Path) -> str:
    """What the program tells, in a process with an empty cache: kernels hold the numbers."""
    environment = os.environ | {"ELLIPSOID_CACHE": str(cache)}
    command = [sys.executable, "-c", PROGRAM, which]
    return subprocess.run(
        command, env=environment, check=True, capture_output=True, text=True, timeout=3600.0
    ).stdout


@pytest.mark.heavy
def test_tuned_numbers_change_no_bit(tmp_path: Path) -> None:
    """All of them changed at once, to values that take every other way through the loops."""
    found = [digests(which, tmp_path / which) for which in ("as it is", "changed")]
    assert len(found[0].splitlines()) == 6
    assert found[0] == found[1]

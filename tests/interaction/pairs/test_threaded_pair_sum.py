"""The pair sum on all threads against the one on one thread, and its bits on 1, 2 and 4 threads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.interaction.pairs.cells import cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.interaction.pairs.threaded_pair_sum import LargeCloud, row_blocks
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.physics.angular import Sine
from ellipsoid_coupling.physics.drift import External, Fluid
from ellipsoid_coupling.physics.outer import Harmonic
from ellipsoid_coupling.physics.potential import potential_shape

Floats = NDArray[np.float64]
NUMBER = 12000


def places(seed: int = 0) -> Floats:
    """Uneven in y, so that blocks differ in rows, and a few beyond the cells: (3, N)."""
    place = np.random.default_rng(seed).random((3, NUMBER))
    place[1] = 1.1 * place[1] ** 2 - 0.05
    place[2] *= 2.0 * np.pi
    return place


def pairs_of(width: float, ghosts: bool) -> Pairs:
    shape = potential_shape(0.02, width)
    grid = cell_grid((0.0, 1.0), (0.0, 1.0), shape.reach)
    torque = None if width == 0.02 else 30.0
    pairs = Pairs(grid, shape, 0.2, torque, None, 0.0)
    if not ghosts:
        return pairs
    along, zeros = np.linspace(0.0, 1.0, 50), np.zeros(50)
    sources = sort_by_cell(along, zeros, zeros + 1.0, zeros, grid)[0]
    return pairs._replace(ghosts=sources, ghost_factor=10.0)


@pytest.mark.parametrize("width", [0.008, 0.02], ids=["ellipses", "circles"])
@pytest.mark.parametrize("ghosts", [False, True])
def test_all_threads_find_what_one_finds(
    width: float, ghosts: bool, rotation_flow: FlowField
) -> None:
    """Within 1e-12 of the largest force: the same pairs, added in another order."""
    turns = width < 0.02
    pairs = pairs_of(width, ghosts)
    drift = Drift(External(Fluid(rotation_flow.arrays, 2.0, 3.0, 0.7), Harmonic(1.5)), pairs)
    place = places()[: 3 if turns else 2]
    one, all_ = np.empty_like(place), np.empty_like(place)
    particle_forces(drift, 0.0, place, one)
    LargeCloud(drift, NUMBER).set_forces(0.0, place[None], all_[None])
    scale = np.abs(one).max(axis=1, keepdims=True)
    assert np.abs(all_ - one).max() < 1e-12 * scale.max()
    assert (np.abs(all_ - one) < 1e-12 * scale).all()


def test_without_pairs_the_same_bits(rotation_flow: FlowField) -> None:
    drift = Drift(External(Fluid(rotation_flow.arrays, 2.0, 3.0, 0.7), Harmonic(1.5), Sine(0.3)))
    place = places()
    one, all_ = np.empty_like(place), np.empty_like(place)
    particle_forces(drift, 0.0, place, one)
    LargeCloud(drift, NUMBER).set_forces(0.0, place[None], all_[None])
    assert np.array_equal(one, all_)


def test_blocks_cover_all_rows_and_have_two_at_least() -> None:
    pairs = pairs_of(0.008, False)
    place = places()
    sources, _ = sort_by_cell(place[0], place[1], np.ones(NUMBER), np.zeros(NUMBER), pairs.grid)
    cuts = np.array(row_blocks(sources, pairs.grid))
    assert cuts[0] == 0
    assert cuts[-1] == pairs.grid.rows
    assert len(cuts) > 4
    assert (np.diff(cuts)[:-1] >= 2).all()
    assert cuts[-1] > cuts[-2]


BITS = """
import hashlib, numba, numpy as np
from ellipsoid_coupling.interaction.pairs.threaded_pair_sum import LargeCloud
from ellipsoid_coupling.interaction.particle_forces import Drift
from ellipsoid_coupling.physics.drift import External
from ellipsoid_coupling.physics.outer import Harmonic
from tests.interaction.pairs.test_threaded_pair_sum import NUMBER, pairs_of, places
drift = Drift(External(outer=Harmonic(1.5)), pairs_of(0.008, True))
for threads in (1, 2, 4):
    numba.set_num_threads(threads)
    place = places()[None]
    force = np.empty_like(place)
    LargeCloud(drift, NUMBER).set_forces(0.0, place, force)
    print(hashlib.sha256(force.tobytes()).hexdigest())
"""


def test_same_bits_on_one_two_and_four_threads() -> None:
    environment = os.environ | {"NUMBA_NUM_THREADS": "4"}
    command = [sys.executable, "-c", BITS]
    found = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    told = found.stdout.split()
    assert len(told) == 3
    assert len(set(told)) == 1

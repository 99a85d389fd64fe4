"""The hot kernels under pytest-benchmark: `pytest tests/benchmarks --benchmark-enable`.

A plain run calls each once and checks that what it computed is finite and not nothing, and that a
sweep moves mass and keeps it; nothing here passes or fails by a clock. workflows/benchmark.py has the
rivals and the machine's limits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force
from ellipsoid_coupling.finite_volume.q_grid import inside, occupied_extents
from ellipsoid_coupling.finite_volume.q_transport import transport
from ellipsoid_coupling.geometry.boundaries import Reflect
from ellipsoid_coupling.interaction.pairs.cells import cell_grid
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.interaction.q_grid import AngleGridInteraction
from ellipsoid_coupling.interaction.select import choose_interaction
from ellipsoid_coupling.physics.potential import potential_shape
from tests.finite_volume.whole import ghosts_of

Floats = NDArray[np.float64]
# What pytest-benchmark hands to a test: calls a function, returns what it returned.
Benchmark = Callable[..., Any]

UNIT = (0.0, 1.0)
SHAPE = potential_shape(0.05, 0.025)


def check(values: NDArray[np.floating]) -> None:
    assert np.all(np.isfinite(values))
    assert np.any(values != 0.0)


def places(count: int) -> Floats:
    return np.random.default_rng(1).random((3, count))


def test_pair_sum(benchmark: Benchmark) -> None:
    place = places(1000)
    axis = np.array([np.cos(2.0 * place[2]), np.sin(2.0 * place[2])])
    pairs = Pairs(cell_grid(UNIT, UNIT, SHAPE.reach), SHAPE, 1.0, 1.0, None, 0.0)
    force = np.zeros((3, 1000))
    benchmark(add_pair_forces, place, axis, pairs, force)
    check(force)


def test_sample_forces(benchmark: Benchmark) -> None:
    interaction = SampleInteraction(Region(UNIT, UNIT), SHAPE, 0.025, 1.0, 2e-2)
    place = places(10_000)[None]
    force = np.zeros_like(place)
    benchmark(interaction.add_forces, place, (1.0, 1.0), force)
    check(force)


@pytest.mark.parametrize("axis", [-1, -2, -3])
@pytest.mark.parametrize(
    "flux", [Force(0.0), Ballistic((0.05, *(0.1,) * 3))], ids=["force", "ballistic"]
)
def test_sweep(benchmark: Benchmark, flux: Any, axis: int) -> None:
    fields = np.zeros((4, 34, 64, 64))
    inside(fields)[0] = 1.0 + np.random.default_rng(4).random((30, 60, 60))
    inside(fields)[1:] = 0.1
    before = inside(fields).copy()
    extents, table = occupied_extents(fields), ghosts_of(fields, Reflect())
    benchmark(transport, flux, fields, axis, 0.1, extents, table, 0.0)
    check(fields)
    assert np.all(inside(fields)[0] != before[0])
    assert inside(fields)[0].sum() == pytest.approx(before[0].sum(), rel=1e-13)


@pytest.mark.parametrize("tolerance", [0.0, 2e-2], ids=["double", "single"])
def test_q_integral(benchmark: Benchmark, tolerance: float) -> None:
    interaction = AngleGridInteraction((20, 60, 60), 1.0 / 60, SHAPE, 1.0, tolerance=tolerance)
    density = np.random.default_rng(2).random((20, 60, 60))
    check(benchmark(interaction.forces, density).x)


@pytest.mark.parametrize("method", ["direct", "harmonics"])
def test_rho_integral(benchmark: Benchmark, method: Any) -> None:
    rng = np.random.default_rng(3)
    density, angle = rng.random((60, 60)), 6.0 * rng.random((60, 60))
    interaction = choose_interaction((60, 60), 1.0 / 60, SHAPE, 1.0, 2e-2, method)
    check(benchmark(interaction, density, angle).x)

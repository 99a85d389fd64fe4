"""How much memory a run takes at its peak, estimated from the scene before anything is allocated.

The peak is at the end, where snapshots become the arrays of result.nc, or within the last steps. Each
estimate is the sum of the arrays that the code makes; `tests/models/test_memory.py` compares it with
measured runs. A run that does not fit is refused before its folder is made.
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words, memory_left
from ellipsoid_coupling.interaction.pairs.cells import CELLS_PER_REACH
from ellipsoid_coupling.interaction.particle_mesh.nodes import nodes_per_width
from ellipsoid_coupling.interaction.particle_mesh.select import affordable_harmonics, scene_samples
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.noise import STEPS_PER_BLOCK
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene

_NUMBER = 8  # bytes of a float64

# Bytes of compiled kernels and of the libraries that write the result.
_LIBRARIES = 1.5e8
# Numbers for each item besides its saved variables. Particles: 3 x (position, velocity, force) and a flag.
# Cells: fields with ghosts, drift, copies of both for a refused step, and the drift's constant part.
_WORK = {
    "particles": {"paper": 10, "accurate": 10},
    "rho": {"paper": 16, "accurate": 22},
    "q": {"paper": 10, "accurate": 12},
}
# Under pressure the stages of a step are kept.
_STAGES = {"paper": 0, "accurate": 15}
# For particles that take a step together: the trial step, sums and sorted copies.
_TRIAL = {"paper": 2, "accurate": 14}
_PAIRS = 14
_GRID_FORCES = {"rho": 6, "q": 4}
# Variables in the result file. Each is in memory twice while it is assembled from the snapshots.
_SAVED = {"particles": 6, "rho": 5, "q": 4}
# Grids reach a save time before the end on a copy of fields and drift, see `step_control.Aside`.
_ASIDE = {"particles": 0, "rho": 8, "q": 4}
_PER_GHOST = 5


class Need(NamedTuple):
    """One consumer of memory: its name, the number of items, the scene's keys that set it, bytes."""

    what: str
    number: float
    keys: str
    size: float


def require_memory(kind: ModelKind, setup: Setup) -> None:
    """InputError, with the bytes and the keys at fault, for a run that the machine cannot hold."""
    needs = _needs(kind, setup)
    worst, total = max(needs, key=lambda need: need.size), sum(need.size for need in needs)
    left = memory_left()
    if total > left:
        raise InputError(
            f"scene {setup.scene.name}, {worst.keys}",
            f"a run that fits into the {in_words(left)} that are left of this machine, its container "
            "or its shell's limit",
            f"{worst.number:.3g} {worst.what}, which take {in_words(worst.size)} of {in_words(total)}",
            "Make the run smaller.",
        )


def peak_memory(kind: ModelKind, setup: Setup) -> float:
    """Bytes that a run takes at its peak, on top of what its process has already."""
    return sum(need.size for need in _needs(kind, setup))


def _needs(kind: ModelKind, setup: Setup) -> list[Need]:
    needs = [Need("libraries", 1.0, "", _LIBRARIES)]
    if kind.is_grid:
        return needs + _grid_needs(kind, setup)
    needs += _particle_needs(kind, setup) + _pair_needs(setup.scene)
    if kind.is_sampled_density:
        needs += _node_needs(setup.scene, setup.realisations)
    return needs


def _saved(layout: str, times: int) -> tuple[float, float]:
    """Numbers an item that are held within the last steps, and at the end, for its snapshots."""
    variables = _SAVED[layout]
    if times == 1:
        return 0.0, float(variables)
    return variables * (times - 1.0) + _ASIDE[layout], (variables + 1.0) * times


def _particle_needs(kind: ModelKind, setup: Setup) -> list[Need]:
    scene, terms, scheme = setup.scene, setup.terms, setup.scheme
    number, keys = scene.particles.number, "keys particles.number, particles.realisations, times"
    stepping, ending = _saved("particles", len(scene.times))
    components = 2.0 * terms.noise + terms.angular_noise
    stepping += components * STEPS_PER_BLOCK * STEPPERS[scheme].noise_per_step
    count = float(number * setup.realisations)
    work = _WORK["particles"][scheme] + max(stepping, ending)
    at_once = float(number) if kind.independent_realisations else count
    trial = _TRIAL[scheme] + (_PAIRS if scene.interaction is not None else 0)
    return [
        _need("particles", count, keys, work),
        _need("particles that step together", at_once, keys, trial),
    ]


def node_count(scene: Scene, realisations: int) -> float:
    """Nodes that samples interact through; 0 for those that interact pair by pair."""
    samples = scene_samples(scene, scene.particles.number * realisations)
    if samples is None or affordable_harmonics(samples) < 0:
        return 0.0
    h = samples.width / nodes_per_width(samples.shape, samples.width, samples.tolerance)
    return _cells(scene, h)


def _node_needs(scene: Scene, realisations: int) -> list[Need]:
    nodes = node_count(scene, realisations)
    if nodes == 0.0:
        return []
    # Density, and cosine and sine of twice the angle, on the nodes and in the transform.
    keys = "keys particles.width, domain, numerics.harmonics_tolerance"
    return [_need("nodes", nodes, keys, 6)]


def _need(what: str, count: float, keys: str, numbers: float) -> Need:
    return Need(what, count, keys, count * numbers * _NUMBER)


def _cells(scene: Scene, h: float) -> float:
    return (scene.domain.width / h) * (scene.domain.height / h)


def _pair_needs(scene: Scene) -> list[Need]:
    """For pairs of particles: the cells that sort them, and the walls' ghosts."""
    if scene.interaction is None:
        return []
    shape = potential_shape(scene.particles.length, scene.particles.width)
    cells = _cells(scene, shape.reach / CELLS_PER_REACH)
    needs = [_need("cells of half a reach", cells, "keys particles.length, domain", 2)]
    if scene.walls is not None:
        ghosts = max(scene.domain.width, scene.domain.height) / scene.particles.length
        needs.append(_need("ghost particles", ghosts, "keys particles.length, domain", _PER_GHOST))
    return needs


def _grid_needs(kind: ModelKind, setup: Setup) -> list[Need]:
    scene, layout = setup.scene, kind.layout
    stages = _STAGES[setup.scheme] if kind.pressure != 0.0 else 0
    cells, keys = _cells(scene, scene.numerics.cell), "keys numerics.cell, domain, times"
    if layout == "q":
        cells *= scene.numerics.angle_cells
        keys = keys.replace("cell,", "cell, numerics.angle_cells,")
    work = _WORK[layout][setup.scheme] + stages + max(_saved(layout, len(scene.times)))
    if scene.interaction is None:
        return [_need("cells", cells, keys, work)]
    reach = potential_shape(scene.particles.length, scene.particles.width).reach
    stencil = (reach / scene.numerics.cell) ** 2
    within = "cells within the interaction's reach"
    return [
        _need("cells", cells, keys, work + _GRID_FORCES[layout]),
        _need(within, stencil, "keys particles.length, numerics.cell", 3),
    ]

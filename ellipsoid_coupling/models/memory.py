"""How much memory a run takes, found from the scene before anything of it is allocated.

The estimates are from below: arrays that every run of the model has, without what a library adds. What
is refused would therefore not have fitted; what passes may still be slow.
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.cells import CELLS_PER_REACH
from ellipsoid_coupling.interaction.sample_choice import affordable_harmonics, scene_samples
from ellipsoid_coupling.interaction.sample_nodes import nodes_per_width
from ellipsoid_coupling.limits import in_words, memory_limit
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene

_NUMBER = 8  # bytes of a float64

# Numbers an item has beside what is saved of it: particles 3 x (place, velocity, force) and their
# order; r-cells fields, drift and a copy; q-cells fields and their fluxes.
_PER_PARTICLE, _PER_CELL, _PER_Q_CELL = 10, 14, 8
# Variables in the result file, of the particles and of each kind of cell; all times are held twice.
_SAVED = {"particles": 6, "rho": 5, "q": 4}
_PER_GHOST = 5


class Need(NamedTuple):
    """What takes memory: its name, how many items, the scene's keys that set it, bytes."""

    what: str
    number: float
    keys: str
    size: float


def require_memory(layout: str, name: str, setup: Setup) -> None:
    """InputError, with the bytes and the keys at fault, for a run that the machine cannot hold."""
    worst = max(_needs(layout, name, setup), key=lambda need: need.size)
    limit = memory_limit()
    if worst.size > limit:
        raise InputError(
            f"scene {setup.scene.name}, {worst.keys}",
            f"a run that fits into the {in_words(limit)} of this machine",
            f"{worst.number:.3g} {worst.what}, which take {in_words(worst.size)}",
            "Make the run smaller.",
        )


def _needs(layout: str, name: str, setup: Setup) -> list[Need]:
    scene = setup.scene
    saved = 2 * _SAVED[layout] * len(scene.times)
    needs = _pair_needs(scene) if layout == "particles" else _grid_needs(layout, scene, saved)
    if layout == "particles":
        count = float(scene.particles.number * setup.realisations)
        keys = "keys particles.number, particles.realisations, times"
        needs.append(_need("particles", count, keys, _PER_PARTICLE + saved))
    if name == "mckean_vlasov":
        needs += _node_needs(scene, setup.realisations)
    return needs


def _node_needs(scene: Scene, realisations: int) -> list[Need]:
    """What samples need that interact through nodes, and not pair by pair."""
    samples = scene_samples(scene, scene.particles.number * realisations)
    if samples is None or affordable_harmonics(samples) < 0:
        return []
    h = samples.width / nodes_per_width(samples.shape, samples.width, samples.tolerance)
    # Density, and cosine and sine of twice the angle, on the nodes and in the transform.
    keys = "keys particles.width, domain, numerics.harmonics_tolerance"
    return [_need("nodes", _cells(scene, h), keys, 6)]


def _need(what: str, count: float, keys: str, numbers: float) -> Need:
    return Need(what, count, keys, count * numbers * _NUMBER)


def _cells(scene: Scene, h: float) -> float:
    return (scene.domain.width / h) * (scene.domain.height / h)


def _pair_needs(scene: Scene) -> list[Need]:
    """What pairs of particles need: the cells that sort them, and the walls' ghosts."""
    if scene.interaction is None:
        return []
    shape = potential_shape(scene.particles.length, scene.particles.width)
    cells = _cells(scene, shape.reach / CELLS_PER_REACH)
    needs = [_need("cells of half a reach", cells, "keys particles.length, domain", 1)]
    if scene.walls is not None:
        ghosts = max(scene.domain.width, scene.domain.height) / scene.particles.length
        needs.append(_need("ghost particles", ghosts, "keys particles.length, domain", _PER_GHOST))
    return needs


def _grid_needs(layout: str, scene: Scene, saved: int) -> list[Need]:
    cells, keys = _cells(scene, scene.numerics.cell), "keys numerics.cell, domain, times"
    needs = []
    if layout == "q":
        count = cells * scene.numerics.angle_cells
        keys = keys.replace("cell,", "cell, numerics.angle_cells,")
        needs.append(_need("cells", count, keys, _PER_Q_CELL + saved))
    else:
        needs.append(_need("cells", cells, keys, _PER_CELL + saved))
    if scene.interaction is not None:
        reach = potential_shape(scene.particles.length, scene.particles.width).reach
        stencil = (reach / scene.numerics.cell) ** 2
        keys = "keys particles.length, numerics.cell"
        needs.append(_need("cells within the interaction's reach", stencil, keys, 3))
    return needs

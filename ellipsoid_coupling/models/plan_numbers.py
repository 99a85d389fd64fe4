"""The size of a run before it is run, and the numbers that decide about models: ``ellipsoid plan``.

    U/(gamma L)     Stokes number: U the fluid's largest speed, L the shorter side of the domain
    neighbours      others within the potential's reach, (N - 1) pi reach^2/|Omega_0| at the start
    reach/h         cells of a grid within that reach; a potential of few cells is not resolved
    T U/(C h)       steps of a grid by its CFL number C where all moves at the fluid's speed from the start:
                    the most, unless forces make it faster
    T/dt            steps of particles to a tolerance, dt^3 phi3(gamma dt) gamma a = tolerance length: the
                    error of a step (`particles.exponential`) in the fluid's acceleration a, the root of the
                    mean square of (u grad) u over the domain

Memory is what a run is refused by. Steps of a fixed length are exact; others, and times, are not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from ellipsoid_coupling.files.limits import in_words, memory_left, time_in_words
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.scales import FlowScales, flow_scales
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.cost_table import FACTOR, cost_of, machine_factor
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.models.memory import node_count, peak_memory
from ellipsoid_coupling.models.plan import Fact, model_terms
from ellipsoid_coupling.models.registry import kind_named
from ellipsoid_coupling.models.schemes import scheme_named
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene

Range = tuple[float, float]

# Points a side at which the fluid's acceleration is taken.
_POINTS = 100
_ITERATIONS, _SERIES = 30, 1e-3
# Fewer cells within the reach do not resolve the potential's flank.
_FEWEST_CELLS = 4.0


class Steps(NamedTuple):
    """How many, how exact that is, and why.

    precision : "" for an exact number, else words before it, such as "about "
    """

    number: float
    precision: str
    why: str


def plan_numbers(
    scene: Scene, name: str, scheme: str, field: FlowField | None = None
) -> list[Fact]:
    """Memory, size, steps and time of a run, and the numbers that decide.

    field : the scene's flow, where it is known

    Raises
    ------
    InputError
        For an unknown model or scheme.
    """
    kind, chosen = kind_named(name), scheme_named(scheme)
    setup = Setup(
        scene, model_terms(scene, name), chosen.name, None, 0, scene.particles.realisations
    )
    scales = None if field is None else flow_scales(field, (scene.domain.x, scene.domain.y))
    items = item_count(kind, scene)
    steps = None if kind.equilibrium else step_count(kind, setup, field, scales)
    facts = [_memory(kind, setup), Fact(*_items_in_words(kind, scene))]
    if steps is not None:
        number = two_digits(steps.number) if steps.precision else steps.number
        told = f"{steps.precision}{number:.0f}"
        facts.append(Fact("steps", told, steps.why))
        facts.append(_time(kind, setup, items, steps))
    return [*facts, *_stokes(scene, scales), *_interaction(kind, scene)]


def two_digits(number: float) -> float:
    """Rounded to what is known of it."""
    return float(f"{number:.2g}")


def item_count(kind: ModelKind, scene: Scene) -> int:
    """Particles of all realisations, or cells."""
    if not kind.is_grid:
        return scene.particles.number * scene.particles.realisations
    domain, h = scene.domain, scene.numerics.cell
    cells = round(domain.width / h) * round(domain.height / h)
    return cells * (scene.numerics.angle_cells if kind.layout == "q" else 1)


def _items_in_words(kind: ModelKind, scene: Scene) -> tuple[str, str, str]:
    count = item_count(kind, scene)
    if not kind.is_grid:
        particles = scene.particles
        shape = f"{particles.number} x {particles.realisations} realisations"
        return "samples" if kind.is_sampled_density else "particles", f"{count}", shape
    domain, h = scene.domain, scene.numerics.cell
    shape = f"{round(domain.width / h)} x {round(domain.height / h)}"
    return (
        "cells", f"{count}",
        f"{shape} x {scene.numerics.angle_cells} angles" if kind.layout == "q" else shape,
    )  # fmt: skip


def step_count(
    kind: ModelKind, setup: Setup, field: FlowField | None, scales: FlowScales | None
) -> Steps | None:
    """The steps of a run; None where nothing that is known tells."""
    scene, numerics = setup.scene, setup.scene.numerics
    if not kind.is_grid:
        if scheme_named(setup.scheme).adaptive:
            return None if field is None else adaptive_steps(scene, field)
        return Steps(
            float(given_steps(scene)), "", f"of numerics.time_step = {numerics.time_step:g}"
        )
    if scales is None or not scales.largest > 0.0:
        return None
    number = scene.times[-1] * scales.largest / (numerics.cfl * numerics.cell)
    why = f"T U/(C h), by the CFL number {numerics.cfl:g} at the fluid's speed {scales.largest:.3g}"
    return Steps(number, "at most about ", why)


def given_steps(scene: Scene) -> int:
    """Steps of a fixed length: the fewest equal ones to each save time, as `equal_steps` takes them."""
    starts = (0.0, *scene.times[:-1])
    gaps = [end - start for start, end in zip(starts, scene.times, strict=True)]
    return sum(math.ceil(gap / scene.numerics.time_step * (1.0 - 1e-12)) for gap in gaps)


def adaptive_steps(scene: Scene, field: FlowField) -> Steps | None:
    """Steps to a tolerance by the fluid alone; None without drag or acceleration. See the module.

    None as well for a fluid so fast that the step is no number above 0.
    """
    drag, tolerance = scene.flow.drag if scene.flow else 0.0, scene.numerics.tolerance
    force = drag * fluid_acceleration(field, (scene.domain.x, scene.domain.y))
    if not 0.0 < force < math.inf:
        return None
    allowed = tolerance * scene.particles.length / force
    dt = allowed ** (1.0 / 3.0)
    for _ in range(_ITERATIONS):
        # The mean of old and new converges for every z, as phi3 falls between z^0 and 1/z.
        dt = 0.5 * (dt + (allowed / phi3(drag * dt)) ** (1.0 / 3.0))
    if not dt > 0.0:
        return None
    why = f"by numerics.tolerance = {tolerance:g} in this fluid; where particles meet, more"
    return Steps(scene.times[-1] / dt, "about ", why)


def phi3(z: float) -> float:
    """(1 - z + z^2/2 - e^{-z})/z^3, 1/6 at 0."""
    return 1.0 / 6.0 - z / 24.0 if z < _SERIES else (1.0 - z + 0.5 * z * z - math.exp(-z)) / z**3


def fluid_acceleration(field: FlowField, box: tuple[Range, Range]) -> float:
    """The root of the mean square of (u grad) u where there is fluid in a box; 0 without fluid."""
    middles = (np.arange(_POINTS) + 0.5) / _POINTS
    x, y = (low + middles * (high - low) for low, high in box)
    at = field.evaluate(*np.meshgrid(x, y))
    if not at.inside.any():
        return 0.0
    along_x = at.velocity_x * at.dux_dx + at.velocity_y * at.dux_dy
    along_y = at.velocity_x * at.duy_dx - at.velocity_y * at.dux_dx
    # Beyond double precision it is infinite, which `adaptive_steps` says nothing of.
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(along_x**2 + along_y**2, where=at.inside)))


def _memory(kind: ModelKind, setup: Setup) -> Fact:
    need, left = peak_memory(kind, setup), memory_left()
    told = "a run will be refused" if need > left else "at its peak"
    return Fact("memory", f"about {in_words(need)}", f"{told}; {in_words(left)} are left")


def _time(kind: ModelKind, setup: Setup, items: int, steps: Steps) -> Fact:
    """Seconds by `cost_table`."""
    cost = cost_of(kind, setup.scheme)
    scene = setup.scene
    each, nodes = cost.item, 0.0
    if scene.interaction is not None:
        each += cost.interacting * (
            _spread_neighbours(scene) if kind.independent_realisations else 1.0
        )
        nodes = node_count(scene, setup.realisations) if kind.is_sampled_density else 0.0
    seconds = 1e-9 * steps.number * (items * each + nodes * cost.node)
    seconds *= machine_factor(numba.get_num_threads())
    return Fact(
        "time", f"{steps.precision or 'about '}{time_in_words(two_digits(seconds))}",
        f"within a factor of {FACTOR:g} either way, if no other work is on this machine; without compiling",
    )  # fmt: skip


def _spread_neighbours(scene: Scene) -> float:
    """Neighbours in reach once the particles have spread over the domain, which they soon do."""
    reach = potential_shape(scene.particles.length, scene.particles.width).reach
    area = scene.domain.width * scene.domain.height
    return (scene.particles.number - 1) * min(1.0, math.pi * reach**2 / area)


def neighbours_in_reach(scene: Scene) -> float | None:
    """Others within the potential's reach of a particle, evenly spread over the start; None for points."""
    start, particles = scene.start, scene.particles
    area = (start.x[1] - start.x[0]) * (start.y[1] - start.y[0])
    if not area > 0.0:
        return None
    reach = potential_shape(particles.length, particles.width).reach
    return min(particles.number - 1, (particles.number - 1) * math.pi * reach**2 / area)


def _stokes(scene: Scene, scales: FlowScales | None) -> list[Fact]:
    if scene.flow is None or scales is None or scene.flow.drag == 0.0:
        return []
    if not math.isfinite(scales.largest):
        return []
    side = min(scene.domain.width, scene.domain.height)
    number = scales.largest / (scene.flow.drag * side)
    told = "follow the fluid" if number < 0.1 else "lag behind it" if number < 10.0 else "fly on"
    why = f"Stokes number, U = {scales.largest:.3g}, L = {side:g}: particles {told}"
    return [Fact("U/(gamma L)", f"{number:.2g}", why)]


def _interaction(kind: ModelKind, scene: Scene) -> list[Fact]:
    if scene.interaction is None:
        return []
    near, particles = neighbours_in_reach(scene), scene.particles
    reach = potential_shape(particles.length, particles.width).reach
    facts = [
        Fact(
            "neighbours in reach", "unknown" if near is None else f"{near:.3g}",
            f"within {reach:.3g}, at the start; if these are few the limit of many particles is rough",
        )
    ]  # fmt: skip
    if kind.is_grid:
        cells = reach / scene.numerics.cell
        verdict = "resolved" if cells >= _FEWEST_CELLS else "WARNING: too few to resolve it"
        facts.append(Fact("reach in cells", f"{cells:.3g}", f"of the pair potential: {verdict}"))
    return facts

"""What a step costs, for `ellipsoid plan`: the table of `models/cost_table.py` anew.

    .venv/bin/python workflows/plan_costs.py

Runs small scenes of every kind of model with and without interaction, each thrice so that all is compiled,
and prints nanoseconds a step and item on two threads, and the probe of the machine. Some two minutes,
besides compiling.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numba

import ellipsoid_coupling as ec
from ellipsoid_coupling.models import SCHEMES, kind_named, model_kinds, scheme_named
from ellipsoid_coupling.models.cost_table import THREADS, StepCost, machine_probe
from ellipsoid_coupling.models.memory import node_count
from ellipsoid_coupling.models.plan_numbers import item_count, neighbours_in_reach

# Mass all over the domain, so that no cell is left out.
FULL: dict[str, Any] = {"start.x": [-1.4, 1.4], "start.y": [-1.4, 1.4], "times": [0.25]}
SETTINGS: dict[str, dict[str, Any]] = {
    "particles": FULL | {"particles.realisations": 64, "numerics.tolerance": 1e-4},
    "samples": FULL | {"particles.realisations": 256},
    "rho": FULL | {"numerics.cell": 0.015},
    "q": FULL | {"numerics.cell": 0.03, "numerics.angle_cells": 20},
}
SCENE = "rotation"
# The first one compiles.
_RUNS = 3


def main() -> dict[tuple[str, str], StepCost]:
    """Print, and return, the table."""
    numba.set_num_threads(min(THREADS, numba.get_num_threads()))
    table: dict[tuple[str, str], StepCost] = {}
    for layout, model in models().items():
        for scheme in SCHEMES:
            table[layout, scheme] = cost = measured(layout, model, scheme)
            numbers = ", ".join(f"{number:.3g}" for number in cost)
            sys.stdout.write(f'    ("{layout}", "{scheme}"): StepCost({numbers}),\n')
            sys.stdout.flush()
    sys.stdout.write(f"REFERENCE_PROBE = {min(machine_probe() for _ in range(5)):.3g}\n")
    return table


def models() -> dict[str, str]:
    """The model that is measured for each kind of the table."""
    found: dict[str, str] = {}
    for kind in model_kinds():
        layout = "samples" if kind.is_sampled_density else kind.layout
        # Without pressure, whose closures take more stages.
        if not kind.equilibrium and not kind.overdamped and kind.pressure == 0.0:
            found.setdefault(layout, kind.name)
    return found


def measured(layout: str, model: str, scheme: str) -> StepCost:
    """Nanoseconds of one kind of model and scheme."""
    alone = ec.load_scene(SCENE, SETTINGS[layout] | {"interaction": None})
    pairs = ec.load_scene(SCENE, SETTINGS[layout])
    item = a_step(alone, model, scheme) / item_count(kind_named(model), alone)
    further = a_step(pairs, model, scheme) - item * item_count(kind_named(model), pairs)
    further = max(further, 0.0)
    if layout == "samples":
        # Few samples show what nodes cost, many what samples cost.
        few = ec.load_scene(SCENE, SETTINGS[layout] | {"particles.realisations": 16})
        counts = [item_count(kind_named(model), one) for one in (few, pairs)]
        nodes = node_count(pairs, pairs.particles.realisations)
        less = max(a_step(few, model, scheme) - item * counts[0], 0.0)
        each = max(further - less, 0.0) / (counts[1] - counts[0])
        return StepCost(item, each, max(less - each * counts[0], 0.0) / nodes)
    count = item_count(kind_named(model), pairs)
    if layout == "particles":
        near = neighbours_in_reach(pairs)
        assert near is not None  # the start is a box
        return StepCost(item, further / count / near)
    return StepCost(item, further / count)


def a_step(scene: ec.Scene, model: str, scheme: str) -> float:
    """Nanoseconds of a step of all items, the better of two runs after a first one.

    Those of the processors, over the number of threads: other work on the machine does not count.
    """
    times = []
    for _ in range(_RUNS):
        before = time.process_time()
        steps = float(ec.simulate(scene, model, scheme_named(scheme).name).attributes["steps"])
        times.append(1e9 * (time.process_time() - before) / numba.get_num_threads() / steps)
    return min(times[1:])


if __name__ == "__main__":
    main()

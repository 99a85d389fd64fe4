"""What a step of each kind of model costs, for `ellipsoid plan`: measured once, scaled to a machine.

Nanoseconds of two threads on the machine of `REFERENCE_PROBE`, 2026-11-28, two cores with AVX-512:
(processor seconds of a run, compiled and warm)/(2 x steps x items). `workflows/plan_costs.py` prints this
table anew. Items are the particles of all realisations, samples, or cells. A run is seldom off by more than
a factor of three: grids are swept where there is mass only, particles gather, threads wait.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.models.kind import ModelKind


class StepCost(NamedTuple):
    """Nanoseconds of two threads.

    Attributes
    ----------
    item : float
        A particle, a sample or a cell, each step, without interaction.
    interacting : float
        What interaction adds to it, each step: for a particle per neighbour in reach, for a cell or a
        sample as such.
    node : float
        Per node of the samples' interaction, each step.
    """

    item: float
    interacting: float
    node: float = 0.0


# By layout ("samples" are those of one density) and scheme.
COSTS: dict[tuple[str, str], StepCost] = {
    ("particles", "paper"): StepCost(10.2, 4.86),
    ("particles", "accurate"): StepCost(20.6, 5.73),
    ("samples", "paper"): StepCost(10.6, 242.0, 125.0),
    ("samples", "accurate"): StepCost(17.7, 435.0, 134.0),
    ("rho", "paper"): StepCost(101.0, 691.0),
    ("rho", "accurate"): StepCost(39.9, 548.0),
    ("q", "paper"): StepCost(15.8, 12.8),
    ("q", "accurate"): StepCost(14.3, 8.6),
}
# Either way.
FACTOR = 3.0
THREADS = 2
# Seconds of `machine_probe` on that machine.
REFERENCE_PROBE = 1.83e-3
_PROBE_SIZE, _PROBES = 200_000, 5


def cost_of(kind: ModelKind, scheme: str) -> StepCost:
    """The row of a model and scheme."""
    return COSTS["samples" if kind.is_sampled_density else kind.layout, scheme]


def machine_probe() -> float:
    """Seconds that one core takes for an exponential and a sine of 200 000 numbers, the best of five.

    Some twenty milliseconds in all.
    """
    numbers = np.linspace(0.0, 1.0, _PROBE_SIZE)
    best = float("inf")
    for _ in range(_PROBES):
        began = time.perf_counter()
        np.exp(numbers) * np.sin(numbers)
        best = min(best, time.perf_counter() - began)
    return best


def machine_factor(threads: int) -> float:
    """How much longer this machine takes than that of the table, with so many threads."""
    return machine_probe() / REFERENCE_PROBE * THREADS / threads

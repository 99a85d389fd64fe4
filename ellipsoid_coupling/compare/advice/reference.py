"""What errors are measured against, as fine as the error that is asked for needs and the budget allows.

Where particles are independent this is the exact solution by evenly spread points, else the limit of
infinitely many particles by samples. Both are refined step by step; the distance of the last two is how far
the finest may still be off. It is fine enough where that is a quarter of the error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.compare.advice.budget import Budget
from ellipsoid_coupling.compare.cheapest import Kind
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import Bins, bin_result, distance, sampling_error
from ellipsoid_coupling.compare.exact_solution import exact_reference, has_exact_reference
from ellipsoid_coupling.compare.reference_solution import sample_levels, sampled_kind
from ellipsoid_coupling.compare.resolutions import Level, Refinement, changed
from ellipsoid_coupling.compare.timing import Bench
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.models import ADAPTIVE_SCHEME
from ellipsoid_coupling.scenes import Scene

# The reference is refined until it moves by less than this part of the error, and may take this part of
# the budget for it. Without a second resolution it tells nothing, so that this one may take more.
FINE_ENOUGH = 0.25
_PART_OF_BUDGET, _PART_FOR_TWO = 0.5, 0.8
# Points a side of the exact solution; on the bins of `cavity_free` 384^2 are 0.003 off, 256^2 0.005.
_SIDES = (64, 128, 256, 384, 768)
_FEWEST = 32
_NO_OVERLAP = 2.0
EXACT = "the exact solution"
# With its noise taken out a random reference is still as far off as this part of its sampling error: it is
# taken out fold by fold, from eight folds.
_NOISE_LEFT = 0.5


@dataclass(frozen=True)
class AdviceReference:
    """The solution that errors are measured against.

    Attributes
    ----------
    name : str
        `EXACT`, or the model of the samples.
    bins : Bins
    spread : Errors
        How far it may be off, (T,) each; 2 where only one resolution was affordable.
    resolution : str
    """

    name: str
    bins: Bins
    spread: Errors
    resolution: str


class _Step(NamedTuple):
    """One resolution of a reference: its bins, its text, and the seconds that it took."""

    bins: Bins
    text: str
    seconds: float


def noise_group(scene: Scene) -> int | None:
    """Samples in a group that is independent of the others; None where samples are not random."""
    part = scene.noise
    noisy = part is not None and (part.noise > 0.0 or part.angular_noise > 0.0)
    return scene.particles.number if noisy else None


def find_reference(
    scene: Scene, error: float, quantity: Kind, bench: Bench, budget: Budget
) -> AdviceReference:
    """The reference for an error, within half of the budget if that is enough for two resolutions.

    Raises
    ------
    RunError
        If its first resolution fails, or takes more than the budget.
    """
    exact = has_exact_reference(scene)
    name = EXACT if exact else sampled_kind().name
    steps = _exact_steps(scene, bench, budget) if exact else _sampled_steps(scene, bench, budget)
    last = next(steps)
    nothing = np.full(len(scene.times), _NO_OVERLAP)
    found = AdviceReference(name, last.bins, Errors(nothing, nothing), last.text)
    costs = _costs(scene, exact)
    for k in range(1, len(costs)):
        enough = float(np.max(getattr(found.spread, quantity))) <= FINE_ENOUGH * error
        if enough or last.seconds * costs[k] / costs[k - 1] > _allowed(budget, k):
            break
        try:
            step = next(steps)
        except RunError:
            break
        spread = _doubt(step.bins, last.bins)
        found, last = AdviceReference(name, step.bins, spread, step.text), step
    return found


def _allowed(budget: Budget, number: int) -> float:
    """Seconds for a resolution; the first may take all that there is, as one is needed in any case."""
    part = (1.0, _PART_FOR_TWO)[number] if number < 2 else _PART_OF_BUDGET
    return max(0.0, part * budget.seconds - budget.spent)


def _doubt(fine: Bins, coarse: Bins) -> Errors:
    """How far the finer of two references may be off: what they differ by, and what noise leaves."""
    moved = distance(fine, coarse)[0]
    if fine.density.shape[0] == 1:
        return moved
    noise = sampling_error(fine, fine.samples * fine.density.shape[0])
    both = zip(moved, noise, strict=True)
    return Errors(*(np.hypot(far, _NOISE_LEFT * own) for far, own in both))


def _costs(scene: Scene, exact: bool) -> list[float]:
    """The work of each resolution, up to a factor."""
    if exact:
        return [float(side**2) for side in _SIDES]
    return [level.cost for level in _levels(scene)]


def _levels(scene: Scene) -> list[Level]:
    """Those of `compare`, and a coarser one before them."""
    levels = sample_levels(scene)
    first = levels[0]
    realisations = max(1, first.scene.particles.realisations // 4)
    numerics = first.scene.numerics
    coarser = changed(
        first.scene,
        {
            "particles.realisations": realisations,
            "numerics.harmonics_tolerance": 2.0 * numerics.harmonics_tolerance,
        },
    )
    return [Level(coarser, 0.5 * first.cost, 0.0), *levels]


def _exact_steps(scene: Scene, bench: Bench, budget: Budget) -> Iterator[_Step]:
    for side in _SIDES:
        bench.tell(f"{scene.name}: exact reference, {side} x {side} points", 0.0)
        if side == _SIDES[0]:
            exact_reference(scene, bench.flow, _FEWEST)  # compiles
        before = budget.spent
        with budget.counting():
            bins = bin_result(exact_reference(scene, bench.flow, side))
        yield _Step(bins, f"{side} x {side} points", budget.spent - before)


def _sampled_steps(scene: Scene, bench: Bench, budget: Budget) -> Iterator[_Step]:
    kind, levels = sampled_kind(), tuple(_levels(scene))
    group = noise_group(scene)
    refinement = Refinement(kind, ADAPTIVE_SCHEME, levels)
    other = replace(bench, seed=bench.seed + 1)
    other.warm_up(refinement)
    for number, level in enumerate(levels):
        timed = budget.run(other, refinement, level, _allowed(budget, number))
        with budget.counting():
            bins = bin_result(timed.result, group)
        yield _Step(bins, str(timed.result.attributes["resolution"]), timed.best)

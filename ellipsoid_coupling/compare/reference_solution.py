"""The reference of errors: the exact solution, a stored yardstick, or the refined mean-field limit.

`make_reference` finds or computes it, and the refined ensemble of particles that finite N is judged by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import Bins, bin_result, distance, sampling_error
from ellipsoid_coupling.compare.exact_solution import exact_reference, has_exact_reference
from ellipsoid_coupling.compare.resolutions import Level, Refinement, changed, has_noise
from ellipsoid_coupling.compare.timing import Bench, Timed
from ellipsoid_coupling.compare.yardsticks import Yardstick, find_yardstick
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.files.limits import LEAST_HARMONICS_TOLERANCE
from ellipsoid_coupling.models import ADAPTIVE_SCHEME, ModelKind, model_kinds
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

_MOST_SAMPLES = 1_000_000
# Levels of the refined samples: tolerance of the steps and of the interaction (its nodes and
# harmonics), in units of the scene's own, and the work, measured on `rotation`. Every level halves the
# second, so that the distance of the last two shows the interaction's error. At 1, 1/2 and 1/4 the L1
# distances of the angles of `rotation` to exact pair sums are 0.008, 0.004 and 0.002 at most.
_REFINED = ((10.0, 2.0, 1.0), (1.0, 1.0, 4.0), (0.3, 0.5, 10.0), (0.1, 0.25, 25.0))
# The flow map of 192^2 points is 4e-5 off that of 384^2 on the bins of `cavity_free`.
_EXACT_SIDE = 192
_FEWEST_REALISATIONS = 8
# The reference may take this many times longer than the runs that are measured against it.
_REFERENCE_TIME = 6.0


@dataclass(frozen=True)
class Reference:
    """The solution that errors are measured against.

    name : "exact", or the name of the model that was refined
    result, bins : the exact solution or the refined samples of the limit N to infinity; the result of a
        stored one has no variables
    ensemble : the refined ensemble of particles; None if no such model takes part
    refined : each grid model's extrapolated bins and their uncertainty
    group_size : particles of a realisation; None where samples are not random
    spread : how far it may be off: of a stored one as it tells, else the distance of the refined samples
        to the run before them; None for exact or one run
    """

    name: str
    result: Result
    bins: Bins
    exact: bool
    ensemble: Bins | None
    refined: dict[str, tuple[Bins, Errors | None]]
    group_size: int | None
    spread: Errors | None


def make_reference(scene: Scene, models: Sequence[str], bench: Bench) -> Reference:
    """The exact solution where particles are independent, a yardstick where one is stored, else samples.

    These are as fine as time allows.

    Raises
    ------
    RunError
        If its first run fails.
    InputError
        For a stored yardstick that is damaged.
    """
    group = scene.particles.number if has_noise(scene) else None
    spread = None
    exact = has_exact_reference(scene)
    stored = None if exact else find_yardstick(scene, bench.flow)
    if exact:
        bench.tell(f"{scene.name}: exact reference", 0.0)
        result = exact_reference(scene, bench.flow, _EXACT_SIDE)
        bench.tell(f"{scene.name}: exact reference", 1.0)
        bins = bin_result(result)
    elif stored is not None:
        result, bins, spread = _without_variables(scene, stored), stored.bins, stored.error
    else:
        result, before = _refined_samples(
            scene,
            sampled_kind(),
            replace(bench, seed=bench.seed + 1, longest=_REFERENCE_TIME * bench.longest),
        )
        bins = bin_result(result, group)
        if before is not None:
            spread = distance(bins, bin_result(before, group))[0]
    of_particles = _first_kind(lambda kind: kind.independent_realisations)
    ensemble = (
        _refined_ensemble(scene, of_particles, bench) if of_particles.name in models else None
    )
    return Reference(result.model, result, bins, exact, ensemble, {}, group, spread)


def _without_variables(scene: Scene, stored: Yardstick) -> Result:
    """A stored yardstick as a result: its bins stand beside it."""
    attributes = {"status": "completed", "origin": stored.origin}
    nothing: dict[str, Floats] = {}
    times = stored.times
    return Result(scene, stored.model, ADAPTIVE_SCHEME, "particles", times, nothing, {}, attributes)


def _first_kind(has: Callable[[ModelKind], bool]) -> ModelKind:
    """The first model of the hierarchy with a property."""
    return next(kind for kind in model_kinds() if has(kind))


def sampled_kind() -> ModelKind:
    """The model whose samples are the reference where there is no exact solution."""
    return _first_kind(lambda kind: kind.is_sampled_density)


def sample_levels(scene: Scene) -> list[Level]:
    """Samples up to the scene's own tolerance and a million of them."""
    numerics, own = scene.numerics, scene.particles.realisations
    most = max(own, _MOST_SAMPLES // scene.particles.number)
    levels = []
    for step, harmonics, work in _REFINED:
        values = {
            "numerics.tolerance": numerics.tolerance * step,
            "numerics.harmonics_tolerance": max(
                numerics.harmonics_tolerance * harmonics, LEAST_HARMONICS_TOLERANCE
            ),
            "particles.realisations": most if harmonics == _REFINED[-1][1] else own,
        }
        levels.append(Level(changed(scene, values), work, 0.0))
    return levels


def _refined_samples(scene: Scene, kind: ModelKind, bench: Bench) -> tuple[Result, Result | None]:
    """The finest of `sample_levels` that time allows.

    Returns its run and the one before it, whose interaction is coarser as well.
    """
    # The last level has the most samples. Their cost is not known in advance: a run that takes too long
    # is stopped, and the level before it is taken.
    return _finest(Refinement(kind, ADAPTIVE_SCHEME, tuple(sample_levels(scene))), bench)


def _refined_ensemble(scene: Scene, kind: ModelKind, bench: Bench) -> Bins:
    """Particles at the scene's own tolerance and realisations, or as many as time allows."""
    own = max(_FEWEST_REALISATIONS, scene.particles.realisations)
    counts = sorted({max(_FEWEST_REALISATIONS, own // part) for part in (16, 4, 2, 1)})
    levels = [
        Level(changed(scene, {"particles.realisations": count}), float(count), 0.0)
        for count in counts
    ]
    result, _ = _finest(Refinement(kind, ADAPTIVE_SCHEME, tuple(levels)), bench)
    return bin_result(result, scene.particles.number)


def _finest(refinement: Refinement, bench: Bench) -> tuple[Result, Result | None]:
    """The finest level that the time allows, and the one before it.

    Raises
    ------
    RunError
        If the first level fails.
    """
    bench.warm_up(refinement)
    last: Timed | None = None
    before: Timed | None = None
    cost = 0.0
    for level in refinement.levels:
        if last is not None and last.best * level.cost / cost > bench.longest:
            break
        try:
            # A reference is needed in any case, so the first level may take as long as it needs.
            allowed = bench if last is not None else replace(bench, longest=math.inf)
            timed = allowed.run(refinement, level, repeats=1)
        except RunError:
            if last is None:
                raise
            break
        last, before, cost = timed, last, level.cost
    assert last is not None  # a refinement has a level, and the first one raises
    return last.result, None if before is None else before.result


def own_sampling(reference: Reference) -> Errors:
    """The reference's error from its finite number of samples; 0 if they are not random."""
    bins = reference.bins
    if bins.density.shape[0] > 1:
        return sampling_error(bins, bins.samples * bins.density.shape[0])
    nothing = np.zeros(reference.result.times.size)
    return Errors(nothing, nothing)

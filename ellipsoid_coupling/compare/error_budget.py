"""The parts of an error: discretisation, closure, finite N and sampling.

B(X) are the binned masses of a run X at one saved time (20 x 20 cells, or 60 angles, see
`compare.distances`), |.| is the sum of absolute values over the bins, and Y the reference: the exact
solution where there is one, else the refined samples of the limit. E is the mean over realisations.
Every part is an L1 distance:

    total           |B(X) - Y|
    discretisation  |E B(X) - R|       R: the same model, refined
    closure         |R - Y|            of a grid model
    finite N        |R - Y|            of an ensemble of particles
    sampling        E |B(X) - E B(X)|  of a random run

so that, by the triangle inequality, total <= the sum of the parts. R is

    grids           B_1 + (B_1 - B_2)/((h_2/h_1)^p - 1), the finest run of the scheme `accurate` and
                    the next whose spacing is half as wide again, p = 2 its order, no bin below 0. Its
                    uncertainty is |B_1 - B_2| or, where the distances from level to level fall by
                    less than half, the sum of those still to come, |B_1 - B_2| q/(1 - q) with
                    q = |B_1 - B_2|/|B_2 - B_3|. An R whose uncertainty is above 0.1 means little; a
                    closure below three times the uncertainty is not resolved
    particles       an ensemble with the scene's own number of realisations, a finer tolerance and
                    the same start positions
    samples         Y

Expectations of random runs. The bins come in K independent groups (realisations, or blocks of
samples); |mean of their differences d| would count the noise of the mean as an error. The groups are
put into eight folds (fewer where there are fewer groups) with means d_f, and

    |E d| ~ mean over f of sum_bins sign(mean of the other d_g, g /= f) d_f

The noise of a fold is independent of the sign that the others give it, so that noise adds nothing: the
estimate is 0 where E d = 0, and |E d| where that exceeds the noise; other bins are missing. Sampling is
the bootstrap: groups drawn with replacement from a pool of them, and the mean L1 distance of the
draws from the pool. With a single realisation no noise is taken out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.distances import ANGLE_BINS, DENSITY_CELLS, Errors, centred_angles
from ellipsoid_coupling.geometry.histograms import FULL_TURN, particle_angles, particle_density
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# Of both schemes `accurate` on grids; the tests of finite_volume/ measure it.
ORDER = 2
# Above this distance of the two finest levels an extrapolation means little.
UNRESOLVED = 0.1
# More groups of a random run than this tell nothing more about its spread.
MOST_GROUPS = 256
_DRAWS = 100
# More folds lose fewer bins to their noise, and vary more: from 8 to 100 by half as much again.
_FOLDS = 8
_NO_OVERLAP = 2.0


class Bins(NamedTuple):
    """A run's masses on the common bins.

    density : (K, T, 400) float64, K independent groups, axis order (group, time, bin), sum 1 over bins
    angle : (K, T, 60) float64
    samples : particles in a group; 0 for a grid
    """

    density: Floats
    angle: Floats
    samples: int


class Estimate(NamedTuple):
    """A distance at each saved time (T,), and its own standard error (T,)."""

    value: Floats
    spread: Floats


@dataclass(frozen=True)
class Parts:
    """The parts of one run's error; None where a part does not exist.

    Each has one distance a saved time for density and angle, (T,) each. `discretisation_spread` is
    the uncertainty of `discretisation`, `offset_spread` that of `closure` or `finite_n`.
    """

    discretisation: Errors | None = None
    closure: Errors | None = None
    finite_n: Errors | None = None
    sampling: Errors | None = None
    discretisation_spread: Errors | None = None
    offset_spread: Errors | None = None


def bin_result(result: Result, group_size: int | None = None) -> Bins:
    """A result's masses on the common bins.

    Parameters
    ----------
    result : Result
    group_size : int, optional
        Particles in an independent group (those of a realisation); None for a run that is not random,
        which is one group. Fewer groups of several realisations are made where there are too many.
    """
    if group_size is None:
        area = result.scene.domain.width * result.scene.domain.height / DENSITY_CELLS**2
        times = result.times.size
        density = result.density(DENSITY_CELLS).reshape(1, times, -1) * area
        return Bins(density, centred_angles(result)[None], 0)
    return _bin_groups(result, group_size)


def _bin_groups(result: Result, group_size: int) -> Bins:
    times = result.times.size
    total = result.variables["x"][0].size
    size = group_size * int(np.ceil(total // group_size / MOST_GROUPS))
    count = total // size

    def grouped(values: NDArray[np.generic]) -> NDArray[np.generic]:
        return values.reshape(times, -1)[:, : count * size].reshape(times, count, size)

    x, y, angle = (grouped(result.variables[name]) for name in ("x", "y", "angle"))
    frozen = None if result.frozen is None else grouped(result.frozen)
    domain = result.scene.domain
    area = domain.width * domain.height / DENSITY_CELLS**2
    density = np.empty((count, times, DENSITY_CELLS**2))
    angles = np.empty((count, times, ANGLE_BINS))
    width = FULL_TURN / ANGLE_BINS
    for k in range(count):
        for t in range(times):
            gone = None if frozen is None else frozen[t, k]
            ranges = domain.x, domain.y, DENSITY_CELLS
            cells = particle_density(x[t, k], y[t, k], *ranges, gone)
            density[k, t] = cells.ravel() * area
            turned = angle[t, k] + 0.5 * width  # as in `centred_angles`
            angles[k, t] = particle_angles(turned, ANGLE_BINS, gone) * width
    return Bins(density, angles, size)


def first_groups(bins: Bins, count: int) -> Bins:
    """The first `count` groups: those that start where another run's first `count` do."""
    return bins._replace(density=bins.density[:count], angle=bins.angle[:count])


def extrapolate(fine: Bins, coarse: Bins, ratio: float, order: float = ORDER) -> Bins:
    """Richardson: fine + (fine - coarse)/(ratio^order - 1), of runs without groups.

    Bins that would become negative are set to 0, the others scaled down to the mass of `fine`.

    ratio : spacing of `coarse` over that of `fine`, above 1
    """
    weight = 1.0 / (ratio**order - 1.0)

    def further(near: Floats, far: Floats) -> Floats:
        refined = np.maximum(near + weight * (near - far), 0.0)
        mass, target = refined.sum(axis=-1, keepdims=True), near.sum(axis=-1, keepdims=True)
        return np.asarray(refined * target / np.maximum(mass, 1e-300))

    return Bins(further(fine.density, coarse.density), further(fine.angle, coarse.angle), 0)


def remaining_distance(fine: Bins, middle: Bins, coarse: Bins | None) -> Errors:
    """How far a sequence of grids still has to go, at most 2: see the uncertainty in the module's head.

    coarse : None where there are but two levels
    """
    last = distance(fine, middle)[0]
    if coarse is None:
        return last
    before = distance(middle, coarse)[0]
    distances = []
    for d, d_before in ((last.density, before.density), (last.angle, before.angle)):
        ratio = np.minimum(d / np.maximum(d_before, 1e-300), 1.0 - 1e-3)
        distances.append(np.minimum(d * np.maximum(1.0, ratio / (1.0 - ratio)), _NO_OVERLAP))
    return Errors(*distances)


def expected_l1(differences: Floats) -> Estimate:
    """|E d| of K groups of differences (K, T, bins); see the module's head. K = 1: plain |d|."""
    count = min(_FOLDS, differences.shape[0])
    if count == 1:
        value = np.abs(differences[0]).sum(axis=-1)
        return Estimate(value, np.zeros_like(value))
    folds = _merged(differences, count)
    others = folds.sum(axis=0) - folds
    terms = (np.sign(others) * folds).sum(axis=-1)
    spread = terms.std(axis=0, ddof=1) / np.sqrt(count)
    return Estimate(np.maximum(terms.mean(axis=0), 0.0), spread)


def _subtract(a: Floats, b: Floats) -> Floats:
    """Differences of groups, (min(K_a, K_b), T, bins); one group is set against all of the other's."""
    if 1 in (a.shape[0], b.shape[0]):
        return a - b
    count = min(a.shape[0], b.shape[0])
    return _merged(a, count) - _merged(b, count)


def _merged(values: Floats, count: int) -> Floats:
    """Means of `count` runs of neighbouring groups."""
    return np.array([part.mean(axis=0) for part in np.array_split(values, count)])


def distance(a: Bins, b: Bins) -> tuple[Errors, Errors]:
    """|E B(a) - E B(b)| and its standard error, noise of either taken out as far as it has groups."""
    density = expected_l1(_subtract(a.density, b.density))
    angle = expected_l1(_subtract(a.angle, b.angle))
    return Errors(density.value, angle.value), Errors(density.spread, angle.spread)


def total_error(run: Bins, reference: Bins) -> Errors:
    """|B(run) - Y| with the run's own noise, and without the reference's as far as that has groups."""
    whole = Bins(run.density.mean(axis=0)[None], run.angle.mean(axis=0)[None], 0)
    return distance(whole, reference)[0]


def sampling_error(pool: Bins, samples: int) -> Errors:
    """E |B - E B| of a run with this number of samples, by bootstrap over the groups of `pool`.

    A run smaller than one group is estimated from one group by the law 1/sqrt(samples). The pool's finite
    number K of groups makes the draws' spread too small by sqrt(1 - 1/K), which is put right.

    Raises
    ------
    ValueError
        For a pool of fewer than two groups, whose spread is unknown.
    """
    count = pool.density.shape[0]
    if count < 2:
        raise ValueError(f"a pool of two groups or more, not {count}")
    groups = max(1, round(samples / pool.samples))
    generator = np.random.default_rng(0)
    chosen = generator.multinomial(groups, np.full(count, 1.0 / count), size=_DRAWS) / groups
    scale = np.sqrt(groups * pool.samples / samples * count / (count - 1.0))
    errors = []
    for values in (pool.density, pool.angle):
        draws = np.tensordot(chosen, values, axes=1) - values.mean(axis=0)
        errors.append(scale * np.abs(draws).sum(axis=-1).mean(axis=0))
    return Errors(*errors)

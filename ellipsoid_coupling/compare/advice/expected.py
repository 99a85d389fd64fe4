"""What a resolution's error and time will be, from coarser runs of the same model and scheme.

B_1, B_2, ... are the binned masses of the runs so far, the finest first, Y those of the reference, |.| the
L1 distance (`compare.error_budget`), all at each saved time; the largest over these times counts.

    a run that is there       |B_1 - Y|
    a finer grid              |R + (h/h_1)^p (B_1 - R) - Y|, R extrapolated from B_1 and B_2, the order p
                              from three runs, between 1/2 and 2; 1 where there are but two
    more random samples       (o^2 + s^2 n_1/n)^(1/2), o the offset of the expectation without noise, s
                              the sampling error of B_1 with its n_1 samples, by bootstrap
    more even samples         falls by the mean factor of the last levels, at most 3 a level

The modelling error is what is left with an infinite resolution: |R - Y| of a grid, o of an ensemble of
particles. The reference may be off by u. What a run and the reference are off has little in common, so that
|B - Y| between both becomes (|B - Y|^2 + u^2)^(1/2), and a quarter of u more, as little is not nothing.
Samples of the reference's own model err as it does: u adds to theirs in full. Half of how far B_1 was
extrapolated is added to either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.advice.reference import AdviceReference
from ellipsoid_coupling.compare.cheapest import Kind
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import (
    ORDER,
    Bins,
    distance,
    extrapolate,
    sampling_error,
    total_error,
)
from ellipsoid_coupling.compare.frontier import LevelRun, coarser_and_coarser
from ellipsoid_coupling.compare.resolutions import Level, Refinement

Floats = NDArray[np.float64]

_LEAST_ORDER = 0.5
_ORDER_OF_TWO_RUNS = 1.0
# Distances of three levels that fall by less than this do not converge.
_SLOWEST = 0.99
# A level of even samples has twice as many of them, and steps and nodes to match.
_LARGEST_FALL = 3.0
# Of how far the reference may be off, the part that runs may share.
_IN_COMMON = 0.25
# Of what is extrapolated, the part that may be wrong.
_DOUBT = 0.5
# An offset below so many standard errors of its estimate may be none; see `frontier_report`.
_NOISE = 4.0
# Seconds of a finer level than any that was run may be off by this factor either way.
_TIME_DOUBT = 2.0
# Those of one that was run, on a machine that does something else as well.
_TIME_NOISE = 1.25


class Interval(NamedTuple):
    """A number between two others, within which it is expected."""

    low: float
    value: float
    high: float

    @classmethod
    def around(cls, value: float, doubt: float) -> Interval:
        """A number that may be off by `doubt` either way, not below 0."""
        return cls(max(0.0, value - doubt), value, value + doubt)


@dataclass
class Course:
    """One model and scheme on its way from coarse to fine.

    Attributes
    ----------
    refinement : Refinement
    runs : list of LevelRun
        Of its levels, in their order; the status tells why one has no bins.
    ended : str
        Why no finer level is run; "" while one may be.
    known : dict
        Errors that were asked for, by level and number of runs.
    """

    refinement: Refinement
    runs: list[LevelRun] = field(default_factory=list)
    ended: str = ""
    known: dict[tuple[int, int], Interval | None] = field(default_factory=dict)

    @property
    def next_level(self) -> Level | None:
        """The level to run next; None at the end."""
        levels = self.refinement.levels
        return None if self.ended or len(self.runs) == len(levels) else levels[len(self.runs)]

    @property
    def finest(self) -> tuple[int, LevelRun] | None:
        """Number and run of the finest level that came to its end; None without one."""
        done = [(k, run) for k, run in enumerate(self.runs) if run.bins is not None]
        return done[-1] if done else None

    def seconds(self, number: int) -> Interval | None:
        """What a level takes, or will; None before the first run."""
        if number < len(self.runs) and (timed := self.runs[number].timed) is not None:
            return Interval(timed.best, timed.best, max(timed.median, _TIME_NOISE * timed.best))
        if self.finest is None:
            return None
        _, run = self.finest
        assert run.timed is not None
        value = run.timed.best * self.refinement.levels[number].cost / run.level.cost
        return Interval(value / _TIME_DOUBT, value, _TIME_DOUBT * value)


class Judge(NamedTuple):
    """What errors are measured by: a reference, and which of its quantities."""

    reference: AdviceReference
    quantity: Kind

    def worst(self, errors: Errors) -> float:
        """The largest over the saved times."""
        return float(np.max(getattr(errors, self.quantity)))

    @property
    def doubt(self) -> float:
        """How far the reference may be off."""
        return self.worst(self.reference.spread)

    def error(self, course: Course, number: int) -> Interval | None:
        """The error of a level; None where nothing tells of it."""
        key = number, len(course.runs)
        if key not in course.known:
            course.known[key] = self._error(course, number)
        return course.known[key]

    def _error(self, course: Course, number: int) -> Interval | None:
        if number < len(course.runs):
            bins = course.runs[number].bins
            return None if bins is None else self._measured(course, bins)
        if course.finest is None:
            return None
        if course.refinement.kind.is_grid:
            return self._of_grid(course, course.refinement.levels[number].spacing)
        at, run = course.finest
        assert run.bins is not None
        if run.bins.density.shape[0] > 1:
            return self._of_ensemble(course, course.refinement.levels[number])
        return self._of_samples(course, number - at)

    def floor(self, course: Course) -> Interval | None:
        """The modelling error; None where it is 0, or nothing tells of it."""
        kind = course.refinement.kind
        if course.finest is None or kind.is_sampled_density:
            return None
        if kind.is_grid:
            return self._of_grid(course, 0.0)
        _, run = course.finest
        assert run.bins is not None
        if run.bins.density.shape[0] == 1:
            return None
        value, spread = map(self.worst, distance(run.bins, self.reference.bins))
        return Interval.around(value, math.hypot(_NOISE * spread, self.doubt))

    def _measured(self, course: Course, bins: Bins) -> Interval:
        value = self.worst(total_error(bins, self.reference.bins))
        return self._with_reference(course, value, 0.0)

    def _with_reference(self, course: Course, value: float, doubt: float) -> Interval:
        """An error with its own doubt and that of the reference; see the module."""
        u = self.doubt
        if course.refinement.kind.name == self.reference.name:
            return Interval.around(value, u + doubt)
        low = math.sqrt(max(0.0, value**2 - u**2))
        doubt += _IN_COMMON * u
        return Interval(max(0.0, low - doubt), value, math.hypot(value, u) + doubt)

    def _of_grid(self, course: Course, spacing: float) -> Interval | None:
        """At a spacing; 0 for the limit of all refinement."""
        chain = coarser_and_coarser(course.runs)
        if len(chain) < 2:
            return None
        (h, fine), (h_middle, middle) = chain[:2]
        order = self._order(chain)
        refined = extrapolate(fine, middle, h_middle / h, order)
        left = (spacing / h) ** order
        ahead = Bins(
            refined.density + left * (fine.density - refined.density),
            refined.angle + left * (fine.angle - refined.angle),
            0,
        )
        value = self.worst(distance(ahead, self.reference.bins)[0])
        doubt = _DOUBT * self.worst(distance(ahead, fine)[0])
        if spacing == 0.0:
            doubt = max(doubt, self._still_to_come(chain))
        return self._with_reference(course, value, doubt)

    def _still_to_come(self, chain: Sequence[tuple[float, Bins]]) -> float:
        """How far a grid would still move if the last distances went on like this: d q/(1 - q)."""
        runs = [bins for _, bins in chain[:3]]
        steps = [self.worst(distance(*two)[0]) for two in pairwise(runs)]
        fall = min(steps[0] / max(steps[-1], 1e-300), _SLOWEST) if len(steps) > 1 else 0.5
        return steps[0] * fall / (1.0 - fall)

    def _order(self, chain: Sequence[tuple[float, Bins]]) -> float:
        """The order p that three runs show: |B_2 - B_3| is (h_2/h_1)^p times |B_1 - B_2|, or so."""
        if len(chain) < 3:
            return _ORDER_OF_TWO_RUNS
        (h, fine), (_, middle), (h_coarse, coarse) = chain[:3]
        near, far = (self.worst(distance(*two)[0]) for two in ((fine, middle), (middle, coarse)))
        if not near > 0.0:
            return float(ORDER)
        shown = math.log(max(far / near, 1.0)) / math.log(math.sqrt(h_coarse / h))
        return min(max(shown, _LEAST_ORDER), float(ORDER))

    def _of_ensemble(self, course: Course, level: Level) -> Interval:
        """Of a random run with the samples of a level."""
        assert course.finest is not None
        _, run = course.finest
        assert run.bins is not None
        own, more = (_samples(one) for one in (run.level, level))
        offset, spread = map(self.worst, distance(run.bins, self.reference.bins))
        noise = self.worst(sampling_error(run.bins, own))
        found = self.worst(total_error(run.bins, self.reference.bins))
        # The two parts as they add up in the run that is there.
        scale = found / max(math.hypot(offset, noise), 1e-300)
        value = scale * math.hypot(offset, noise * math.sqrt(own / more))
        return self._with_reference(course, value, _DOUBT * abs(found - value) / 2 + spread)

    def _of_samples(self, course: Course, ahead: int) -> Interval | None:
        """Of even samples, so many levels beyond the finest run."""
        found = [
            self.worst(total_error(run.bins, self.reference.bins))
            for run in course.runs
            if run.bins is not None
        ][-3:]
        if len(found) < 2 or not min(found) > 0.0:
            return None
        fall = (found[0] / found[-1]) ** (1.0 / (len(found) - 1))
        fall = min(max(fall, 1.0), _LARGEST_FALL)
        value = found[-1] / fall**ahead
        likely = self._with_reference(course, value, _DOUBT * (found[-1] - value))
        # Coarse steps may hide how the error falls: the limit itself has none.
        best = self._with_reference(course, found[-1] / _LARGEST_FALL**ahead, 0.0)
        return likely._replace(low=min(likely.low, best.low))


def _samples(level: Level) -> int:
    particles = level.scene.particles
    return particles.number * particles.realisations

"""The stationary scene of workflows/paper.py: decay to q_stat for eight noise strengths.

The microscopic model with `accurate`, the q-equation with the paper's scheme as well.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from paper_page import Page, Verdict

from ellipsoid_coupling import Result, load_scene, simulate
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.models import SCHEMES, SchemeName
from ellipsoid_coupling.output.figures import DecayCurve, draw_decay, draw_rates
from ellipsoid_coupling.output.figures.decay import RateCurve

Floats = NDArray[np.float64]


class Sizes(NamedTuple):
    """How large the runs are.

    amplitudes : A = B, of the decay
    scene : settings of every run
    saved : times of a decay
    longest, compared, late : end times of a decay, with and without interaction, with large noise
    """

    amplitudes: tuple[float, ...]
    scene: dict[str, Any]
    saved: int
    longest: float
    compared: float
    late: float


FULL = Sizes((0.0, 0.2, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0), {}, 40, 40.0, 6.0, 30.0)
# Seconds instead of minutes; the verdicts mean nothing.
_TINY = {"particles.realisations": 2, "particles.number": 60, "numerics.cell": 0.8}
QUICK = Sizes((0.2, 5.0), _TINY, 8, 2.0, 1.0, 2.0)
# Curves of the figures: title, model, scheme.
CURVES: tuple[tuple[str, str, SchemeName], ...] = (
    ("microscopic", "microscopic", "accurate"),
    ("q_maxwellian", "q_maxwellian", "accurate"),
    ("q, Maxwellian, paper", "q_maxwellian", "paper"),
)
# Which of them a verdict on the q-equation is about.
JUDGED = {"paper": CURVES[2][0], "accurate": CURVES[1][0]}
# Bounds, from the words. "Little": two curves that a figure shows as one.
LITTLE = 0.2
# "Holds" and "fails": the error, as a part of the density itself, both in L2.
HOLDS, FAILS = 0.2, 0.5
BINS = 30
LARGE = 5.0


def exact_rate(amplitude: float) -> float:
    """Decay rate of the means without interaction: x'' + (A^2/2) x' + x = 0."""
    half = amplitude**2 / 4.0
    return half if amplitude <= 2.0 else half - math.sqrt(half**2 - 1.0)


def run_length(amplitude: float, longest: float) -> float:
    """Until the distance has fallen a hundredfold, or `longest`."""
    rate = exact_rate(amplitude)
    return longest if rate == 0.0 else min(longest, 1.3 * math.log(100.0) / rate)


def distances(result: Result, stationary_density: Floats) -> Floats:
    """L2 distance of the density on 30 x 30 bins to that of q_stat at each time, (T,)."""
    area = (result.scene.domain.width / BINS) ** 2
    difference = result.density(BINS) - stationary_density
    return np.asarray(np.sqrt((difference**2).sum(axis=(1, 2)) * area))


def envelope(curve: DecayCurve) -> Floats:
    """The largest distance from each time on: an oscillation's decay without its zeros, (T,)."""
    return np.asarray(np.maximum.accumulate(curve.distance[::-1])[::-1])


def fitted_rate(curve: DecayCurve, floor: float) -> float:
    """Slope of -log of the envelope over time, while it is above `floor`."""
    upper = envelope(curve)
    below = np.flatnonzero(upper <= floor)
    end = max(3, int(below[0])) if below.size else curve.times.size
    return float(-np.polyfit(curve.times[:end], np.log(upper[:end]), 1)[0])


def rises(curve: DecayCurve, floor: float) -> int:
    """How often the distance grows by more than a tenth before its envelope is at the floor."""
    kept = curve.distance[envelope(curve) > floor]
    return int(np.sum(kept[1:] > 1.1 * kept[:-1]))


def stationary(page: Page) -> None:
    """Statements 1 and 8."""
    sizes = QUICK if page.quick else FULL
    curves: dict[str, list[DecayCurve]] = {title: [] for title, _, _ in CURVES}
    reference = simulate(load_scene("stationary", {"times": [1.0]}), "stationary_state")
    page.tell_run(reference)
    target = reference.density(BINS)[-1]
    for amplitude in sizes.amplitudes:
        times = np.linspace(0.0, run_length(amplitude, sizes.longest), sizes.saved + 1)[1:]
        noise = {"noise": amplitude, "angular_noise": amplitude}
        changes = {"times": [float(t) for t in times], "noise": noise}
        scene = load_scene("stationary", sizes.scene | changes)
        for title, model, scheme in CURVES:
            try:
                result = simulate(scene, model, scheme, report=page.report)
            except RunError as error:
                page.tell_failure(scene.name, model, scheme, str(error))
                continue
            page.tell_run(result)
            curves[title].append(DecayCurve(amplitude, result.times, distances(result, target)))
    particles = scene.particles
    floors = {
        # A hundredth of the start's distance: the fall that the page follows.
        title: 0.01 * float(max(curve.distance.max() for curve in curves[title]))
        for title in JUDGED.values()
    } | {"microscopic": 3.0 * _sampling_floor(target, particles.number * particles.realisations)}
    _figures(page, curves, floors)
    for judged, title in JUDGED.items():
        whole = len(curves[title]) == len(sizes.amplitudes)
        _judge_decay(page, (judged, whole), curves[title], floors[title])
    _judge_interaction(page, sizes, target)
    _judge_large_noise(page, sizes, target)


def _sampling_floor(density: Floats, samples: int) -> float:
    """Expected L2 distance of a histogram of independent samples to its law."""
    area = (12.0 / BINS) ** 2
    mass = density * area
    return float(np.sqrt((mass * (1.0 - mass)).sum() / samples / area))


def _figures(page: Page, curves: dict[str, list[DecayCurve]], floors: dict[str, float]) -> None:
    path = page.folder / "stationary_decay.png"
    page.add(draw_decay(curves, path), "Distance to the stationary solution over time.")
    rates = {
        model: RateCurve(
            np.array([curve.amplitude for curve in lines]),
            np.array([fitted_rate(curve, floors[model]) for curve in lines]),
        )
        for model, lines in curves.items()
    }
    fine = np.linspace(0.05, 10.0, 200)
    exact = RateCurve(fine, np.array([exact_rate(a) for a in fine]))
    path = page.folder / "stationary_rates.png"
    caption = "Fitted decay rate over A = B; grey: the means without interaction."
    page.add(draw_rates(rates, path, exact=exact), caption)


def _judge_decay(
    page: Page, scheme: tuple[str, bool], lines: list[DecayCurve], floor: float
) -> None:
    """The first half of statement 1; scheme = (name, whether all its runs came to their end)."""
    rate = {curve.amplitude: fitted_rate(curve, floor) for curve in lines}
    grown = {curve.amplitude: rises(curve, floor) for curve in lines}
    fastest = max(rate, key=lambda amplitude: rate[amplitude])
    name, whole = scheme
    counts = "times the distance grew by a tenth, A = B: " + ", ".join(
        f"{a:g}: {count}" for a, count in grown.items()
    )
    rates = "fitted rate, A = B: " + ", ".join(f"{a:g}: {r:.3f}" for a, r in rate.items())
    for statement, holds, evidence in (
        (
            "1a. Stationary: oscillating decay for A = B below 1",
            all(count > 0 for a, count in grown.items() if a < 1.0),
            counts,
        ),
        (
            "1b. Stationary: monotone decay for A = B above 1",
            all(count == 0 for a, count in grown.items() if a > 1.0),
            counts,
        ),
        ("1c. Stationary: the decay is fastest in between", 1.0 <= fastest <= 3.0, rates),
    ):
        page.judge(Verdict(statement, whole and holds, evidence, name))


def _judge_interaction(page: Page, sizes: Sizes, target: Floats) -> None:
    """The second half of statement 1: A = B = 1 with and without interaction."""
    times = np.linspace(0.0, sizes.compared, 25)[1:]
    settings = sizes.scene | {"times": [float(t) for t in times]}
    bare = settings | {"interaction": None}
    alone = simulate(load_scene("stationary", bare | {"times": [1.0]}), "stationary_state")
    targets = (target, alone.density(BINS)[-1])
    for scheme in SCHEMES:
        runs = [
            simulate(load_scene("stationary", s), "q_maxwellian", scheme) for s in (settings, bare)
        ]
        with_it, without = (distances(run, t) for run, t in zip(runs, targets, strict=True))
        apart = float(np.abs(with_it - without).max() / with_it[0])
        page.judge(
            Verdict(
                "1d. Stationary: interaction matters little",
                apart < LITTLE,
                f"the two decay curves of q_maxwellian at A = B = 1 are at most {100 * apart:.0f} % of "
                f"the start's distance apart, bound {100 * LITTLE:.0f} %",
                scheme,
            )
        )


def _judge_large_noise(page: Page, sizes: Sizes, target: Floats) -> None:
    """Statement 8: which closure finds the stationary density at A = B = 5."""
    noise: dict[str, Any] = {"noise": {"noise": LARGE, "angular_noise": LARGE}}
    scene = load_scene("stationary", sizes.scene | noise | {"times": [sizes.late]})
    size = float(np.sqrt((target**2).sum()) * scene.domain.width / BINS)
    for scheme in SCHEMES:
        away = {}
        for model in ("q_maxwellian", "q_mono_kinetic"):
            try:
                result = simulate(scene, model, scheme, report=page.report)
            except RunError as error:
                page.tell_failure(scene.name, model, scheme, str(error))
                away[model] = float("inf")
                continue
            page.tell_run(result)
            away[model] = float(distances(result, target)[-1]) / size
        evidence = (
            f"L2 distance to the stationary density, as a part of it, at A = B = {LARGE:g}, t = "
            f"{sizes.late:g}: " + ", ".join(f"{model} {far:.2f}" for model, far in away.items())
        )
        for statement, holds in (
            ("8a. With large A, B the mono-kinetic closure fails", away["q_mono_kinetic"] >= FAILS),
            ("8b. With large A, B the Maxwellian closure holds", away["q_maxwellian"] <= HOLDS),
        ):
            page.judge(Verdict(statement, holds, evidence, scheme))

"""The stationary scene of workflows/paper.py: decay to q_stat for eight noise strengths."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from paper_page import Page, Verdict

from ellipsoid_coupling import Result, load_scene, simulate
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.output.figures import DecayCurve, draw_decay, draw_rates
from ellipsoid_coupling.output.figures.decay import RateCurve

Floats = NDArray[np.float64]

AMPLITUDES = (0.0, 0.2, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
MODELS = ("microscopic", "q_maxwellian")
LONGEST = 40.0
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
    realisations = 16 if page.quick else 128
    longest = 10.0 if page.quick else LONGEST
    curves: dict[str, list[DecayCurve]] = {model: [] for model in MODELS}
    reference = simulate(load_scene("stationary", {"times": [1.0]}), "stationary_state")
    page.tell_run(reference)
    target = reference.density(BINS)[-1]
    for amplitude in AMPLITUDES:
        times = np.linspace(0.0, run_length(amplitude, longest), 41)[1:]
        settings = {"times": [float(t) for t in times], "particles.realisations": realisations}
        noise = {"noise": amplitude, "angular_noise": amplitude}
        scene = load_scene("stationary", settings | {"noise": noise})
        for model in MODELS:
            result = simulate(scene, model, report=page.report)
            page.tell_run(result)
            curves[model].append(DecayCurve(amplitude, result.times, distances(result, target)))
    floors = {
        "microscopic": 3.0 * _sampling_floor(target, 200 * realisations),
        # A hundredth of the start's distance: the fall that the page follows.
        "q_maxwellian": 0.01 * float(curves["q_maxwellian"][0].distance.max()),
    }
    _figures(page, curves, floors)
    _judge_decay(page, curves["q_maxwellian"], floors["q_maxwellian"])
    _judge_interaction(page, target)
    _judge_large_noise(page, target)


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
            np.array(AMPLITUDES), np.array([fitted_rate(curve, floors[model]) for curve in lines])
        )
        for model, lines in curves.items()
    }
    fine = np.linspace(0.05, 10.0, 200)
    exact = RateCurve(fine, np.array([exact_rate(a) for a in fine]))
    path = page.folder / "stationary_rates.png"
    caption = "Fitted decay rate over A = B; grey: the means without interaction."
    page.add(draw_rates(rates, path, exact=exact), caption)


def _judge_decay(page: Page, lines: list[DecayCurve], floor: float) -> None:
    rate = {curve.amplitude: fitted_rate(curve, floor) for curve in lines}
    grown = {curve.amplitude: rises(curve, floor) for curve in lines}
    fastest = max(rate, key=lambda amplitude: rate[amplitude])
    holds = (
        all(grown[a] > 0 for a in AMPLITUDES if a < 1.0)
        and all(grown[a] == 0 for a in AMPLITUDES if a > 1.0)
        and 1.0 <= fastest <= 3.0
    )
    page.judge(
        Verdict(
            "1. Stationary: oscillating decay for A = B below 1, monotone above, fastest in between",
            holds,
            "q_maxwellian, A = B: times the distance grew by a tenth, fitted rate - "
            + "; ".join(f"{a:g}: {grown[a]}, {r:.3f}" for a, r in rate.items()),
        )
    )


def _judge_interaction(page: Page, target: Floats) -> None:
    """The second half of statement 1: A = B = 1 with and without interaction."""
    settings = {"times": [float(t) for t in np.linspace(0.25, 6.0, 24)]}
    bare = settings | {"interaction": None}
    alone = simulate(load_scene("stationary", bare | {"times": [1.0]}), "stationary_state")
    runs = [simulate(load_scene("stationary", s), "q_maxwellian") for s in (settings, bare)]
    targets = (target, alone.density(BINS)[-1])
    with_it, without = (distances(run, t) for run, t in zip(runs, targets, strict=True))
    apart = float(np.abs(with_it - without).max() / with_it[0])
    page.judge(
        Verdict(
            "1b. Stationary: interaction matters little",
            apart < 0.2,
            f"the two decay curves of q_maxwellian at A = B = 1 are at most {100 * apart:.0f} % of the "
            "start's distance apart",
        )
    )


def _judge_large_noise(page: Page, target: Floats) -> None:
    """Statement 8: which closure finds the stationary density at A = B = 5."""
    noise = {"noise": LARGE, "angular_noise": LARGE}
    scene = load_scene("stationary", {"noise": noise, "times": [30.0]})
    away = {}
    for model in ("q_maxwellian", "q_mono_kinetic"):
        try:
            result = simulate(scene, model, report=page.report)
        except RunError as error:
            page.tell_failure(scene.name, model, str(error))
            away[model] = float("inf")
            continue
        page.tell_run(result)
        away[model] = float(distances(result, target)[-1])
    page.judge(
        Verdict(
            "8. With large A, B the mono-kinetic closure fails and the Maxwellian one holds",
            away["q_mono_kinetic"] > 5.0 * away["q_maxwellian"],
            f"L2 distance to the stationary density at A = B = {LARGE:g}, t = 30: "
            + ", ".join(f"{model} {distance:.3f}" for model, distance in away.items()),
        )
    )

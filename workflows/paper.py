"""The paper again: every figure, and a verdict on each of its statements, as one page.

    .venv/bin/python workflows/paper.py [--quick] [--out DIR]

Runs the paper's scenes with the models that it shows, with its own scheme, cells and steps (`paper`) and
with the package's (`accurate`), and `mckean_vlasov` beside them. Leaves figures and `index.html` in one
folder. A statement that does not reproduce is reported as such, with the number that decides it; one with
two parts is judged in two. `--quick` is tiny and shows that all of it works: its verdicts mean nothing.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from paper_page import Page, Verdict
from paper_runs import (
    LIMIT,
    Floats,
    all_within,
    distances,
    judge_both,
    run_scene,
    scene_figures,
    sizes_of,
    text_of,
)
from paper_stationary import stationary

from ellipsoid_coupling import Result, load_scene, simulate
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.output.figures import draw_convergence, draw_sketch, fitted_slope
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.simulation import scene_flow

# Bounds of the verdicts: each follows from the paper's words, not from the results.
# Distances are L1 sums over 20 x 20 cells or 60 angles (`compare.distances`): twice the part of the mass
# that lies in another bin, 2 is no overlap.
# "Very good agreement": less than a twentieth of the mass lies elsewhere, which no panel shows.
VERY_GOOD = 0.1
# "Alike", "follows", "captures", "good agreement": a tenth, which a reader of two panels forgives.
ALIKE = 0.2
# "Deviates": a fifth; between the two it is neither.
DEVIATES = 0.4
# "Better", "closer", "sooner": by a tenth at least, because seeds alone change a result by some percent.
BETTER = 0.9
# "Costs much more": a difference that is seen without a clock.
MUCH_MORE = 5.0
# "A sharp peak": so much of the mass in one angle of 60.
PEAK = 0.9
# The mono-kinetic closures end where characteristics cross, all at x = 0.
CROSSING = 2.418


def main(arguments: Sequence[str] | None = None) -> Path:
    """Make the page; returns its folder."""
    parser = argparse.ArgumentParser(description="every figure of the paper, on one page")
    parser.add_argument("--quick", action="store_true", help="tiny: its verdicts mean nothing")
    parser.add_argument("--out", type=Path, help="folder of the page")
    options = parser.parse_args(arguments)
    folder = options.out or Path("results") / time.strftime("paper-%Y%m%d-%H%M%S")
    folder.mkdir(parents=True, exist_ok=True)
    with ProgressReporter() as report:
        page = Page(folder, options.quick, report)
        page.add(draw_sketch(folder / "ellipse.png"), "Position, orientation and velocity.")
        stationary(page)
        top_bottom(page)
        rotation(page)
        cavity(page)
    path = page.write()
    sys.stdout.write(f"{path}\n{folder}\n")
    return folder


def spread(result: Result) -> Floats:
    """The root mean square of the angle about 0 (pi-periodic) at each time, (T,)."""
    bins = 180
    centres = (np.arange(bins) + 0.5) * 2.0 * math.pi / bins
    folded = np.mod(centres + 0.5 * math.pi, math.pi) - 0.5 * math.pi
    weights = result.angle_distribution(bins) * 2.0 * math.pi / bins
    return np.asarray(np.sqrt(weights @ folded**2))


def top_bottom(page: Page) -> None:
    """Statements 2 to 5."""
    closures = ("q_mono_kinetic", "rho_mono_kinetic")
    models = ("microscopic", *closures, "diffusive")
    runs = run_scene(page, "top_bottom", models)
    scene_figures(page, "top_bottom", runs)

    def deviates(results: dict[str, Result]) -> tuple[bool, str]:
        first = float(distances(results)["diffusive"][0][0])
        return first >= DEVIATES, f"L1 density at the first time, bound {DEVIATES:g}: {first:.2f}"

    def closer(results: dict[str, Result]) -> tuple[bool, str]:
        wide = {model: spread(result)[:1] for model, result in results.items()}
        if runs.limit:
            wide[LIMIT] = spread(runs.limit)[:1]
        holds = wide["rho_mono_kinetic"][0] < BETTER * wide["microscopic"][0]
        return bool(holds), (
            f"rms angle at the first time: {text_of(wide)}. The microscopic spread is a finite-N effect: "
            "the mean-field limit, which q and rho approximate, keeps the angle near 0; a first-order "
            "q scheme spreads it numerically"
        )

    def much_more(results: dict[str, Result]) -> tuple[bool, str]:
        ratio = step_seconds(results["diffusive"]) / step_seconds(results["rho_mono_kinetic"])
        return ratio > MUCH_MORE, (
            f"a step costs {ratio:.1f} times one of the rho-equation (two evaluations of the "
            "interaction instead of one): harmonics in both angles precompute what the paper could not"
        )

    micro, q, rho, diffusive = models
    for statement, needed, decide in (
        (
            "2a. Top-bottom: q and rho follow the microscopic density up to the crossing",
            (micro, q, rho),
            lambda found: all_within(found, closures, "density", ALIKE, CROSSING),
        ),
        ("2b. Top-bottom: the diffusive limit deviates", (micro, diffusive), deviates),
        (
            "3a. Top-bottom angles: q captures the microscopic distribution up to the crossing",
            (micro, q),
            lambda found: all_within(found, closures[:1], "angle", ALIKE, CROSSING),
        ),
        ("3b. Top-bottom angles: rho stays closer to 0", (micro, rho), closer),
        ("5. The diffusive equations cost much more", (rho, diffusive), much_more),
    ):
        judge_both(page, runs, statement, needed, decide)
    if runs.limit:
        approach_of_the_limit(page, float(spread(runs.limit)[0]))
    _judge_numerical_diffusion(page)


def step_seconds(result: Result) -> float:
    """Wall time of a step."""
    return float(result.attributes["wall_seconds"] / result.attributes["steps"])


def approach_of_the_limit(page: Page, limit: float) -> None:
    """The microscopic spread about the mean-field limit's over N: like N^(-1/2)."""
    numbers = (30, 60, 120) if page.quick else (250, 1000, 4000, 16000)
    samples = 240 if page.quick else 64000
    beyond = []
    for number in numbers:
        settings = {"particles.number": number, "times": [0.75]}
        scene = load_scene("top_bottom", settings)
        realisations = max(2, samples // number)
        result = simulate(scene, "microscopic", realisations=realisations, report=page.report)
        page.tell_run(result)
        beyond.append(math.sqrt(float(spread(result)[0]) ** 2 - limit**2))
    path = draw_convergence(
        "microscopic",
        numbers,
        beyond,
        page.folder / "top_bottom_limit.png",
        quantity="rms angle beyond the mean-field limit's",
    )
    slope = fitted_slope(numbers, beyond)
    page.add(
        path, f"Top-bottom flow, t = 0.75: the angular spread falls like N to the {slope:.2f}."
    )


def _judge_numerical_diffusion(page: Page) -> None:
    """Statement 4: the paper's own scheme, the q-equation with ever narrower angle cells."""
    cell, numbers = (0.3, (6, 12, 24)) if page.quick else (0.1, (60, 120, 240))
    own = {"numerics.cell": cell, "times": [0.75]}
    wide = {}
    for angles in numbers:
        scene = load_scene("top_bottom", own | {"numerics.angle_cells": angles})
        result = simulate(scene, "q_mono_kinetic", "paper", report=page.report)
        wide[angles] = float(spread(result)[0])
    scene = load_scene("top_bottom", own)
    rho = float(spread(simulate(scene, "rho_mono_kinetic", "paper", report=page.report))[0])
    few, more, most = (wide[angles] for angles in numbers)
    page.judge(
        Verdict(
            "4. rho looks less diffusive than q because q carries more numerical diffusion",
            few > rho and few > more > most,
            f"rms angle of the scheme `paper` at t = 0.75, h = {cell:g}: rho {rho:.3f}, q with "
            + ", ".join(f"{angles} angles {value:.3f}" for angles, value in wide.items())
            + ": the spread falls with the angle cells' width, so it is numerical",
        )
    )


def rotation(page: Page) -> None:
    """Statement 6."""
    closures = ("q_mono_kinetic", "rho_mono_kinetic")
    models = ("microscopic", *closures)
    runs = run_scene(page, "rotation", models)
    scene_figures(page, "rotation", runs)

    def better(results: dict[str, Result]) -> tuple[bool, str]:
        away = {model: angle for model, (_, angle) in distances(results).items()}
        q, rho = (away[model] for model in closures)
        return bool(np.all(q < BETTER * rho)), f"L1 angle: {text_of(away)}"

    for statement, decide in (
        (
            "6a. Rotation: the densities of all models agree very well",
            lambda found: all_within(found, closures, "density", VERY_GOOD),
        ),
        (
            "6b. Rotation: the angle distributions of all models are alike",
            lambda found: all_within(found, closures, "angle", ALIKE),
        ),
        ("6c. Rotation: the angles are better with q than with rho", better),
    ):
        judge_both(page, runs, statement, models, decide)
    free = load_scene("rotation", sizes_of(page, "rotation") | {"interaction": None})
    alone = simulate(free, "microscopic", flow=scene_flow(free, None, page.report))
    page.tell_run(alone)
    peak = float(alone.angle_distribution(60)[0].max() * 2.0 * math.pi / 60)
    page.judge(
        Verdict(
            "6d. Rotation without interaction: the angle distribution is a sharp peak",
            peak > PEAK,
            f"{100 * peak:.0f} % of the particles in one bin of 60",
        )
    )


def cavity(page: Page) -> None:
    """Statement 7."""
    models = ("microscopic", "rho_mono_kinetic")
    free = run_scene(page, "cavity_free", models)
    scene_figures(page, "cavity_free", free)

    def slight(results: dict[str, Result]) -> tuple[bool, str]:
        angle = distances(results)["rho_mono_kinetic"][1]
        holds = angle[0] < angle[-1] < DEVIATES
        return bool(holds), f"L1 angle, growing, bound {DEVIATES:g}: {text_of({'rho': angle})}"

    def sooner(results: dict[str, Result]) -> tuple[bool, str]:
        lid = {m: float(result.density(20)[-1, -1].sum() / 400) for m, result in results.items()}
        return lid["microscopic"] < BETTER * lid["rho_mono_kinetic"], (
            "mass within 0.05 of the lid at t = 5 with matched ghost cells: "
            + ", ".join(f"{model} {mass:.3f}" for model, mass in lid.items())
            + "; with 1/h^2 nothing comes near the lid (workflows/cavity.py)"
        )

    judge_both(
        page,
        free,
        "7a. Cavity without interaction: the densities agree well",
        models,
        lambda found: all_within(found, models[1:], "density", ALIKE),
    )
    judge_both(
        page,
        free,
        "7b. Cavity without interaction: slight angular differences at t = 5",
        models,
        slight,
    )
    full = run_scene(page, "cavity", models)
    scene_figures(page, "cavity", full)
    statement = (
        "7c. Cavity with interaction: the macroscopic solution reaches the upper wall sooner"
    )
    judge_both(page, full, statement, models, sooner)


if __name__ == "__main__":
    run_in_words(main)

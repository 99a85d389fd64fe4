"""The paper again: every figure, and a verdict on each of its statements, as one page.

    .venv/bin/python workflows/paper.py [--quick] [--out DIR]

Runs the paper's scenes with the models that it shows, at its resolutions and ensemble sizes (`--quick`:
a few realisations, wider cells), and leaves figures, run folders and `index.html` in one folder. A
statement that does not reproduce is reported as such, with the number that decides it.
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
from paper_stationary import stationary

from ellipsoid_coupling import Result, load_scene, simulate
from ellipsoid_coupling.compare import errors_against
from ellipsoid_coupling.errors import RunError, run_in_words
from ellipsoid_coupling.output.figures import (
    density_rows,
    draw_angles,
    draw_convergence,
    draw_density,
    draw_ellipses,
    draw_flow,
    draw_sketch,
    fitted_slope,
)
from ellipsoid_coupling.progress import ProgressReporter
from ellipsoid_coupling.simulation import scene_flow

QUICK = {"particles.realisations": 8}
QUICK_CELLS = {"top_bottom": 0.1, "rotation": 0.05, "cavity": 0.01, "cavity_free": 0.01}
SNAPSHOT_PARTICLES = {"top_bottom": 50, "rotation": 20, "cavity": 200, "cavity_free": 200}


def main(arguments: Sequence[str] | None = None) -> Path:
    """Make the page; returns its folder."""
    parser = argparse.ArgumentParser(description="every figure of the paper, on one page")
    parser.add_argument("--quick", action="store_true", help="small ensembles and wide cells")
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


def run_models(
    page: Page, name: str, models: Sequence[str], settings: dict[str, object] | None = None
) -> dict[str, Result]:
    """The scene with each model, scheme `accurate`; one that fails is told on the page."""
    small = QUICK | {"numerics.cell": QUICK_CELLS[name]} if page.quick else {}
    scene = load_scene(name, small | (settings or {}))
    flow = scene_flow(scene, None, page.report)
    results = {}
    for model in models:
        try:
            results[model] = simulate(scene, model, flow=flow, report=page.report)
        except RunError as error:
            page.tell_failure(scene.name, model, str(error))
            continue
        page.tell_run(results[model])
    return results


def scene_figures(page: Page, name: str, results: dict[str, Result]) -> None:
    """Flow, ellipses, densities and angles of one scene."""
    scene = load_scene(name)
    flow = scene_flow(scene, None, page.report)
    shown = list(results.values())
    extent = (*scene.domain.x, *scene.domain.y)
    if flow is not None:
        page.add(draw_flow(flow, extent, page.folder / f"{name}_flow.png"), f"{scene.title}: flow.")
    few = load_scene(name, {"particles.number": SNAPSHOT_PARTICLES[name]})
    snapshot = simulate(few, "microscopic", flow=flow, realisations=1, report=page.report)
    path = page.folder / f"{name}_ellipses.png"
    page.add(draw_ellipses(snapshot, path, flow=flow), f"{scene.title}: ellipses to scale.")
    path = page.folder / f"{name}_density.png"
    page.add(draw_density(density_rows(shown), path), f"{scene.title}: densities.")
    path = page.folder / f"{name}_angles.png"
    page.add(draw_angles(shown, path), f"{scene.title}: angle distributions.")


def spread(result: Result) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """The root mean square of the angle about 0 (pi-periodic) at each time, (T,)."""
    bins = 180
    centres = (np.arange(bins) + 0.5) * 2.0 * math.pi / bins
    folded = np.mod(centres + 0.5 * math.pi, math.pi) - 0.5 * math.pi
    weights = result.angle_distribution(bins) * 2.0 * math.pi / bins
    return np.asarray(np.sqrt(weights @ folded**2))


def distances(results: dict[str, Result], reference: str) -> dict[str, tuple[float, float]]:
    """L1 distances (density, angle) to `reference` at the first time, of every other model."""
    found = {}
    for model, result in results.items():
        if model != reference:
            errors = errors_against(result, results[reference])
            found[model] = (float(errors.density[0]), float(errors.angle[0]))
    return found


def top_bottom(page: Page) -> None:
    """Statements 2 to 5."""
    models = ("microscopic", "q_mono_kinetic", "rho_mono_kinetic", "diffusive")
    results = run_models(page, "top_bottom", models)
    scene_figures(page, "top_bottom", results)
    away = distances(results, "microscopic")
    q, rho, diffusive = (away[model][0] for model in models[1:])
    page.judge(
        Verdict(
            "2. Top-bottom: q and rho follow the microscopic density, the diffusive limit deviates",
            diffusive > 2.0 * max(q, rho),
            f"L1 distance to the microscopic density at the first time: q {q:.2f}, rho {rho:.2f}, "
            f"diffusive {diffusive:.2f}",
        )
    )
    limit = run_models(page, "top_bottom", ("mckean_vlasov",), {"times": [0.75]})
    wide = {model: float(spread(result)[0]) for model, result in (results | limit).items()}
    page.judge(
        Verdict(
            "3. Top-bottom angles: q captures the microscopic distribution, rho stays closer to 0",
            abs(wide["q_mono_kinetic"] - wide["microscopic"]) < 0.5 * wide["microscopic"],
            "rms angle at the first time: "
            + ", ".join(f"{model} {value:.3f}" for model, value in wide.items())
            + ". The microscopic spread is a finite-N effect: the mean-field limit, which q and rho "
            "approximate, keeps the angle near 0; a first-order q scheme spreads it numerically.",
        )
    )
    approach_of_the_limit(page, wide["mckean_vlasov"])
    _judge_numerical_diffusion(page)
    seconds = {
        m: float(r.attributes["wall_seconds"] / r.attributes["steps"]) for m, r in results.items()
    }
    ratio = seconds["diffusive"] / seconds["rho_mono_kinetic"]
    page.judge(
        Verdict(
            "5. The diffusive equations cost much more",
            ratio > 5.0,
            f"a step costs {ratio:.1f} times one of the rho-equation (two evaluations of the "
            "interaction instead of one): harmonics in both angles precompute what the paper could not",
        )
    )


def approach_of_the_limit(page: Page, limit: float) -> None:
    """The microscopic spread about the mean-field limit's over N: like N^(-1/2)."""
    numbers = (250, 1000, 4000) if page.quick else (250, 1000, 4000, 16000)
    beyond = []
    for number in numbers:
        settings = {"particles.number": number, "times": [0.75]}
        scene = load_scene("top_bottom", settings)
        realisations = max(2, 16000 // number if page.quick else 64000 // number)
        result = simulate(scene, "microscopic", realisations=realisations, report=page.report)
        page.tell_run(result)
        beyond.append(math.sqrt(float(spread(result)[0]) ** 2 - limit**2))
    path = draw_convergence(
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
    own = {"numerics.cell": 0.1, "times": [0.75]}
    wide = {}
    for angles in (60, 120, 240):
        scene = load_scene("top_bottom", own | {"numerics.angle_cells": angles})
        result = simulate(scene, "q_mono_kinetic", "paper", report=page.report)
        wide[angles] = float(spread(result)[0])
    scene = load_scene("top_bottom", own)
    rho = float(spread(simulate(scene, "rho_mono_kinetic", "paper", report=page.report))[0])
    page.judge(
        Verdict(
            "4. rho looks less diffusive than q because q carries more numerical diffusion",
            wide[60] > rho and wide[60] > wide[120] > wide[240],
            f"rms angle of the scheme `paper` at t = 0.75, h = 0.1: rho {rho:.3f}, q with "
            + ", ".join(f"{angles} angles {value:.3f}" for angles, value in wide.items())
            + ": the spread falls with the angle cells' width, so it is numerical",
        )
    )


def rotation(page: Page) -> None:
    """Statement 6."""
    models = ("microscopic", "q_mono_kinetic", "rho_mono_kinetic")
    results = run_models(page, "rotation", models)
    scene_figures(page, "rotation", results)
    away = distances(results, "microscopic")
    page.judge(
        Verdict(
            "6a. Rotation: all models alike, angles better with q",
            away["q_mono_kinetic"][1] < away["rho_mono_kinetic"][1],
            "L1 distance to the microscopic (density, angle) at the first time: "
            + ", ".join(f"{model} {d:.2f}, {a:.2f}" for model, (d, a) in away.items()),
        )
    )
    free = run_models(page, "rotation", ("microscopic",), {"interaction": None})
    peak = float(free["microscopic"].angle_distribution(60)[0].max() * 2.0 * math.pi / 60)
    page.judge(
        Verdict(
            "6b. Rotation without interaction: the angle distribution is a sharp peak",
            peak > 0.9,
            f"{100 * peak:.0f} % of the particles in one bin of 60",
        )
    )


def cavity(page: Page) -> None:
    """Statement 7."""
    models = ("microscopic", "rho_mono_kinetic")
    free = run_models(page, "cavity_free", models)
    scene_figures(page, "cavity_free", free)
    errors = errors_against(free["rho_mono_kinetic"], free["microscopic"])
    page.judge(
        Verdict(
            "7a. Cavity without interaction: good agreement, slight angular differences at t = 5",
            bool(errors.density[0] < 0.1),
            "L1 distance at the three times: density "
            + ", ".join(f"{error:.3f}" for error in errors.density)
            + "; angle "
            + ", ".join(f"{error:.3f}" for error in errors.angle),
        )
    )
    full = run_models(page, "cavity", models)
    scene_figures(page, "cavity", full)
    lid = {model: float(result.density(20)[-1, -1].sum() / 400) for model, result in full.items()}
    page.judge(
        Verdict(
            "7b. Cavity with interaction: the macroscopic solution reaches the upper wall sooner",
            lid["rho_mono_kinetic"] > lid["microscopic"],
            "mass within 0.05 of the lid at t = 5 with matched ghost cells: "
            + ", ".join(f"{model} {mass:.3f}" for model, mass in lid.items())
            + "; with 1/h^2 nothing comes near the lid (workflows/cavity.py)",
        )
    )


if __name__ == "__main__":
    run_in_words(main)

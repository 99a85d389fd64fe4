"""Pair sums, ensembles, large clouds, samples of the mean-field limit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numba
import numpy as np
from benchmark_tools import Floats, Row, Sizes, seconds, step_seconds, with_threads

from ellipsoid_coupling import load_scene, simulate
from ellipsoid_coupling.compare import errors_against, exact_reference
from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.interaction.pairs.cells import cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.interaction.pairs.threaded_pair_sum import PairSum
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.models import Setup, build_model
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape
from ellipsoid_coupling.scenes import terms_of
from ellipsoid_coupling.simulation import scene_flow

LENGTH, WIDTH = 0.05, 0.025
SHAPE = potential_shape(LENGTH, WIDTH)
NEIGHBOURS = 60


@numba.njit(error_model="numpy", fastmath=False)
def all_pairs(place: Floats, shape: PotentialShape, force: Floats) -> int:
    """The plain rival: the formula for every pair; returns how many are within reach."""
    within = 0
    for i in range(place.shape[1]):
        for j in range(i):
            dx, dy = place[0, j] - place[0, i], place[1, j] - place[1, i]
            within += dx * dx + dy * dy <= shape.reach * shape.reach
            ci, si = math.cos(2.0 * place[2, i]), math.sin(2.0 * place[2, i])
            cj, sj = math.cos(2.0 * place[2, j]), math.sin(2.0 * place[2, j])
            _, gx, gy, turn_i = pair_potential(dx, dy, ci, si, cj, sj, shape)
            _, _, _, turn_j = pair_potential(-dx, -dy, cj, sj, ci, si, shape)
            force[0, i] -= gx
            force[1, i] -= gy
            force[2, i] -= turn_i
            force[0, j] += gx
            force[1, j] += gy
            force[2, j] -= turn_j
    return within


def cloud(count: int, side: float, seed: int = 0) -> tuple[Floats, Floats]:
    """Random places (3, N) in a square, and cos and sin of twice the angle (2, N)."""
    place = np.random.default_rng(seed).random((3, count))
    place[:2] *= side
    place[2] *= 2.0 * np.pi
    return place, np.array([np.cos(2.0 * place[2]), np.sin(2.0 * place[2])])


def side_for(count: int, neighbours: float) -> float:
    """The square in which a particle has this many neighbours within reach, away from the edges."""
    return math.sqrt(count * math.pi * SHAPE.reach**2 / neighbours)


def side_with_edges(count: int, neighbours: float) -> float:
    """The same on average over all particles: those at the edges have fewer, the more so the smaller.

    Of the pairs of points of a square of side a, the part pi (R/a)^2 - 8/3 (R/a)^3 + (R/a)^4/2 lies
    within R of each other.
    """
    side = side_for(count, neighbours)
    for _ in range(50):
        part = SHAPE.reach / side
        near = part**2 * (math.pi - part * (8.0 / 3.0 - 0.5 * part))
        side *= math.sqrt((count - 1) * near / neighbours)
    return side


def _pairs(side: float) -> Pairs:
    return Pairs(cell_grid((0.0, side), (0.0, side), SHAPE.reach), SHAPE, 1.0, 1.0, None, 0.0)


def _pair_row(work: str, aim: str, sizes: Sizes, side: float) -> Row:
    place, axis = cloud(sizes.particles, side)
    pairs, force, other = (
        _pairs(side),
        np.zeros((3, sizes.particles)),
        np.zeros((3, sizes.particles)),
    )
    within = int(all_pairs(place, SHAPE, other))
    add_pair_forces(place, axis, pairs, force)
    error = float(np.abs(force - other).max() / np.abs(other).max())
    fast = seconds(lambda: add_pair_forces(place, axis, pairs, force), 5 * sizes.repeats)
    slow = seconds(lambda: all_pairs(place, SHAPE, other), sizes.repeats)
    rate = within / fast / 1e6
    return Row(
        work,
        aim,
        f"{rate:.0f} M unordered pairs/s on one core, {1e3 * fast:.2f} ms",
        f"{slow / fast:.1f}x the plain all-pairs loop; apart by {error:.0e}",
        {"pairs_per_second": 1e6 * rate, "ratio": slow / fast, "error": error},
    )


def _ensemble_row(sizes: Sizes) -> Row:
    side = side_for(sizes.particles, NEIGHBOURS)
    pairs = _pairs(side)
    clouds = [cloud(sizes.particles, side, seed) for seed in range(sizes.realisations)]
    force = np.zeros((sizes.realisations, 3, sizes.particles))

    def work() -> None:
        for_each(sizes.realisations, lambda k: add_pair_forces(*clouds[k], pairs, force[k]))

    one, two = (with_threads(n, lambda: seconds(work, sizes.repeats)) for n in (1, 2))
    place, axis = clouds[0]
    sorting = seconds(
        partial(sort_by_cell, place[0], place[1], axis[0], axis[1], pairs.grid), 5 * sizes.repeats
    )
    part = sorting * sizes.realisations / one
    return Row(
        f"{sizes.realisations} realisations x {sizes.particles} particles",
        "1.85x from one thread to two",
        f"{one / two:.2f}x, {1e3 * two:.0f} ms an evaluation",
        f"cells rebuilt each time: {100 * part:.1f} % of it, so no list is kept",
        {"ratio": one / two, "seconds": two, "part_of_sorting": part},
    )


def _large_clouds_row(sizes: Sizes) -> Row:
    one: list[float] = []
    two: list[float] = []
    for count in sizes.clouds:
        side = side_with_edges(count, NEIGHBOURS)
        place, axis = cloud(count, side)
        work = partial(PairSum(_pairs(side), count).add, place, axis, np.zeros_like(place))
        for threads, each in ((1, one), (2, two)):
            time = with_threads(threads, partial(seconds, work, min(sizes.repeats, 5)))
            each.append(1e9 * time / count)
    texts = [" / ".join(f"{t:.0f}" for t in each) for each in (two, one)]
    spread = [100 * (max(each) / min(each) - 1) for each in (two, one)]
    return Row(
        f"microscopic, {NEIGHBOURS} neighbours, N = " + ", ".join(f"{n:.0e}" for n in sizes.clouds),
        "cost per particle flat within 15 %",
        f"{texts[0]} ns a particle and evaluation on two threads, {texts[1]} on one",
        f"+{spread[0]:.0f} % and +{spread[1]:.0f} %; one realisation has all threads",
        {f"ns_{count}": value for count, value in zip(sizes.clouds, two, strict=True)}
        | {f"one_thread_ns_{count}": value for count, value in zip(sizes.clouds, one, strict=True)},
    )


def _samples_row(sizes: Sizes) -> Row:
    """Samples all over the cavity, and in its start box, where the grid's transforms are short."""
    interaction = SampleInteraction(Region((0.0, 1.0), (0.0, 1.0)), SHAPE, WIDTH, 1.0, 2e-2)
    texts: list[str] = []
    numbers: dict[str, float] = {}
    for where, side in (("box", 0.2), ("cavity", 1.0)):
        each = []
        for count in sizes.samples:
            place = cloud(count, side)[0]
            place[:2] += 0.5 * (1.0 - side)
            place = np.ascontiguousarray(place.reshape(3, -1, 1000).transpose(1, 0, 2))
            force = np.zeros_like(place)
            work = partial(interaction.add_forces, place, (1.0, 1.0), force)
            each.append(1e9 * seconds(work, min(sizes.repeats, 3)) / count)
        texts.append(f"{where} {' / '.join(f'{t:.0f}' for t in each)}")
        numbers |= {f"{where}_ns_{n}": t for n, t in zip(sizes.samples, each, strict=True)}
    return Row(
        "mckean_vlasov, interaction, S = " + ", ".join(f"{n:.0e}" for n in sizes.samples),
        "cost per sample flat within 15 %",
        "; ".join(texts) + " ns a sample and evaluation",
        "falls while the grid's transforms are shared by more samples",
        numbers,
    )


def _flight_row(sizes: Sizes) -> Row:
    """Samples without interaction: whole steps within a run."""
    cells = {"flow.cells": min(sizes.flow_cells, 32)}
    scene = load_scene("cavity_free", cells | {"particles.number": 1000})
    flow, terms = scene_flow(scene), terms_of(scene)
    each = []
    for count in sizes.samples[:3]:
        setup = Setup(scene, terms, "accurate", flow, 0, count // 1000)
        model = build_model("mckean_vlasov", setup)
        each.append(1e9 * step_seconds(model, scene.times[-1], 3 * sizes.repeats) / count)
    spread = 100 * (max(each) / min(each) - 1)
    return Row(
        "mckean_vlasov, no interaction, S = " + ", ".join(f"{n:.0e}" for n in sizes.samples[:3]),
        "cost per sample flat within 15 %",
        " / ".join(f"{t:.1f}" for t in each) + " ns a sample and step",
        f"+{spread:.0f} %",
        {f"ns_{count}": value for count, value in zip(sizes.samples, each, strict=False)},
    )


def _cavity_row(sizes: Sizes) -> Row:
    cells = {"flow.cells": sizes.flow_cells, "particles.realisations": sizes.realisations}
    scene = load_scene("cavity_free", cells | {"numerics.cell": sizes.cavity_cell})
    flow = scene_flow(scene)
    reference = exact_reference(scene, flow, sizes.exact_side)
    points = load_scene("cavity_free", cells | {"numerics.tolerance": 1e-2})
    found = {}
    for name, changed, model, scheme in (
        ("paper", scene, "rho_mono_kinetic", "paper"),
        ("samples", points, "mckean_vlasov", "accurate"),
    ):
        simulate(changed, model, "paper" if scheme == "paper" else "accurate", flow=flow)
        result = simulate(changed, model, "paper" if scheme == "paper" else "accurate", flow=flow)
        errors = [float(e) for e in errors_against(result, reference).density]
        found[name] = errors, float(result.attributes["wall_seconds"])
    (errors, time), (others, paper) = found["samples"], found["paper"]
    return Row(
        "cavity_free, density error at t = 2, 3.5, 5",
        "at most 0.02 in the time of FORCE",
        f"{', '.join(f'{e:.3f}' for e in errors)} in {time:.2f} s (mckean_vlasov, even points)",
        f"FORCE, h = {sizes.cavity_cell:g}: {', '.join(f'{e:.2f}' for e in others)} in {paper:.2f} s",
        {"seconds": time, "paper_seconds": paper, "worst_error": max(errors)},
    )


def particle_rows(sizes: Sizes) -> Iterator[Row]:
    """All rows of particles and samples."""
    side = side_for(sizes.particles, NEIGHBOURS)
    work = f"pair force and torque, N = {sizes.particles}, {NEIGHBOURS} neighbours"
    yield _pair_row(work, "20x, 55 M/s, error 1e-12", sizes, side)
    yield _pair_row("the same, dense: nearly all in range", "150 M/s", sizes, 0.6 * SHAPE.reach)
    yield _ensemble_row(sizes)
    yield _large_clouds_row(sizes)
    yield _samples_row(sizes)
    yield _flight_row(sizes)
    yield _cavity_row(sizes)

"""The parts of an error: each recovered where it is known beforehand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import Frontier, FrontierRow, run_frontier, timing
from ellipsoid_coupling.compare import reference_solution as reference_module
from ellipsoid_coupling.compare.cheapest import KINDS
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import (
    Bins,
    Parts,
    bin_result,
    distance,
    expected_l1,
    extrapolate,
    remaining_distance,
    sampling_error,
    total_error,
)
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.output.frontier_report import exceeds_noise
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

CELLS = 20
BASE = np.full(CELLS**2, 1.0 / CELLS**2)


def pattern(first: int, pairs: int) -> Floats:
    """Mass moved between neighbouring bins from `first` on: sum 0, L1 norm 1."""
    values = np.zeros(CELLS**2)
    values[first : first + 2 * pairs : 2] = 0.5 / pairs
    values[first + 1 : first + 2 * pairs : 2] = -0.5 / pairs
    return values


# Patterns of disjoint bins: norms add.
OF_GRID, OF_CLOSURE, OF_STEP, OF_NUMBER = (pattern(k, 30) for k in (0, 80, 160, 240))
SECOND_ORDER, FIRST_ORDER, CLOSURE, STEP, NUMBER = 4.0, 1.2, 0.06, 1.0, 60.0


def sampled(scene: Scene, masses: Floats, seed: int) -> Result:
    """Particles at the centres of bins drawn from `masses`; the same numbers for the same seed."""
    x, y = scene.domain.x[0], scene.domain.y[0]
    width = scene.domain.width / CELLS
    steps = np.concatenate([[0.0], np.cumsum(masses)])
    shape = (scene.particles.realisations, scene.particles.number)
    chance = np.array([np.random.default_rng([seed, k]).random(shape[1]) for k in range(shape[0])])
    index = np.minimum(np.searchsorted(steps, chance, side="right") - 1, CELLS**2 - 1)
    places = {
        "x": x + (index % CELLS + 0.5) * width,
        "y": y + (index // CELLS + 0.5) * width,
        "angle": np.zeros(shape),
    }
    variables = {name: np.asarray(values)[None] for name, values in places.items()}
    return Result(scene, "", "", "particles", np.array(scene.times), variables, {}, {})


def on_grid(scene: Scene, masses: Floats) -> Result:
    area = scene.domain.width * scene.domain.height / CELLS**2
    density = masses.reshape(1, CELLS, CELLS) / area
    variables = {"density": density, "mean_angle": np.zeros_like(density)}
    return Result(scene, "", "", "rho", np.array(scene.times), variables, {}, {})


def family(scene: Scene, model: str, scheme: str, *, seed: int, **_: Any) -> Result:
    """In place of `simulate`: models whose errors are known."""
    numerics, particles = scene.numerics, scene.particles
    if model == "rho_mono_kinetic":
        h = numerics.cell
        order = FIRST_ORDER * h if scheme == "paper" else SECOND_ORDER * h**2
        found = on_grid(scene, BASE + CLOSURE * OF_CLOSURE + order * OF_GRID)
    elif model == "microscopic":
        step = STEP * numerics.time_step if scheme == "paper" else 0.0
        found = sampled(scene, BASE + NUMBER / particles.number * OF_NUMBER + step * OF_STEP, seed)
    else:
        found = on_grid(scene, BASE)
    attributes = {"wall_seconds": 1e-6, "resolution": f"h = {numerics.cell:g}"}
    return Result(scene, model, scheme, found.layout, found.times, found.variables, {}, attributes)


@pytest.fixture(scope="module")
def known() -> Frontier:
    values = {"times": [1.0], "particles.realisations": 64, "numerics.cell": 0.05}
    scene = ec.load_scene("rotation", values)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "simulate", family)
        models = ("microscopic", "rho_mono_kinetic")
        return run_frontier(scene, analytic_flow("rotation"), models=models)


def rows_of(frontier: Frontier, model: str, scheme: str) -> list[FrontierRow]:
    return [row for row in frontier.rows if (row.model, row.scheme) == (model, scheme)]


def density(errors: Errors | None) -> float:
    assert errors is not None
    return float(errors.density[0])


def test_discretisation_and_closure_of_a_grid_model_are_recovered(known: Frontier) -> None:
    """C h^p and a constant: exact but for rounding, since the extrapolation has the right order."""
    for scheme, power, factor in (("accurate", 2, SECOND_ORDER), ("paper", 1, FIRST_ORDER)):
        rows = rows_of(known, "rho_mono_kinetic", scheme)
        assert len(rows) == 5
        for row in rows:
            assert row.parts is not None
            h = float(row.resolution.removeprefix("h = "))
            assert density(row.parts.discretisation) == pytest.approx(factor * h**power, rel=1e-3)
            assert density(row.parts.closure) == pytest.approx(CLOSURE, rel=1e-3)
            assert row.density_errors[0] == pytest.approx(factor * h**power + CLOSURE, rel=1e-3)


def test_finite_number_step_and_sampling_of_the_ensemble_are_recovered(known: Frontier) -> None:
    """Within 10 %: 64 realisations of 1000 particles, noise of 0.02 to 0.3 on a finite-N part of 0.06."""
    rows = rows_of(known, "microscopic", "paper")
    assert len(rows) == 9
    for k, row in enumerate(rows):
        parts = row.parts
        assert parts is not None
        assert density(parts.finite_n) == pytest.approx(NUMBER / 1000, rel=0.1)
        samples = 1000 * 2**k
        masses = BASE + NUMBER / 1000 * OF_NUMBER
        expected = _mean_deviation(samples, masses)
        assert density(parts.sampling) == pytest.approx(expected, rel=0.1)
        if k >= 5:  # in fewer realisations the 60 bins do not stand out of their noise
            step = float(f"{0.08 * 2 ** (-0.5 * k):.2g}")
            assert density(parts.discretisation) == pytest.approx(STEP * step, rel=0.1)
    accurate = rows_of(known, "microscopic", "accurate")[3]
    assert accurate.parts is not None
    assert density(accurate.parts.discretisation) == 0.0


def _mean_deviation(samples: int, masses: Floats) -> float:
    """E sum |n/S - p| of a multinomial, de Moivre's closed form, with m = floor(S p):

    2 (m + 1) C(S, m + 1) p^(m + 1) (1 - p)^(S - m) / S, summed over the bins.
    """
    m = np.floor(samples * masses)
    weight = stats.binom.pmf(m + 1, samples, masses)
    return float((2.0 * (m + 1) * (1.0 - masses) * weight).sum() / samples)


def test_the_reference_is_the_refined_limit_and_says_so(known: Frontier) -> None:
    assert (known.reference_name, known.exact, known.left_out) == ("mckean_vlasov", False, ())
    assert known.reference_spread is not None
    assert known.reference_spread.density[0] == 0.0
    assert all(row.repeats == timing.REPEATS for row in known.rows)


def groups(generator: np.random.Generator, masses: Floats, count: int, samples: int) -> Bins:
    drawn = generator.multinomial(samples, masses, size=(count, 1)) / samples
    angles = generator.multinomial(samples, np.full(60, 1 / 60), size=(count, 1)) / samples
    return Bins(drawn, angles, samples)


def test_noise_is_not_taken_for_an_offset() -> None:
    """Equal laws: the plain distance of the means is 0.08, the expected one 0 +- 0.006."""
    generator = np.random.default_rng(1)
    one, other = (groups(generator, BASE, 100, 1000) for _ in range(2))
    plain = np.abs(one.density.mean(axis=0) - other.density.mean(axis=0)).sum()
    apart, spread = distance(one, other)
    assert plain > 0.06
    assert apart.density[0] < 0.018
    assert apart.angle[0] < 0.01
    assert 0.0 < spread.density[0] < 0.01


def finite_number_row(one: Bins, other: Bins) -> FrontierRow:
    """A row whose finite-N part is the distance of two ensembles."""
    found, spread = distance(one, other)
    parts = Parts(finite_n=found, offset_spread=spread)
    nothing = (0.0,) * found.density.size
    return FrontierRow("", "microscopic", "accurate", "", nothing, nothing, 1.0, parts=parts)


def at_times(generator: np.random.Generator, masses: Floats, count: int) -> Bins:
    """Four saved times with independent noise."""
    parts = [groups(generator, masses, count, 1000) for _ in range(4)]
    density, angle = (np.concatenate([p[k] for p in parts], axis=1) for k in (0, 1))
    return Bins(density, angle, 1000)


def test_equal_ensembles_are_not_told_apart() -> None:
    """The largest over the times of estimates that are cut at 0 is above 0, but by less than four of its
    standard errors but in one comparison of some hundred; an offset of 0.1 is told.
    """
    generator = np.random.default_rng(3)
    told = []
    for _ in range(20):
        one, other = (at_times(generator, BASE, 64) for _ in range(2))
        row = finite_number_row(one, other)
        told += [exceeds_noise(row, kind) for kind in KINDS]
    assert sum(told) <= 1
    shifted = at_times(generator, BASE + 0.1 * OF_CLOSURE, 64)
    assert exceeds_noise(finite_number_row(one, shifted), "density")


def test_offsets_between_random_groups_are_found() -> None:
    generator = np.random.default_rng(2)
    one = groups(generator, BASE, 100, 1000)
    other = groups(generator, BASE + 0.1 * OF_CLOSURE, 50, 2000)
    assert distance(one, other)[0].density[0] == pytest.approx(0.1, rel=0.1)
    fixed = Bins(BASE[None, None], np.full((1, 1, 60), 1 / 60), 0)
    assert distance(fixed, other)[0].density[0] == pytest.approx(0.1, rel=0.1)
    assert total_error(one, fixed).density[0] == pytest.approx(
        _mean_deviation(100_000, BASE), rel=0.1
    )
    assert np.array_equal(expected_l1(np.full((1, 2, 4), -0.5)).value, [2.0, 2.0])


def test_sampling_follows_the_law_of_large_numbers() -> None:
    """Also for runs smaller than a group of the pool, and for the pool itself."""
    pool = groups(np.random.default_rng(3), BASE, 200, 5000)
    for samples in (5000 * 200, 20_000, 5000, 2500):
        expected = _mean_deviation(samples, BASE)
        assert sampling_error(pool, samples).density[0] == pytest.approx(expected, rel=0.1)
    with pytest.raises(ValueError, match="two groups"):
        sampling_error(pool._replace(density=pool.density[:1], angle=pool.angle[:1]), 100)


def test_extrapolation_and_what_remains_of_a_sequence() -> None:
    """B(h) = B + C h: the distances halve, what remains is the last of them."""

    def at(h: float, power: float) -> Bins:
        return Bins((BASE + h**power * OF_GRID)[None, None], np.full((1, 1, 60), 1 / 60), 0)

    exact = at(0.0, 2.0)
    assert distance(extrapolate(at(0.1, 2), at(0.15, 2), 1.5), exact)[0].density[0] < 1e-12
    linear = remaining_distance(at(0.1, 1), at(0.2, 1), at(0.4, 1))
    assert linear.density[0] == pytest.approx(0.1)
    slow = remaining_distance(at(0.1, 0.5), at(0.2, 0.5), at(0.4, 0.5))
    assert slow.density[0] == pytest.approx(math.sqrt(0.1), rel=1e-6)
    quick = remaining_distance(at(0.1, 2), at(0.2, 2), None)
    assert quick.density[0] == pytest.approx(0.03)


def test_groups_and_whole_runs_have_the_same_bins() -> None:
    """Realisations one by one, in blocks, and all at once; the angle's bins are centred."""
    scene = ec.load_scene("rotation", {"times": [1.0], "particles.realisations": 6})
    result = sampled(scene, BASE, 0)
    result.variables["angle"][:] = np.array([-0.05, 0.05, 1.0, 2.0, 3.0, -0.06])[None, :, None]
    one_by_one, whole = bin_result(result, 1000), bin_result(result)
    assert one_by_one.density.shape == (6, 1, 400)
    assert np.allclose(one_by_one.density.mean(axis=0), whole.density[0], atol=1e-15)
    assert np.allclose(one_by_one.angle.mean(axis=0), whole.angle[0], atol=1e-15)
    # Half a bin is 0.0524: the bin of 0 holds two realisations, the one below it the third.
    assert np.allclose(whole.angle[0, 0, [0, 59]], [1 / 3, 1 / 6])
    assert bin_result(result, 3000).samples == 3000


def test_parts_without_interaction_are_what_the_exact_solution_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Rotation before any crossing: no finite-N part, no closure part, discretisation alone."""
    monkeypatch.setattr(reference_module, "_EXACT_SIDE", 192)
    values = {"interaction": None, "times": [0.5, 1.0], "particles.number": 500}
    scene = ec.load_scene("rotation", values | {"particles.realisations": 16})
    models = ("microscopic", "rho_mono_kinetic")
    frontier = run_frontier(scene, analytic_flow("rotation"), models=models, longest=0.3)
    assert frontier.exact
    done = [row for row in frontier.rows if row.status == "completed"]
    for row in done:
        assert row.parts is not None
        assert row.parts.discretisation is not None
        if row.model == "microscopic":
            assert row.parts.finite_n is not None
            assert row.parts.offset_spread is not None
            allowed = 4.0 * row.parts.offset_spread.density + 0.005
            assert np.all(row.parts.finite_n.density < allowed)
        else:
            assert row.parts.closure is not None
            assert row.parts.discretisation_spread is not None
            assert np.all(row.parts.closure.density <= row.parts.discretisation_spread.density)
    coarse = rows_of(frontier, "rho_mono_kinetic", "paper")[:2]
    for row in coarse:
        assert row.parts is not None
        found = row.parts.discretisation
        assert found is not None
        assert np.allclose(found.density, row.density_errors, rtol=0.1)

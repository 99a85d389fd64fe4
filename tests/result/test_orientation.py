"""Order parameter, director and mean angle of all layouts, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.result import Layout, Result
from ellipsoid_coupling.scenes import load_scene
from tests.small_runs import small_runs

Floats = NDArray[np.float64]
ANGLES = 60


def result_of(layout: Layout, variables: dict[str, Floats], **attributes: object) -> Result:
    """One saved time on [-1, 1]^2; missing variables are 0."""
    scene = load_scene(
        "top_bottom", {"times": [1.0], "domain.x": [-1.0, 1.0], "domain.y": [-1.0, 1.0]}
    )
    shape = next(iter(variables.values())).shape
    axes = {"particles": (), "rho": ("y", "x"), "q": ("angle", "y", "x")}[layout]
    sizes = dict(zip(axes, shape[1:], strict=False)) if axes else {}
    coordinates = {
        name: np.arange(n) * 2.0 * np.pi / n
        if name == "angle"
        else (np.arange(n) + 0.5) * 2.0 / n - 1.0
        for name, n in sizes.items()
    }
    times = np.array([1.0])
    told = {"status": "completed", **attributes}
    return Result(scene, "any", "accurate", layout, times, variables, coordinates, told)


def particles(x: Floats, y: Floats, angle: Floats, **more: Floats) -> Result:
    variables = {"x": x, "y": y, "angle": angle, **more}
    return result_of("particles", {k: np.asarray(v)[None, None] for k, v in variables.items()})


def as_layouts(angles: Floats, weights: Floats) -> list[Result]:
    """The same angles, multiples of 6 degrees, with whole weights in every layout: alike in space."""
    counts = weights.astype(int)
    number = int(counts.sum())
    side = 2 * number
    spread = np.linspace(-0.999, 0.999, number)
    micro = particles(spread, spread, np.repeat(angles, counts))
    q = np.zeros((1, ANGLES, 4, 4))
    for angle, weight in zip(angles, weights, strict=True):
        q[0, round(angle * ANGLES / (2.0 * np.pi)) % ANGLES] += weight
    field = np.tile(np.repeat(angles, counts), (side, 2))[None]
    density = np.ones(field.shape)
    return [
        micro,
        result_of("q", {"density": q}),
        result_of("rho", {"density": density, "mean_angle": field}),
    ]


@pytest.mark.parametrize("kind", range(3), ids=["particles", "q", "rho"])
@pytest.mark.parametrize("apart", [0.2 * np.pi, 0.5 * np.pi, 0.8 * np.pi, np.pi])
def test_two_peaks_have_the_closed_form(kind: int, apart: float) -> None:
    """Weights p and 1 - p at a and a + d: m_2 = e^{2ia} (p + (1 - p) e^{2id}), so

    S^2 = p^2 + (1 - p)^2 + 2 p (1 - p) cos(2d), to rounding.
    """
    p, a = 0.75, 0.3 * np.pi
    result = as_layouts(np.array([a, a + apart]), np.array([3.0, 1.0]))[kind]
    wave = p + (1.0 - p) * np.exp(2j * apart)
    order = np.sqrt(p**2 + (1.0 - p) ** 2 + 2.0 * p * (1.0 - p) * np.cos(2.0 * apart))
    assert result.order_parameter() == pytest.approx(order, abs=1e-12)
    assert result.director() == pytest.approx((a + np.angle(wave) / 2.0) % np.pi, abs=1e-12)
    first = p + (1.0 - p) * np.exp(1j * apart)
    assert result.mean_angle() == pytest.approx((a + np.angle(first)) % (2.0 * np.pi), abs=1e-12)


@pytest.mark.parametrize("kind", range(3), ids=["particles", "q", "rho"])
def test_all_axes_alike_are_in_order_and_all_angles_are_in_none(kind: int) -> None:
    """Aligned: 1, whichever way the heads point. Even angles: sums of roots of unity, 0 to rounding."""
    both = as_layouts(np.array([0.1 * np.pi, 1.1 * np.pi]), np.array([2.0, 2.0]))[kind]
    assert both.order_parameter() == pytest.approx(1.0, abs=1e-12)
    assert both.director() == pytest.approx(0.1 * np.pi, abs=1e-12)
    even = as_layouts(np.arange(ANGLES) * 2.0 * np.pi / ANGLES, np.ones(ANGLES))[kind]
    assert even.order_parameter() == pytest.approx(0.0, abs=1e-12)


def test_chance_has_the_order_that_its_number_allows() -> None:
    """Of n random angles n S^2 is exponential with mean 1. Of 400 draws its mean is 1 +- 0.05 (1 sigma)."""
    random = np.random.default_rng(3)
    n = 500
    angles = random.uniform(0.0, 2.0 * np.pi, (400, n))
    place = np.zeros(n)
    found = [particles(place, place, some).order_parameter()[0] for some in angles]
    assert abs(n * np.mean(np.square(found)) - 1.0) < 0.2


def test_bins_are_those_of_the_density() -> None:
    """Axis order (time, y, x); NaN exactly where there is no mass; particles outside are in no bin."""
    x = np.array([-0.9, -0.8, 0.9, 5.0])
    y = np.array([-0.9, -0.8, 0.1, 0.0])
    result = particles(x, y, np.array([0.0, 0.5 * np.pi, 2.0, 1.0]))
    order, director = result.order_parameter(4), result.director(4)
    assert order.shape == (1, 4, 4)
    assert np.array_equal(np.isnan(order), result.density(4) == 0.0)
    assert np.array_equal(np.isnan(director), np.isnan(order))
    assert order[0, 0, 0] == pytest.approx(0.0, abs=1e-15)
    assert order[0, 2, 3] == pytest.approx(1.0)
    assert director[0, 2, 3] == pytest.approx(2.0)


def test_particles_that_take_no_part_are_not_counted() -> None:
    here = np.zeros(3)
    angles = np.array([0.3, 0.3, 0.3 + 0.5 * np.pi])
    left = particles(here, here, angles, frozen=np.array([0.0, 0.0, 1.0]))
    assert left.order_parameter() == pytest.approx(1.0)
    none = particles(here, here, angles, frozen=np.ones(3))
    assert np.isnan(none.order_parameter()).all()
    assert np.isnan(none.mean_angle(2)).all()


def test_a_small_negative_angle_is_no_whole_turn() -> None:
    """The mod of -1e-17 rounds to the turn itself, which is outside of [0, turn)."""
    here = np.zeros(1)
    result = particles(here, here, np.array([-1e-17]))
    assert result.director()[0] < 1e-15
    assert result.mean_angle()[0] < 1e-15


def test_q_of_one_angle_has_the_start_s_angles() -> None:
    """Where nothing turns one cell stands for all angles: the start's, here two axes at 60 degrees."""
    points = [[0.25, 0.5, 0.0], [0.75, 0.5, np.pi / 3.0]]
    scene = load_scene(
        "rotation",
        {
            "flow": None,
            "start": {"points": points},
            "particles.number": 2,
            "times": [0.1],
            "interaction": None,
            "noise": None,
        },
    )
    density = np.ones((1, 1, 4, 4))
    axes = {"angle": np.zeros(1), "y": np.zeros(4), "x": np.zeros(4)}
    result = Result(scene, "any", "accurate", "q", np.array([0.1]), {"density": density}, axes)
    assert result.order_parameter() == pytest.approx(0.5)
    assert result.director() == pytest.approx(np.pi / 6.0)
    assert np.allclose(result.order_parameter(2), 0.5)


@pytest.mark.parametrize("model", ["microscopic", "rho_mono_kinetic"])
def test_every_model_tells_its_order_on_the_same_bins(model: str) -> None:
    """A run of each layout: 0 <= S <= 1, and the whole is the mean of the bins, weighted with mass."""
    _, result = next(iter(small_runs([model])))
    whole, bins, density = result.order_parameter(), result.order_parameter(5), result.density(5)
    assert bins.shape == (result.times.size, 5, 5)
    filled = ~np.isnan(bins)
    assert np.array_equal(filled, density > 0.0)
    assert (bins[filled] >= 0.0).all()
    assert (bins[filled] <= 1.0 + 1e-12).all()
    waves = bins * np.exp(2j * result.director(5))
    mean = np.nansum(waves * density, axis=(1, 2)) / density.sum(axis=(1, 2))
    if result.layout == "rho":
        np.testing.assert_allclose(np.abs(mean), whole, atol=1e-10)

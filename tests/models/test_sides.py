"""Sides of different kinds. Periodic: mass stays, places are alike, waves go on; else refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.interaction.q_grid import AngleGridInteraction
from ellipsoid_coupling.interaction.select import choose_interaction
from ellipsoid_coupling.models import Setup, build_model, model_terms
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

MODELS = ["rho_mono_kinetic", "q_mono_kinetic", "q_maxwellian"]
SCHEMES = ["paper", "accurate"]
# A shear flow, periodic in x between two walls; particles are blown over the seam several times.
CHANNEL: dict[str, Any] = {
    "domain.x": [0.0, 0.8], "domain.y": [-0.25, 0.25], "domain.boundary": "reflecting",
    "boundaries.left.kind": "periodic", "boundaries.right.kind": "periodic",
    "start.x": [0.0, 0.2], "start.y": [0.05, 0.2], "times": [0.5],
    "flow.field": "shear", "flow.drag": 20.0, "interaction": None,
    "numerics.cell": 0.05, "numerics.angle_cells": 8,
}  # fmt: skip


def scene(**changes: Any) -> Scene:
    return ec.load_scene("rotation", CHANNEL | changes)


def run(model: str, scheme: Any, start: tuple[float, float], **changes: Any) -> ec.Result:
    found = scene(**{"start.x": list(start), **changes})
    return ec.simulate(found, model=model, scheme=scheme)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("model", MODELS)
def test_mass_stays_and_places_are_alike(model: str, scheme: Any) -> None:
    """Mass to rounding; a start that goes over the seam as one seven cells further on, to rounding."""
    first = run(model, scheme, (0.6, 0.8))
    attributes = first.to_dataset().attrs
    assert attributes["mass_end"] == pytest.approx(attributes["mass_start"], rel=1e-13)
    assert attributes["mass_left"] == 0.0
    second = run(model, scheme, (0.15, 0.35))
    for name in ("density", "velocity_x"):
        # Empty cells have no velocity.
        before, after = (
            np.nan_to_num(result.to_dataset()[name].isel(time=-1).to_numpy())
            for result in (first, second)
        )
        scale = np.abs(before).max()
        np.testing.assert_allclose(np.roll(before, 7, -1), after, atol=1e-12 * scale)
    # The seam was at its end.
    assert float(first.to_dataset()["density"].isel(time=-1)[..., 0].max()) > 0.0


def model_of(scene: Scene, name: str, scheme: Any) -> Any:
    return build_model(name, Setup(scene, model_terms(scene, name), scheme, None, 0, 1))


def wave(name: str, scheme: Any, cells: int) -> float:
    """The L1 error of a smooth wave that has gone once around a period at constant speed."""
    changes = {
        "domain.x": [0.0, 1.0], "domain.y": [0.0, 4.0 / cells], "domain.boundary": "periodic",
        "start.x": [0.0, 1.0], "start.y": [0.0, 4.0 / cells], "times": [1.0], "flow": None,
        "interaction": None, "numerics.cell": 1.0 / cells, "particles.width": 0.1,
    }  # fmt: skip
    model = model_of(ec.load_scene("rotation", changes), name, scheme)
    fields = model.cells.inside[:, 0]
    x = (np.arange(cells) + 0.5) / cells
    part = math.sin(math.pi / cells) / (math.pi / cells)
    density = 1.0 + 0.3 * part * np.sin(2.0 * math.pi * x)
    for component, value in ((0, density), (1, density), (2, 0.0 * density)):
        fields[component] = value
    model.restore(model.state())
    while model.time < 1.0:
        model.advance(1.0)
    return float(np.abs(fields[0] - density).mean())


@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_mono_kinetic"])
@pytest.mark.parametrize(("scheme", "order"), [("paper", 1.0), ("accurate", 2.0)])
def test_a_wave_goes_around_with_the_scheme_s_order(model: str, scheme: Any, order: float) -> None:
    """Between 32 and 64 cells; its end is its start."""
    errors = [wave(model, scheme, cells) for cells in (32, 64)]
    assert math.log2(errors[0] / errors[1]) > order - 0.25


@pytest.mark.parametrize(("scheme", "error"), [("paper", 2e-2), ("accurate", 1e-6)])
def test_a_particle_bounces_off_the_one_side_that_reflects(scheme: Any, error: float) -> None:
    """In a trap about the left side's origin: x = 0.5 |cos t|; y = 0.3 cos t through the open bottom.

    The fixed step of 0.01 is of first order at a bounce; the other one follows its tolerance.
    """
    changes = {
        "domain.x": [0.0, 0.6], "domain.y": [-0.1, 0.4], "boundaries.left.kind": "reflect",
        "start": {"x": [0.5, 0.5], "y": [0.3, 0.3], "points": [[0.5, 0.3]]}, "flow": None,
        "interaction": None, "outer_potential": {"stiffness": 1.0}, "particles.number": 1,
        "particles.realisations": 1, "times": [2.5], "numerics.tolerance": 1e-8,
    }  # fmt: skip
    last = ec.simulate(ec.load_scene("rotation", changes), "microscopic", scheme).to_dataset()
    x, y = (float(last[f"particle_{name}"].isel(time=-1).squeeze()) for name in "xy")
    assert (x, y) == pytest.approx((0.5 * abs(math.cos(2.5)), 0.3 * math.cos(2.5)), abs=error)
    assert y < -0.1


SHAPE = potential_shape(0.1, 0.05)


@pytest.mark.parametrize("method", ["direct", "harmonics"])
def test_the_rho_integral_sees_the_nearest_images(method: Any) -> None:
    """It is that of a plane tiled three by three: to rounding, or within twice the tolerance."""
    rng = np.random.default_rng(1)
    density, angle, h = rng.random((16, 24)), 6.0 * rng.random((16, 24)), 0.03
    periodic = choose_interaction((16, 24), h, SHAPE, 1.0, 1e-5, method, (True, True))
    tiled = choose_interaction((48, 72), h, SHAPE, 1.0, 1e-5, "direct")
    forces = periodic(density, angle)
    expected = tiled(np.tile(density, (3, 3)), np.tile(angle, (3, 3)))
    for own, wanted in zip(forces, expected, strict=True):
        assert own is not None
        assert wanted is not None
        atol = (1e-12 if method == "direct" else 1e-4) * np.abs(wanted).max()
        np.testing.assert_allclose(own, wanted[16:32, 24:48], atol=atol)


@pytest.mark.parametrize("periods", [(True, True), (False, True)])
def test_the_q_integral_sees_the_nearest_images(periods: tuple[bool, bool]) -> None:
    """In the periodic directions only; to rounding."""
    density, h = np.random.default_rng(2).random((8, 16, 24)), 0.03
    density[:, :, 5:9] = 0.0
    periodic = AngleGridInteraction((8, 16, 24), h, SHAPE, 1.0, periods=periods).forces(density)
    tiles = 1, 3 if periods[0] else 1, 3
    rows = slice(16, 32) if periods[0] else slice(None)
    large = np.tile(density, tiles)
    expected = AngleGridInteraction(large.shape, h, SHAPE, 1.0).forces(large)
    for own, wanted in zip(periodic, expected, strict=True):
        assert own is not None
        assert wanted is not None
        part = wanted[:, rows, 24:48]
        np.testing.assert_allclose(own, part, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_maxwellian"])
def test_interaction_reaches_over_the_seam(model: str) -> None:
    """A gap of two cells, less than the reach, at the seam as elsewhere: the same to rounding."""
    here = {"interaction": {"strength": 1.0}, "times": [0.1], "particles.width": 0.1}
    results = [run(model, "accurate", x, **here) for x in ((0.0, 0.7), (0.1, 0.8), (0.05, 0.75))]
    seam, other, both = (r.to_dataset()["density"].isel(time=-1).to_numpy() for r in results)
    for after, cells in ((other, 2), (both, 1)):
        np.testing.assert_allclose(np.roll(seam, cells, -1), after, atol=1e-6 * seam.max())


@pytest.mark.parametrize(
    ("model", "changes", "message"),
    [
        (
            "stationary_state",
            {"flow": None},
            "boundaries.left.kind .*sides that stationary_state knows",
        ),
        ("rho_mono_kinetic", {"flow.field": "top_bottom"}, "same on both periodic sides"),
        (
            "q_mono_kinetic",
            {"interaction": {"strength": 1.0}, "domain.x": [0.0, 0.2]},
            "longer than twice the potential's reach",
        ),
        (
            "rho_mono_kinetic",
            {"interaction": {"strength": 1.0}, "domain.x": [0.0, 0.85]},
            "an even number of cells",
        ),
        ("rho_mono_kinetic", {"domain.x": [0.0, 0.05], "start.x": [0.0, 0.05]}, "at least 2 cells"),
    ],
)
def test_what_is_not_built_is_refused_in_one_line(
    model: str, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ec.InputError, match=message):
        ec.simulate(scene(**changes), model=model)

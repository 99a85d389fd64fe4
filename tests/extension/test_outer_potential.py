"""How to add an outer potential V1(r), in one file. Three steps:

* a NamedTuple with its parameters, which are the keys of ``[outer_potential]`` in a scene file;
* its value V1 and its force -grad V1;
* their registration under a kind.

All models then have it: particles evaluate the force in their loop, cells at their centres, and
`stationary_state` takes the value.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.physics import outer
from ellipsoid_coupling.scenes import explain_terms
from ellipsoid_coupling.scenes.values import Positive


class Quartic(NamedTuple):
    """V1(r) = strength |r|^4 / 4; its field is the key of the scene's section."""

    strength: Positive


def energy(potential: Quartic, x: float, y: float) -> float:
    """V1."""
    return 0.25 * potential.strength * (x * x + y * y) ** 2


def force(potential: Quartic, x: float, y: float) -> tuple[float, float]:
    """-grad V1 = -strength |r|^2 r."""
    pull = -potential.strength * (x * x + y * y)
    return pull * x, pull * y


outer.register("quartic", Quartic, energy=energy, force=force, text="V1 = {strength:g} r^4/4")

STRENGTH = 3.0
SCENE: dict[str, Any] = {
    "name": "quartic",
    "times": [1.0],
    "domain": {"x": [-3.0, 3.0], "y": [-3.0, 3.0], "boundary": "open"},
    "particles": {"length": 0.1, "width": 0.1, "number": 1},
    "start": {"points": [[1.2, 0.0]]},
    "outer_potential": {"kind": "quartic", "strength": STRENGTH},
    "numerics": {"cell": 0.1, "angle_cells": 1, "tolerance": 1e-8},
}


def test_a_particle_swings_with_the_period_of_the_quartic_oscillator(tmp_path: Path) -> None:
    """X'' = -k x^3 from rest at a: T = Gamma(1/4)^2 / (sqrt(pi) a sqrt(k)).

    Error 1e-5 of the amplitude at a tolerance of 1e-8: steps of second order. The run folder keeps the
    kind by its name, and a run of it is the same.
    """
    period = 7.416298709205487 / (1.2 * np.sqrt(STRENGTH))
    scene = ec.load_scene(SCENE, {"times": [0.5 * period, period]})
    result = ec.simulate(scene, model="mckean_vlasov", folder=tmp_path / "run")
    np.testing.assert_allclose(result.variables["x"][:, 0, 0], [-1.2, 1.2], atol=1e-5)
    assert ec.load_scene(tmp_path / "run" / "run.toml") == scene


def test_its_equilibrium_is_its_boltzmann_factor() -> None:
    """exp(-V1)/Z on the very cells: to rounding."""
    result = ec.simulate(ec.load_scene(SCENE), model="stationary_state")
    density = result.variables["density"][-1].sum(axis=0) * 2.0 * np.pi
    x, y = np.meshgrid(result.coordinates["x"], result.coordinates["y"])
    expected = np.exp(-0.25 * STRENGTH * (x**2 + y**2) ** 2)
    np.testing.assert_allclose(density, expected / (expected.sum() * 0.1**2), rtol=1e-12)


def test_cells_fall_as_particles_do() -> None:
    """A small cloud at rest, mono-kinetic, falls as particles do: 4e-3, its size squared."""
    box = {"x": [1.15, 1.25], "y": [-0.05, 0.05]}
    settings = {"start": box, "numerics.cell": 0.025, "times": [0.4], "particles.number": 400}
    scene = ec.load_scene(SCENE, settings)
    cells = ec.simulate(scene, model="rho_mono_kinetic")
    density = cells.variables["density"][-1]
    mean = (density * cells.coordinates["x"]).sum() / density.sum()
    particles = ec.simulate(scene, model="mckean_vlasov").variables["x"][-1].mean()
    assert mean == pytest.approx(particles, abs=4e-3)


def test_plan_shows_its_formula_and_mistakes_are_refused_in_one_line() -> None:
    (line,) = (t for t in explain_terms(ec.load_scene(SCENE)) if t.name == "outer_potential")
    assert line.why == "V1 = 3 r^4/4"
    with pytest.raises(
        ec.InputError, match=r"outer_potential\.stiffness: expected one of kind, str"
    ):
        ec.load_scene(SCENE, {"outer_potential.stiffness": 1.0})
    with pytest.raises(ec.InputError, match=r"outer_potential\.strength: expected greater than 0"):
        ec.load_scene(SCENE, {"outer_potential.strength": -1.0})
    with pytest.raises(
        ec.InputError, match=r"outer_potential\.kind: expected .*'quartic', found 'qu"
    ):
        ec.load_scene(SCENE, {"outer_potential.kind": "quintic"})


class Mistyped(NamedTuple):
    """A record whose registration goes wrong."""

    strength: Positive


def test_mistakes_in_a_registration_are_told_in_one_line() -> None:
    formulas: dict[str, Any] = {"energy": energy, "force": force, "text": "V1"}
    told = r"expected the arguments \(potential, x, y\), found \(r\)"
    with pytest.raises(TypeError, match=told):
        outer.register("mistyped", Mistyped, **formulas | {"energy": lambda r: 0.0})
    with pytest.raises(ValueError, match=r"\[outer_potential\] has a kind quartic"):
        outer.register("quartic", Mistyped, **formulas)

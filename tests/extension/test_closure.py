"""How to add a closure with an equation of its own: particles that have a temperature T, which presses.

    d_t rho     + div(rho v)                 = 0
    d_t (rho v) + div(rho v (x) v + rho T I) = rho (F - Gamma v)
    d_t (rho s) + div(rho s v)               = A^2 - 2 gamma T            s = T/rho

At a place, velocities are Gaussian with variance T about v. Noise heats them, drag cools them, and a
compression does work on them: in the plane T grows like rho, so that the entropy s is only carried along.
Four steps:

* the pressure: a NamedTuple and its formulas, which are compiled into fluxes and step limits;
* the source of the further component, exact or of the scheme's order;
* the model: its system of components, their start, what its snapshots hold and how it is called;
* its registration.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.kick import exact_gain
from ellipsoid_coupling.finite_volume.system import Source, System, rho_system
from ellipsoid_coupling.models import Arrays, LineStyle, ModelKind, Setup, Variable, registry
from ellipsoid_coupling.models.r_grid import RGridEquation
from ellipsoid_coupling.physics.closure import register_pressure

Floats = NDArray[np.float64]


class Adiabatic(NamedTuple):
    """P = rho T, and T = rho s, where s is the last component: its content rho s is T itself."""


def pressure(law: Adiabatic, state: Values) -> float:
    """Rho T."""
    return state[0] * state[-1]


def sound_speed(law: Adiabatic, state: Values) -> float:
    """c^2 = dP/drho at constant s = 2 T."""
    return float(np.sqrt(2.0 * state[-1]))


register_pressure(Adiabatic, pressure=pressure, sound_speed=sound_speed)


def heat_bath(drag: float, noise: float) -> Source:
    """T' = A^2 - 2 gamma T, exactly; vacuum has no temperature."""

    def heat(cells: CellFields, dt: float) -> None:
        density, temperature = cells.inside[0], cells.inside[cells.system.place("entropy")]
        gain = noise**2 * exact_gain(2.0 * drag, dt)
        temperature[...] = np.exp(-2.0 * drag * dt) * temperature + gain * (density > 0.0)

    return heat


START_TEMPERATURE = 0.5


class WithTemperature(RGridEquation):
    """`Model` of the equations above, on the grid and with the forces of the rho-equations."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "rho_temperature",
            label="rho, temperature",
            layout="rho",
            style=LineStyle("#882255", "-", "h"),
            pressure=Adiabatic(),
            variables=(Variable("temperature", "1", "variance of velocities at a place"),),
        ),
    )

    @classmethod
    def system(cls, setup: Setup) -> System:
        """The components of the rho-equation, and the entropy."""
        plain, flow, noise = super().system(setup), setup.scene.flow, setup.scene.noise
        return plain._replace(
            components=(*plain.components, "entropy"),
            pressure=Adiabatic(),
            source=heat_bath(flow.drag if flow else 0.0, noise.noise if noise else 0.0),
        )

    @classmethod
    def start_values(cls, setup: Setup, density: Floats) -> Mapping[str, Floats]:
        """One temperature everywhere, as s = T/rho."""
        nothing = np.zeros_like(density)
        return {"entropy": np.divide(START_TEMPERATURE, density, out=nothing, where=density > 0.0)}

    def snapshot(self) -> Arrays:
        """The variables of the layout, and the temperature."""
        density = self.cells.inside[0, 0]
        return super().snapshot() | {"temperature": self.per_mass("entropy") * density}


# That is the whole model. From here on it is registered and run like any other.


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """`ec.register_model(WithTemperature)`, undone after each test so that others do not see it."""
    monkeypatch.setattr(registry, "registered", {})
    ec.register_model(WithTemperature)


# Circles, so that no angle matters. Periodic from end to end, as the bath below needs it: what is compiled
# with a pressure from outside of the package is not cached, so that all tests here have the same sides.
PIPE: dict[str, Any] = {
    "name": "pipe",
    "times": [0.8],
    "domain": {"x": [-4.0, 2.0], "y": [0.0, 0.1], "boundary": "reflecting"},
    "boundaries": {"left": {"kind": "periodic"}, "right": {"kind": "periodic"}},
    "particles": {"length": 0.05, "width": 0.05, "number": 1},
    "start": {"x": [-2.0, 0.0], "y": [0.0, 0.1]},
    "numerics": {"cell": 0.02},
}


def fan(x: Floats, time: float) -> Floats:
    """Gas at rest, rho_0 = 5 and c_0 = 1, expands into vacuum: rho = rho_0 (2 - x/t)^2/9 (Ritter)."""
    return np.asarray(5.0 * (2.0 - np.clip(x / time, -1.0, 2.0)) ** 2 / 9.0)


def test_a_gas_cools_as_it_expands() -> None:
    """T = T_0 rho/rho_0 everywhere to rounding, as s is carried; both fans to the order 1 of FORCE.

    They do not meet yet, neither about the middle at x = -1 nor over the seam. Half a cell makes a
    corner's error 0.6 times as large or less.
    """
    errors = []
    for cell in (0.02, 0.01):
        scene = ec.load_scene(PIPE, {"numerics.cell": cell})
        result = ec.simulate(scene, "rho_temperature", scheme="paper")
        density, temperature = (result.variables[k][-1] for k in ("density", "temperature"))
        np.testing.assert_allclose(temperature, START_TEMPERATURE / 5.0 * density, rtol=1e-11)
        off = np.abs(density - fan(np.abs(result.coordinates["x"] + 1.0) - 1.0, 0.8))
        errors.append(float(off.sum()) * cell**2)
        assert result.attributes["mass_end"] == pytest.approx(1.0, abs=1e-12)
    assert errors[1] < 0.65 * errors[0]
    assert errors[1] < 0.025


class Cold(WithTemperature):
    """Particles so cold that T is carried along without pressing: as mono-kinetic, by both schemes."""

    @classmethod
    def system(cls, setup: Setup) -> System:
        return super().system(setup)._replace(pressure=0.0)


@pytest.mark.parametrize(
    ("model", "scheme"),
    [
        (WithTemperature, "paper"),
        (Cold, "accurate"),
        pytest.param(Cold, "paper", marks=pytest.mark.heavy),
    ],
)
def test_a_bath_gives_its_temperature(
    model: type[WithTemperature], scheme: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a shear flow, which compresses nothing, T - T_b = (T_0 - T_b) e^{-2 gamma t} to rounding.

    T_b = A^2/(2 gamma). The result file has the temperature among its variables.
    """
    monkeypatch.setattr(registry, "registered", {})
    ec.register_model(model)
    drag, noise = 1.5, 0.6
    settings = {
        "start.x": [-4.0, 2.0],
        "times": [0.2, 1.0],
        "flow": {"source": "closed_form", "field": "shear", "drag": drag, "angular_drag": 0.0},
        "noise": {"noise": noise, "angular_noise": 0.0},
        "numerics.cell": 0.05,
    }
    scene = ec.load_scene(PIPE, settings)
    ec.simulate(scene, "rho_temperature", scheme=scheme, folder=tmp_path / "run")
    found = ec.Result.load(tmp_path / "run").to_dataset()["temperature"]
    bath = noise**2 / (2.0 * drag)
    for k, t in enumerate(scene.times):
        expected = bath + (START_TEMPERATURE - bath) * np.exp(-2.0 * drag * t)
        np.testing.assert_allclose(found[k], expected, rtol=1e-12)
    assert found.attrs == {"units": "1", "long_name": "variance of velocities at a place"}


def test_a_scheme_that_knows_no_such_pressure_is_refused_in_one_line() -> None:
    with pytest.raises(ec.InputError, match=r"steps this model's equations: paper, found 'accu"):
        ec.simulate(ec.load_scene(PIPE), "rho_temperature", scheme="accurate")


class Unknown(NamedTuple):
    """A pressure whose formulas have not been registered."""


class MistypedPressure(WithTemperature):
    @classmethod
    def system(cls, setup: Setup) -> System:
        return rho_system(turns=False)._replace(pressure=Unknown())


class MistypedComponent(WithTemperature):
    @classmethod
    def start_values(cls, setup: Setup, density: Floats) -> Mapping[str, Floats]:
        return {"entropie": density}


class MistypedVariable(WithTemperature):
    def snapshot(self) -> Arrays:
        shown = super().snapshot()
        return shown | {"temprature": shown["density"]}


@pytest.mark.parametrize(
    ("model", "told"),
    [
        (MistypedPressure, r"cell_pressure is not known for Unknown, but for float, Adiabatic"),
        (MistypedComponent, r"no component is called entropie, but density, .*, entropy$"),
        (MistypedVariable, r"found .*temprature.* Declare the others in ModelKind\.variables"),
    ],
)
def test_mistakes_are_told_in_one_line(
    model: type[WithTemperature], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the first step."""
    monkeypatch.setattr(registry, "registered", {})
    ec.register_model(model)
    with pytest.raises((TypeError, ValueError), match=told):
        ec.simulate(ec.load_scene(PIPE), "rho_temperature", scheme="paper")


def test_mistakes_in_a_registration_are_told_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="has a formula for Adiabatic already"):
        register_pressure(Adiabatic, pressure=pressure, sound_speed=sound_speed)
    with pytest.raises(TypeError, match=r"expected the arguments \(law, state\), found \(state\)"):
        register_pressure(Unknown, pressure=lambda state: state[0], sound_speed=sound_speed)
    kind = WithTemperature.kinds[0]
    wrong = ModelKind(kind.name, kind.label, "rho", variables=(Variable("T/K", "K", "heat"),))
    monkeypatch.setattr(WithTemperature, "kinds", (wrong,))
    with pytest.raises(ValueError, match=r"a variable's name of letters, .*, found 'T/K'"):
        ec.register_model(WithTemperature)

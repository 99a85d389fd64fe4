"""Fluxes by name: what a scene may choose, what is refused, and one from outside of the package."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import map_fields
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.fluxes import flux_names, register_flux_name
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    Stencil,
    register_face_flux,
)
from ellipsoid_coupling.models import Setup, model_terms, require_fit
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import load_scene
from ellipsoid_coupling.simulation import simulate

COARSE: dict[str, Any] = {"numerics.cell": 0.1, "interaction": None, "times": [0.5]}


def result(scheme: Any, flux: str | None) -> Result:
    chosen = {} if flux is None else {"numerics.flux": flux}
    return simulate(load_scene("rotation", COARSE | chosen), "rho_mono_kinetic", scheme)


@pytest.mark.parametrize(
    ("model", "scheme", "flux", "fitting", "reason"),
    [
        ("rho_mono_kinetic", "paper", "upwind", ("ballistic", "force"), ""),
        ("q_maxwellian", "paper", "ballistic", ("force",), ", which does not"),
        ("q_maxwellian", "accurate", "force", ("kinetic",), ", which does not"),
        ("diffusive", "accurate", "kinetic", ("ballistic", "force"), ", which does not"),
    ],
)
def test_what_is_unknown_or_does_not_fit_is_refused(
    model: str, scheme: Any, flux: str, fitting: tuple[str, ...], reason: str
) -> None:
    """In one line, which names those that fit, before there is a flow; others may be registered too."""
    scene = load_scene("rotation", {"numerics.flux": flux})
    with pytest.raises(InputError, match=r"numerics\.flux") as told:
        require_fit(model, Setup(scene, model_terms(scene, model), scheme, None, 0, 1))
    known, found = str(told.value).replace("\n", " ").split(", found ")
    assert all(name in known for name in fitting)
    assert found.startswith(f"{flux!r}{reason}")


@pytest.mark.parametrize(("scheme", "own"), [("paper", "force"), ("accurate", "ballistic")])
def test_the_schemes_own_flux_may_be_named(scheme: Any, own: str) -> None:
    """The same bits as without the key; another one gives another result, and keeps the mass."""
    implied, named = result(scheme, None), result(scheme, own)
    other = result(scheme, "ballistic" if own == "force" else "force")
    assert np.array_equal(named.variables["density"], implied.variables["density"])
    assert not np.allclose(other.variables["density"], implied.variables["density"], rtol=1e-3)
    assert other.attributes["mass_end"] == pytest.approx(1.0, abs=1e-12)


class Rusanov(NamedTuple):
    """Local Lax-Friedrichs: the mean flux less |v| times half the jump."""

    vacuum: float


@inline_kernel
def _mean_less_jump(v_l: float, v_r: float, fastest: float, low: float, high: float) -> float:
    return 0.5 * (v_l * low + v_r * high - fastest * (high - low))


@inline_kernel
def rusanov_flux(
    flux: Rusanov,  # noqa: ARG001 (the formula is chosen by it)
    stencil: Stencil,
    ratio: float,
) -> Values:
    """Through the face between `below` and `here`, times dt/h."""
    v_l = stencil.below[ALONG] * stencil.inverse[0]
    v_r = stencil.here[ALONG] * stencil.inverse[1]
    shared = ratio * v_l, ratio * v_r, ratio * max(abs(v_l), abs(v_r))
    through: Values = map_fields(_mean_less_jump, shared, (stencil.below, stencil.here))
    return through


def test_a_flux_from_outside_is_chosen_by_its_name() -> None:
    """It moves the mass as FORCE does, to what either spreads: centres within a tenth of a cell."""
    register_face_flux(Rusanov, rusanov_flux)
    register_flux_name("rusanov", lambda moved: Rusanov(moved.vacuum), carries_pressure=False)
    assert "rusanov" in flux_names()
    with pytest.raises(ValueError, match="already"):
        register_flux_name("rusanov", lambda moved: Rusanov(moved.vacuum), carries_pressure=False)
    centres = []
    for flux in ("force", "rusanov"):
        found = result("paper", flux)
        density, x = found.variables["density"][-1], found.coordinates["x"]
        assert found.attributes["mass_end"] == pytest.approx(1.0, abs=1e-12)
        assert density.min() >= 0.0
        centres.append(float((density.sum(axis=0) * x).sum() / density.sum()))
    assert centres[1] == pytest.approx(centres[0], abs=0.01)

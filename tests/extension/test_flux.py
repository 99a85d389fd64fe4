"""How to add a numerical flux: HLL, an approximate Riemann solver, which a scene then chooses by its name.

    F = (s_R F_L - s_L F_R + s_L s_R (U_R - U_L)) / (s_R - s_L)

Harten, Lax and van Leer, 1983. Three steps:

* a NamedTuple with the flux's parameters;
* a formula of what goes through the face between two cells, compiled into the sweeps;
* a name for ``[numerics] flux``, with what makes the flux of a step, and whether it bears pressure.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.compiled.algebra import Values, add, scale
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.finite_volume.fluxes import Transported, register_flux_name
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    DENSITY,
    Stencil,
    register_face_flux,
)
from ellipsoid_coupling.physics.closure import Pressure, cell_pressure, cell_sound
from ellipsoid_coupling.scenes import scene_to_toml

Floats = NDArray[np.float64]


class Hll(NamedTuple):
    """HLL for any closure; every flux has `vacuum`, the density up to which a cell counts as empty."""

    pressure: Pressure
    vacuum: float


@inline_kernel
def hll_flux(flux: Hll, stencil: Stencil, ratio: float) -> Values:
    """Through the face between `below` (left) and `here` (right), times dt/h.

    With F(U) = v U + P e_n and w = s_R - s_L this is

        s_R (v_L - s_L)/w U_L - s_L (v_R - s_R)/w U_R + (s_R P_L - s_L P_R)/w e_n
    """
    left, right = stencil.below, stencil.here
    v_l, v_r = left[ALONG] * stencil.inverse[0], right[ALONG] * stencil.inverse[1]
    c_l, c_r = cell_sound(flux.pressure, left), cell_sound(flux.pressure, right)
    s_l, s_r = min(v_l - c_l, v_r - c_r, 0.0), max(v_l + c_l, v_r + c_r, 0.0)
    share = ratio / (s_r - s_l) if s_r > s_l else 0.0
    advected = add(scale(share * s_r * (v_l - s_l), left), scale(-share * s_l * (v_r - s_r), right))
    p_l, p_r = cell_pressure(flux.pressure, left), cell_pressure(flux.pressure, right)
    push = share * (s_r * p_l - s_l * p_r)
    return (advected[DENSITY], advected[ALONG] + push, *advected[2:])


def make_hll(moved: Transported) -> Hll:
    """The flux of one step along one axis."""
    return Hll(moved.pressure, moved.vacuum)


register_face_flux(Hll, hll_flux)
register_flux_name("hll", make_hll, carries_pressure=True)


# A gas in the left half of a pipe, which expands into vacuum: circles, so that no angle matters.
TIME = 0.5
SCENE: dict[str, Any] = {
    "name": "pipe",
    "times": [TIME],
    "domain": {"x": [-1.0, 3.0], "y": [0.0, 0.1], "boundary": "reflecting"},
    "particles": {"length": 0.05, "width": 0.05, "number": 1},
    "start": {"x": [-1.0, 0.0], "y": [0.0, 0.1]},
    "numerics": {"cell": 0.02, "flux": "hll"},
}


def fan(x: Floats) -> Floats:
    """The isothermal rarefaction, sound speed 1: rho = rho_0 e^{-(1 + x/t)} from x = -t on."""
    return np.asarray(10.0 * np.exp(-np.maximum(1.0 + x / TIME, 0.0)))


def run(flux: str, cell: float) -> ec.Result:
    settings = {"numerics.flux": flux, "numerics.cell": cell}
    return ec.simulate(ec.load_scene(SCENE, settings), "q_maxwellian", scheme="paper")


def error(result: ec.Result) -> float:
    """Of the density in L1, the mass being 1."""
    off = np.abs(result.cell_density()[-1] - fan(result.coordinates["x"]))
    return float(off.sum() * result.scene.numerics.cell**2)


def test_it_resolves_a_rarefaction_better_than_force() -> None:
    """Both are first order, so that half a cell makes a corner's error 0.6 times as large or less.

    FORCE has twice HLL's diffusion at this CFL number, and errs by half as much again at least.
    """
    (coarse, fine), force = (run("hll", cell) for cell in (0.02, 0.01)), run("force", 0.01)
    assert error(fine) < 0.65 * error(coarse)
    assert error(fine) < error(force) / 1.5
    assert fine.attributes["mass_end"] == pytest.approx(1.0, abs=1e-12)
    assert fine.variables["density"].min() >= 0.0


def test_gas_at_rest_stays_at_rest() -> None:
    """A full box: no face moves anything, to rounding."""
    scene = ec.load_scene(SCENE, {"start.x": [-1.0, 3.0]})
    result = ec.simulate(scene, "q_maxwellian", scheme="paper")
    np.testing.assert_allclose(result.cell_density()[-1], 2.5, rtol=1e-12)


def test_the_command_line_knows_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the process that has registered it; `fast`, which nobody has, is refused in one line."""
    file, folder = tmp_path / "pipe.toml", tmp_path / "run"
    file.write_text(scene_to_toml(ec.load_scene(SCENE)))
    command = ["run", str(file), "--model", "q_maxwellian", "--scheme", "paper"]
    for flux, status in (("hll", 0), ("fast", 2)):
        with pytest.raises(SystemExit) as ended:
            main([*command, "--out", str(folder / flux), "--set", f"numerics.flux={flux}"])
        assert ended.value.code == status
    assert ec.Result.load(folder / "hll").scene.numerics.flux == "hll"
    assert "closure and scheme: force, hll" in " ".join(capsys.readouterr().err.split())


class Nameless(NamedTuple):
    """A flux whose formula has not been registered."""

    vacuum: float


def test_mistakes_are_told_in_one_line() -> None:
    """Before numba is asked, which would take a page for it."""
    with pytest.raises(ValueError, match="there is a flux called hll already"):
        register_flux_name("hll", make_hll, carries_pressure=True)
    with pytest.raises(TypeError, match=r"expected the arguments \(flux, stencil, ratio\)"):
        register_face_flux(Nameless, lambda left, right: left)
    register_flux_name("nameless", lambda moved: Nameless(moved.vacuum), carries_pressure=True)
    with pytest.raises(TypeError, match=r"not known for Nameless, but for .*Force.*Hll"):
        run("nameless", 0.02)

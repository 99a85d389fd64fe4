"""One particle and one filled cell without interaction: the same ordinary differential equation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import ellipsoid_coupling as ec

Floats = NDArray[np.float64]

INERTIAL = ("microscopic", "mckean_vlasov", "q_maxwellian", "q_mono_kinetic", "rho_mono_kinetic")
PARTICLES = ("microscopic", "mckean_vlasov")
SCHEMES = pytest.mark.parametrize("scheme", ["paper", "accurate"])

# Short enough that no pressure wave (speed 1) reaches the domain's open edge.
DRAG, ANGULAR_DRAG, STIFFNESS, END = 1.5, 2.5, 2.0, 0.05
TIMES = [END]
PLACE = np.array([0.41, 0.21])


def moments(result: ec.Result) -> dict[str, float]:
    """Mean position and velocities at the last saved time, of particles or of mass."""
    last = {name: values[-1] for name, values in result.variables.items()}
    if result.layout == "particles":
        return {name: float(values.mean()) for name, values in last.items()}
    density = last["density"]
    total = density.sum()
    means = {n: float((density * v).sum() / total) for n, v in last.items() if n != "density"}
    plane = density if result.layout == "rho" else density.sum(axis=0)
    x, y = np.meshgrid(result.coordinates["x"], result.coordinates["y"])
    return means | {"x": float((plane * x).sum() / total), "y": float((plane * y).sum() / total)}


def run(name: str, model: str, scheme: Any, **others: Any) -> dict[str, float]:
    """A particle, or the cell round it, of a scene without interaction and with V1."""
    h = 0.02
    box = {"start.x": [PLACE[0] - h / 2, PLACE[0] + h / 2]}
    box |= {"start.y": [PLACE[1] - h / 2, PLACE[1] + h / 2]}
    if model == "microscopic":  # its start is random: a box of a millionth of a cell is a point
        box = {f"start.{axis}": [a, a + 1e-8] for axis, a in zip("xy", PLACE, strict=True)}
    settings: dict[str, Any] = {
        "interaction": None,
        "outer_potential": {"stiffness": STIFFNESS},
        "flow.drag": DRAG,
        "flow.angular_drag": ANGULAR_DRAG,
        "particles.number": 1,
        "particles.realisations": 1,
        "domain.x": [0.0, 0.8],
        "domain.y": [-0.2, 0.6],
        "numerics.cell": h,
        "numerics.angle_cells": 12,
        # From rest, speed bounds no step of a first-order scheme; sound bounds those of the other.
        "numerics.cfl": 0.1 if model == "q_maxwellian" else 0.005,
        "numerics.time_step": 0.002,
        "numerics.tolerance": 1e-8,
    }
    return moments(ec.simulate(ec.load_scene(name, settings | box | others), model, scheme))


@SCHEMES
@pytest.mark.parametrize("model", INERTIAL)
@pytest.mark.parametrize(
    ("name", "gradient"), [("rotation", (0, 1, -1, 0)), ("top_bottom", (-1, 0, 0, 1))]
)
def test_place_and_velocity_follow_one_linear_equation(
    name: str, gradient: tuple[int, ...], model: str, scheme: str
) -> None:
    """With r' = v, v' = gamma (G r - v) - k r, linear, so the mean of any cloud obeys it exactly.

    Pressure and numerical diffusion spread the cell and leave its mean. Particles: 1e-6 (`accurate`),
    dt/2 of an acceleration of 1 (`paper`). Grids: 1e-3, where a wrong sign or factor is off by 0.02;
    the Maxwellian closure's bound is twice that, for the first fronts are as thin as a cell.
    """
    system = np.zeros((4, 4))
    system[:2, 2:] = np.eye(2)
    system[2:, :2] = DRAG * np.reshape(gradient, (2, 2)) - STIFFNESS * np.eye(2)
    system[2:, 2:] = -DRAG * np.eye(2)
    exact = expm(system * END) @ [*PLACE, 0.0, 0.0]
    found = run(name, model, scheme, times=TIMES)
    means = np.array([found[key] for key in ("x", "y", "velocity_x", "velocity_y")])
    tolerance = 2e-3 if model == "q_maxwellian" else 1e-3
    if model in PARTICLES and scheme == "accurate":
        tolerance = 1e-6
    assert np.abs(means - exact).max() < tolerance


@SCHEMES
@pytest.mark.parametrize("model", INERTIAL)
def test_spin_follows_one_equation(model: str, scheme: str) -> None:
    """Here omega' = gamma_bar (-1 - omega) in u = (y, -x) at every angle; tolerances as above."""
    found = run("rotation", model, scheme, times=TIMES, **{"numerics.angle_cells": 60})
    tolerance = 4e-3 if model == "q_maxwellian" else 1e-3
    if model in PARTICLES and scheme == "accurate":
        tolerance = 1e-6
    exact = math.expm1(-ANGULAR_DRAG * END)
    assert found["angular_velocity"] == pytest.approx(exact, abs=tolerance)


@SCHEMES
@pytest.mark.parametrize("model", INERTIAL)
@pytest.mark.parametrize("angle", [0.25, 0.75, 1.25, 1.75])
def test_strain_turns_alike(model: str, scheme: str, angle: float) -> None:
    """Here omega' = gamma_bar lambda sin(2 theta) at rest in u = (-x, y): 1.5 and -1.5 in turn.

    Over 0.002 the angle stays: omega/t to 1 %, for the damping (0.25 %) and for what pressure and
    FORCE spread over some cells of a degree and a half.
    """
    end = 0.002
    start = {"start.angle": angle * math.pi, "numerics.time_step": 2e-4, "numerics.cfl": 0.4}
    small = {"domain.x": [0.31, 0.51], "domain.y": [0.11, 0.31], "numerics.angle_cells": 240}
    found = run("top_bottom", model, scheme, times=[end], **start, **small)
    expected = 0.6 * ANGULAR_DRAG * math.sin(2.0 * math.pi * angle) * end
    assert found["angular_velocity"] == pytest.approx(expected, rel=0.01)


@SCHEMES
def test_the_diffusive_limit_is_the_same_equation_at_large_drag(scheme: str) -> None:
    """At drag 1e4 all move with v = G r - k r/gamma: rho and the limit follow the particle.

    To 4e-3 of the 0.04 moved: one cell has no neighbours from which its profile could be known.
    FORCE spreads mass like h^2/dt: with shorter steps some of it would reach the open edge.
    """
    settings = {"flow.drag": 1e4, "flow.angular_drag": 1e4, "times": [0.1], "numerics.cfl": 0.05}
    limit = run("rotation", "diffusive", scheme, **settings)
    inertial = run("rotation", "rho_mono_kinetic", scheme, **settings)
    exact = run("rotation", "microscopic", "accurate", **settings)
    for key in ("x", "y", "velocity_x", "velocity_y", "mean_angle"):
        particle = exact["angle" if key == "mean_angle" else key]
        assert limit[key] == pytest.approx(particle, abs=4e-3)
        assert inertial[key] == pytest.approx(particle, abs=4e-3)

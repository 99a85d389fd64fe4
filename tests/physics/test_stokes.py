"""Stokes' rates: sphere, small eccentricity, slender body, and a symmetric closed form in between."""

from __future__ import annotations

import math

import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.physics.stokes import resistances, stokes_rates

RHO_P, RHO_F, NU = 2500.0, 1000.0, 1e-6


def test_a_sphere_has_stokes_drag() -> None:
    """18 nu rho_f/(rho_p d^2), and 60 of it for rotation: 8 pi mu r^3 over 2 m r^2/5. To rounding."""
    d = 2e-4
    rates = stokes_rates(d, d, RHO_P, RHO_F, NU)
    assert rates.drag == pytest.approx(18.0 * NU * RHO_F / (RHO_P * d**2), rel=1e-14)
    assert rates.angular_drag == pytest.approx(60.0 * NU * RHO_F / (RHO_P * d**2), rel=1e-14)
    assert rates.mass == pytest.approx(math.pi / 6.0 * d**3 * RHO_P, rel=1e-14)
    assert rates.inertia == pytest.approx(0.1 * rates.mass * d**2, rel=1e-14)


@pytest.mark.parametrize("e", [1e-4, 1e-2, 3e-2])
def test_small_eccentricity_follows_the_series(e: float) -> None:
    """X = 1 - 2 e^2/5, Y = 1 - 3 e^2/10, Z = 1 - 9 e^2/10, up to e^4 (Kim and Karrila, 3.3)."""
    found = resistances(math.sqrt(1.0 - e**2))
    for value, slope in zip(found, (0.4, 0.3, 0.9), strict=True):
        assert value == pytest.approx(1.0 - slope * e**2, abs=max(e**4, 1e-15))


def test_slender_bodies_have_their_limit() -> None:
    """4 pi mu a/(ln(2a/b) - 1/2) along, twice that with + 1/2 across, (8/3) pi mu a^3/(...) turning:
    the corrections are of order (b/a)^2 ln, below 1e-8 here.
    """
    aspect = 1e-5
    log = math.log(2.0 / aspect)
    along, across, turning = resistances(aspect)
    assert along == pytest.approx(4.0 / 6.0 / (log - 0.5), rel=1e-8)
    assert across == pytest.approx(8.0 / 6.0 / (log + 0.5), rel=1e-8)
    assert turning == pytest.approx(1.0 / 3.0 / (log - 0.5), rel=1e-8)


def test_series_and_closed_form_meet() -> None:
    """Around e^2 = 0.1, where one takes over from the other: to rounding, with its cancellation."""
    below, above = (
        resistances(math.sqrt(1.0 - e2)) for e2 in (0.1 * (1 - 1e-12), 0.1 * (1 + 1e-12))
    )
    assert below == pytest.approx(above, rel=1e-11)


def test_resistances_are_those_of_integrals() -> None:
    """Oberbeck's: R = 16 pi mu/(chi + alpha a^2), with integrals over the confocal ellipsoids."""
    from scipy.integrate import quad

    b = 0.4

    def delta(t: float) -> float:
        return math.sqrt(1.0 + t) * (b * b + t)

    chi = quad(lambda t: 1.0 / delta(t), 0.0, math.inf)[0]
    alpha = quad(lambda t: 1.0 / (delta(t) * (1.0 + t)), 0.0, math.inf)[0]
    beta = quad(lambda t: 1.0 / (delta(t) * (b * b + t)), 0.0, math.inf)[0]
    along, across, turning = resistances(b)
    assert along == pytest.approx(16.0 / (chi + alpha) / 6.0, rel=1e-9)
    assert across == pytest.approx(16.0 / (chi + beta * b * b) / 6.0, rel=1e-9)
    # Jeffery's torque: 16 pi mu (a^2 + b^2)/(3 (a^2 alpha + b^2 beta)).
    assert turning == pytest.approx(
        16.0 / 3.0 * (1.0 + b * b) / (alpha + b * b * beta) / 8.0, rel=1e-9
    )


def test_the_drag_is_that_of_the_mean_mobility() -> None:
    """Mean over angles of 1/R in the plane: between both resistances, nearer to the smaller."""
    rates = ec.stokes_rates(2.0, 0.5, 1.0, 1.0, 1.0)
    along, across, _ = resistances(0.25)
    scale = 6.0 * math.pi / rates.mass
    assert scale * along < rates.drag < 0.5 * scale * (along + across)
    assert 1.0 / rates.drag == pytest.approx(0.5 / scale * (1.0 / along + 1.0 / across), rel=1e-14)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [((0.0, 1, 1, 1, 1), "length"), ((1, 2, 1, 1, 1), "width"), ((1, 1, -1, 1, 1), "particle_density"),
     ((1, 1, 1, math.nan, 1), "fluid_density"), ((1, 1, 1, 1, math.inf), "viscosity")],
)  # fmt: skip
def test_what_is_no_particle_is_refused(arguments: tuple[float, ...], name: str) -> None:
    with pytest.raises(InputError, match=f"^{name}: "):
        stokes_rates(*arguments)

"""Particle steppers: declared order, exact linear part, noise of the right law, energy, walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.interaction.particle_forces import Drift
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.clocks import Stepper
from ellipsoid_coupling.particles.forces import BlockForces
from ellipsoid_coupling.particles.linear import (
    linear_step,
    phi_functions,
    position_variance,
)
from ellipsoid_coupling.particles.noise import STEPS_PER_BLOCK, gaussian_block
from ellipsoid_coupling.particles.own_clock import advance_own_clocks
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates
from ellipsoid_coupling.physics.drift import External, Fluid
from ellipsoid_coupling.physics.outer import Harmonic
from ellipsoid_coupling.stepping.status import NOT_FINITE
from ellipsoid_coupling.stepping.step_control import (
    GIVEN,
    LARGEST_FORCE,
    LARGEST_TORQUE,
    REJECTED,
    STATUS,
    STEPS,
    TIME,
    new_clock,
)

Floats = NDArray[np.float64]
FLOW = analytic_flow("top_bottom")
PAPER, ACCURATE = STEPPERS["paper"], STEPPERS["accurate"]
BOTH = pytest.mark.parametrize("scheme", list(STEPPERS.values()), ids=list(STEPPERS))


def drift_of(drag: float = 0.0, stiffness: float = 0.0) -> Drift:
    """A stagnation flow and a harmonic potential; where either is nothing it is 0, for the same kernels."""
    return Drift(External(Fluid(FLOW.arrays, drag, 0.0, 0.0), Harmonic(stiffness)))


def state_at(place: Floats, velocity: Floats, noise: Floats | None = None) -> ParticleState:
    """One realisation; place and velocity (D, N)."""
    clock = new_clock(1, np.inf, GIVEN)
    return ParticleState(place[None].copy(), velocity[None].copy(), 0 * place[None], clock, noise)


def rates_of(damping: float, noise: float = 0.0, degrees: int = 2) -> Rates:
    quiet = 2 if noise == 0.0 else 0
    return Rates(np.full(degrees, damping), np.full(degrees, noise), quiet, 2)


def limits_of(step: float, degrees: int = 2, tolerance: float = 1e30) -> Limits:
    return Limits(step, tolerance, np.ones(degrees), None)


def advance(
    scheme: Stepper,
    state: ParticleState,
    drift: Drift,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """Each realisation on its own clock."""
    advance_own_clocks(scheme, state, BlockForces(drift, None), rates, limits, until, steps)


def march(
    scheme: Stepper, state: ParticleState, drift: Drift, rates: Rates, dt: float, end: float
) -> None:
    """Fixed steps: each call may only reach its own end."""
    degrees = state.position.shape[1]
    for n in range(round(end / dt)):
        advance(scheme, state, drift, rates, limits_of(dt, degrees), (n + 1) * dt, 1)


def stagnation_truth(x: float, y: float, t: float) -> tuple[float, float]:
    """X'' = -x - x', y'' = y - y' from rest."""
    w = math.sqrt(3.0) / 2.0
    decay = math.exp(-t / 2.0)
    root = math.sqrt(5.0)
    up, down = (-1 + root) / 2, (-1 - root) / 2
    return (
        x * decay * (math.cos(w * t) + math.sin(w * t) / (2 * w)),
        y * (up * math.exp(down * t) - down * math.exp(up * t)) / root,
    )


@BOTH
def test_order_is_the_declared_one(scheme: Stepper) -> None:
    """Errors at dt and dt/2 on the closed form of top_bottom; the slope within 0.15."""
    drift = drift_of(1.0)
    truth = np.array(stagnation_truth(0.7, 0.4, 1.6))
    errors = []
    for dt in (0.02, 0.01):
        state = state_at(np.array([[0.7], [0.4]]), np.zeros((2, 1)))
        march(scheme, state, drift, rates_of(1.0), dt, 1.6)
        errors.append(np.abs(state.position[0, :, 0] - truth).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(scheme.order, abs=0.15)


def test_accurate_meets_its_closed_form_to_1e6() -> None:
    drift = drift_of(1.0)
    state = state_at(np.array([[0.7], [0.4]]), np.zeros((2, 1)))
    limits = limits_of(0.01, tolerance=1e-10)
    while state.clock[0, TIME] < 2.0:
        advance(ACCURATE, state, drift, rates_of(1.0), limits, 2.0, 1000)
    assert np.abs(state.position[0, :, 0] - stagnation_truth(0.7, 0.4, 2.0)).max() < 1e-6


def test_the_error_follows_the_tolerance() -> None:
    """A thousandth of the tolerance: third-order estimate, second-order error, so at least 30."""
    drift = drift_of(1.0)
    errors = []
    for tolerance in (1e-4, 1e-7):
        state = state_at(np.array([[0.7], [0.4]]), np.zeros((2, 1)))
        limits = limits_of(0.1, tolerance=tolerance)
        while state.clock[0, TIME] < 2.0:
            advance(ACCURATE, state, drift, rates_of(1.0), limits, 2.0, 1000)
        errors.append(np.abs(state.position[0, :, 0] - stagnation_truth(0.7, 0.4, 2.0)).max())
    assert errors[0] / errors[1] > 30


def test_stiff_drag_costs_nothing() -> None:
    """Gamma = 1e6, dt = 0.01: the particle follows the fluid, as Heun's rule does (1e-4)."""
    drift = drift_of(1e6)
    state = state_at(np.array([[0.7], [0.4]]), np.zeros((2, 1)))
    march(ACCURATE, state, drift, rates_of(1e6), 0.01, 1.0)
    expected = [0.7 * math.exp(-1.0), 0.4 * math.exp(1.0)]
    assert np.allclose(state.position[0, :, 0], expected, rtol=1e-4)


@pytest.mark.parametrize("z", [0.0, 1e-9, 1e-3, 0.3, 0.49, 0.51, 2.0, 50.0])
def test_phi_functions_against_their_integrals(z: float) -> None:
    """phi_k = int_0^1 e^{-z (1 - s)} s^{k-1}/(k-1)! ds, by Gauss-Legendre; 1e-14 relative."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    s, w = 0.5 * (nodes + 1), 0.5 * weights
    expected = [np.sum(w * np.exp(-z * (1 - s)) * s**k / math.factorial(k)) for k in range(3)]
    assert np.allclose(phi_functions(z), expected, rtol=1e-12 if z > 10 else 1e-14)
    held = -np.expm1(-z * s) / z if z > 0 else s  # what a velocity kick adds to the place
    assert position_variance(z) == pytest.approx(np.sum(w * held**2), rel=1e-13)


def test_noise_has_the_exact_covariance() -> None:
    """Two half steps compose to one step: same covariance of place and velocity, to rounding."""

    def covariance(dt: float, halves: int) -> Floats:
        total = np.zeros((2, 2))
        for _ in range(halves):
            s = linear_step(1.3, 0.7, dt)
            move = np.array([[1.0, s.position_velocity], [0.0, s.decay]])
            kick = np.array([[s.position_noise, 0.0], [s.shared_noise, s.own_noise]])
            total = move @ total @ move.T + kick @ kick.T
        return total

    assert np.allclose(covariance(0.4, 1), covariance(0.2, 2), rtol=1e-13)


@pytest.mark.parametrize(("scheme", "bias"), [(ACCURATE, 1.0), (PAPER, 1 / (1 - 0.125))])
def test_velocities_settle_to_the_known_gaussian(scheme: Stepper, bias: float) -> None:
    """A = 1, Gamma = 1/2, dt = 1/2: unit variance exactly, 1/(1 - dt Gamma/2) for Euler-Maruyama.

    10 000 numbers give the variance to 1.4 %; four standard deviations are allowed.
    """
    n, dt = 5000, 0.5
    state = state_at(np.zeros((2, n)), np.zeros((2, n)))
    for block in range(3):
        noise = gaussian_block(3, 0, block, 2 * scheme.noise_per_step, n)[None]
        for step in range(STEPS_PER_BLOCK):
            one = state._replace(noise=np.ascontiguousarray(noise[:, step : step + 1]))
            until = (block * STEPS_PER_BLOCK + step + 1) * dt
            advance(scheme, one, drift_of(), rates_of(0.5, 1.0), limits_of(dt), until, 1)
    assert state.velocity.var() == pytest.approx(bias, rel=4 * math.sqrt(2 / (2 * n)))
    assert abs(state.velocity.mean()) < 4 / math.sqrt(2 * n)


def test_strong_order_one_of_the_paper_scheme_on_one_brownian_path() -> None:
    """Additive noise: Euler-Maruyama has strong order 1; coarse steps sum the fine increments."""
    n, fine_steps, end = 400, 256, 1.0
    fine = np.random.default_rng(1).standard_normal((fine_steps, 2, n))
    ends = []
    for merged in (1, 8, 16):
        steps = fine_steps // merged
        dt = end / steps
        noise = fine.reshape(steps, merged, 2, n).sum(axis=1) / math.sqrt(merged)
        state = state_at(np.zeros((2, n)), np.zeros((2, n)), noise[None].copy())
        drift = drift_of(stiffness=2.0)
        advance(PAPER, state, drift, rates_of(0.5, 1.0), limits_of(dt), end, steps)
        ends.append(state.position[0].copy())
    errors = [math.sqrt(np.mean((e - ends[0]) ** 2)) for e in ends[1:]]
    assert math.log2(errors[1] / errors[0]) == pytest.approx(1.0, abs=0.2)


def oscillator_energies(tolerance: float, periods: int, drag: float = 0.0) -> Floats:
    """Energy over that at the start, after each call of an oscillator, steps of its own choice."""
    drift, found = drift_of(stiffness=1.0), []
    state = state_at(np.array([[1.0, 0.6], [0.0, 0.3]]), np.array([[0.0, 0.1], [0.5, 0.0]]))
    first = (state.position**2 + state.velocity**2).sum()
    limits, end = limits_of(0.01, tolerance=tolerance), 2.0 * np.pi * periods
    while state.clock[0, TIME] < end:
        advance(ACCURATE, state, drift, rates_of(drag), limits, end, 17)
        found.append((state.position**2 + state.velocity**2).sum() / first - 1.0)
    return np.array(found)


def test_energy_without_drag_does_not_drift() -> None:
    """1000 oscillations: velocity Verlet's ripple, dt^2/4 = 2e-3 at most, and nothing that grows.

    Eight times the error lets the step be twice as long, and the ripple four times as large (order 2).
    """
    loose, strict = oscillator_energies(1e-4, 1000), oscillator_energies(1e-4 / 8.0, 1000)
    late = len(loose) // 2
    assert np.abs(loose).max() < 3e-3
    assert abs(loose[late:].mean() - loose[late // 2 : late].mean()) < 1e-5
    assert np.abs(loose).max() / np.abs(strict).max() == pytest.approx(4.0, rel=0.4)


@pytest.mark.parametrize("drag", [1e-6, 1e-5, 1e-4])
def test_weak_drag_takes_the_energy_that_it_should(drag: float) -> None:
    """1000 oscillations: e^{-drag t} of it, up to the ripple of 3e-3; the correction took a third."""
    energies = 1.0 + oscillator_energies(1e-4, 1000, drag)
    assert energies[-1] == pytest.approx(math.exp(-2000.0 * math.pi * drag), abs=3e-3)


def test_steps_without_drag_can_be_reversed() -> None:
    """100 steps on, velocities turned round, 100 steps on: the start, to rounding (1e-12)."""
    drift = drift_of(stiffness=1.0)
    state = state_at(np.array([[1.0], [0.3]]), np.array([[0.0], [0.5]]))
    march(ACCURATE, state, drift, rates_of(0.0), 0.1, 10.0)
    back = state_at(state.position[0], -state.velocity[0])
    march(ACCURATE, back, drift, rates_of(0.0), 0.1, 10.0)
    assert np.allclose(back.position[0], [[1.0], [0.3]], atol=1e-12)
    assert np.allclose(back.velocity[0], [[0.0], [-0.5]], atol=1e-12)


def test_the_first_step_with_noise_follows_the_tolerance() -> None:
    """Planned 1, from rest in V1 at 2, A = 0.1: the mean at t = 1 against its closed form.

    20 000 numbers give it to 4e-4 (4 sigma 1.6e-3); one step of 1 is off by 0.08.
    """
    number, drift = 20_000, drift_of(stiffness=1.0)
    state = state_at(np.full((2, number), 2.0), np.zeros((2, number)))
    limits, rates, block = limits_of(1.0, tolerance=1e-6), rates_of(0.005, 0.1), 0
    while state.clock[0, TIME] < 1.0:
        noise = gaussian_block(3, 0, block, 4, number)[None]
        advance(ACCURATE, state._replace(noise=noise), drift, rates, limits, 1.0, STEPS_PER_BLOCK)
        block += 1
    w = math.sqrt(1.0 - 0.0025**2)
    mean = 2.0 * math.exp(-0.0025) * (math.cos(w) + 0.0025 / w * math.sin(w))
    assert state.position.mean() == pytest.approx(
        mean, abs=4.0 * state.position.std() / number**0.5
    )
    assert state.clock[0, REJECTED] > 0


def test_the_worst_particle_bounds_the_step() -> None:
    """One spring among 10 000 that rest: its error is bounded, at 10 times the tolerance."""
    drift = drift_of(stiffness=100.0)
    errors = []
    for bystanders in (0, 10_000):
        place = np.zeros((2, 1 + bystanders))
        place[0, 0] = 1.0
        state = state_at(place, 0.0 * place)
        limits = limits_of(0.01, tolerance=1e-6)
        while state.clock[0, TIME] < 1.0:
            advance(ACCURATE, state, drift, rates_of(0.5), limits, 1.0, 1000)
        w = math.sqrt(100.0 - 0.0625)
        truth = math.exp(-0.25) * (math.cos(w) + 0.25 / w * math.sin(w))
        errors.append(abs(state.position[0, 0, 0] - truth))
    assert errors[1] < 10.0 ** (2.0 / 3.0) * 1.3 * errors[0]


def test_both_steppers_keep_the_largest_force() -> None:
    """Of the start, though all calls end where the force is small: V1 from 2, a quarter period a call."""
    drift = drift_of(stiffness=1.0)
    for scheme in STEPPERS.values():
        state = state_at(np.array([[-2.0], [0.5]]), np.zeros((2, 1)))
        march(scheme, state, drift, rates_of(0.0), math.pi / 64.0, math.pi / 2.0)
        assert abs(state.force[0]).max() < 0.2
        assert state.clock[0, LARGEST_FORCE] == 2.0
        assert state.clock[0, LARGEST_TORQUE] == 0.0


@BOTH
def test_walls_reflect(scheme: Stepper) -> None:
    """A free flight between two walls is a triangle wave, exactly (1e-12), speeds kept."""
    box = np.array([[0.0, 1.0], [0.0, 1.0]])
    limits = Limits(0.07, 1e30, np.ones(2), box)
    state = state_at(np.array([[0.2], [0.5]]), np.array([[1.3], [-0.9]]))
    advance(scheme, state, drift_of(), rates_of(0.0), limits, 3.1, 1000)
    way = np.array([0.2 + 1.3 * 3.1, 0.5 - 0.9 * 3.1])
    folded = np.abs(np.mod(way + 1.0, 2.0) - 1.0)
    assert np.allclose(state.position[0, :, 0], folded, atol=1e-12)
    assert np.allclose(np.abs(state.velocity[0, :, 0]), [1.3, 0.9], atol=1e-12)


def test_an_unstable_step_is_reported_not_hidden() -> None:
    """Euler with dt Gamma = 10 explodes: the status says so."""
    drift = drift_of(stiffness=1.0)
    state = state_at(np.ones((2, 1)), np.ones((2, 1)))
    advance(PAPER, state, drift, rates_of(100.0), limits_of(0.1), 1e6, 10**6)
    assert state.clock[0, STATUS] == NOT_FINITE


def test_too_long_steps_are_repeated_shorter() -> None:
    drift = drift_of(stiffness=1e4)
    state = state_at(np.ones((2, 1)), np.zeros((2, 1)))
    advance(ACCURATE, state, drift, rates_of(0.0), limits_of(1.0, tolerance=1e-6), 0.01, 10**6)
    assert state.clock[0, REJECTED] > 0
    assert state.clock[0, STEPS] > 1
    assert np.allclose(state.position[0], math.cos(1.0), atol=1e-4)

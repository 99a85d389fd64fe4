"""Fluxes and sweeps: conservation, positivity, the maximum principle, order, slow twins."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.finite_volume.boundary import fill_periodic
from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force, ballistic, force
from ellipsoid_coupling.finite_volume.fluxes.contract import VACUUM, Stencil, kept_for, through_face
from ellipsoid_coupling.finite_volume.grid import GHOSTS, interior
from ellipsoid_coupling.geometry.boundaries import Reflect, Remove
from tests.finite_volume.whole import fill, sweep

Floats = NDArray[np.float64]
FLUXES = {
    "force": Force(0.0),
    "force with pressure": Force(1.0),
    "ballistic": Ballistic((0.05, *(0.1,) * 4)),
}
BOTH = pytest.mark.parametrize("flux", list(FLUXES.values()), ids=list(FLUXES))


def random_fields(ny: int = 9, nx: int = 13, seed: int = 0) -> Floats:
    """Density, momenta, two carried quantities; a third of the cells is vacuum; |v| <= 1."""
    rng = np.random.default_rng(seed)
    fields = np.zeros((5, ny + 2 * GHOSTS, nx + 2 * GHOSTS))
    inner = interior(fields)
    inner[0] = rng.random((ny, nx)) * (rng.random((ny, nx)) > 0.33)
    for k in range(1, 5):
        inner[k] = inner[0] * rng.uniform(-1, 1, (ny, nx))
    return fields


def stencils(flat: Floats, first: int, cells: int) -> list[Stencil]:
    """Of the `cells` cells along x from the one before `first` on, density and momentum first."""
    density = flat[0]
    inverse = np.divide(1.0, density, out=np.zeros(density.size), where=density > VACUUM)
    return [
        Stencil(
            tuple(flat[:, p - 1]),
            tuple(flat[:, p]),
            tuple(flat[:, p + 1]),
            (inverse[p - 1], inverse[p], inverse[p + 1]),
            p,
            1,
        )
        for p in range(first - 1, first + cells - 1)
    ]


def carried(fields: Floats) -> Floats:
    rho = interior(fields)[0]
    return np.asarray(interior(fields)[1:, rho > 1e-12] / rho[rho > 1e-12])


@BOTH
@pytest.mark.parametrize("axis", [-1, -2])
def test_closed_box_keeps_mass_and_positivity(flux: Any, axis: int) -> None:
    """Random data with vacuum at the CFL number 0.95 (0.4 with sound speed 1): mass to rounding."""
    fields = random_fields()
    ratio = 0.4 if flux == Force(1.0) else 0.95
    before = interior(fields)[0].sum()
    for _ in range(3):
        fill(fields, axis, Reflect())
        sweep(flux, fields, axis, -axis, ratio)
        assert interior(fields)[0].min() >= 0.0
        speeds = carried(fields)[-axis - 1]
        ratio = min(ratio, 0.95 / (np.abs(speeds).max() + (flux == Force(1.0))))
    assert interior(fields)[0].sum() == pytest.approx(before, rel=1e-14)


@BOTH
@pytest.mark.parametrize("axis", [-1, -2])
@pytest.mark.parametrize("inwards", [False, True])
def test_open_edges_let_nothing_in(flux: Any, axis: int, inwards: bool) -> None:
    """Random data up to the edge: mass falls. All edges moving inwards: it stays, to rounding."""
    fields = random_fields()
    inner = interior(fields)
    if inwards:
        for normal, across in ((1, 1), (2, 0)):
            lines = np.moveaxis(inner, across + 1, 1)
            for edge, sign in ((0, 1.0), (-1, -1.0)):
                lines[normal, edge] = sign * np.abs(lines[normal, edge])
    before = inner[0].sum()
    fill(fields, axis, Remove())
    sweep(flux, fields, axis, -axis, 0.4)
    change = inner[0].sum() / before - 1.0
    assert change == pytest.approx(0.0, abs=1e-14) if inwards else change < -1e-3


@pytest.mark.parametrize("seed", range(5))
def test_ballistic_keeps_carried_quantities_in_their_range(seed: int) -> None:
    """The maximum principle where no slope is continued into vacuum: no vacuum here. To rounding."""
    fields = random_fields(seed=seed)
    interior(fields)[0] += 0.05
    for k in range(1, 5):
        interior(fields)[k] = interior(fields)[0] * np.random.default_rng(k).uniform(
            -1, 1, interior(fields)[0].shape
        )
    low, high = carried(fields).min(axis=1), carried(fields).max(axis=1)
    for axis in (-1, -2):
        fill(fields, axis, Remove())
        sweep(Ballistic((0.05, *(0.1,) * 4)), fields, axis, -axis, 0.9)
    rounding = 1e-12
    assert np.all(carried(fields).min(axis=1) >= low - rounding)
    assert np.all(carried(fields).max(axis=1) <= high + rounding)


@BOTH
def test_x_and_y_are_treated_alike(flux: Any) -> None:
    """A transposed field with exchanged momenta gives the transposed result, bit for bit nearly."""
    fields = random_fields(11, 11)
    turned = np.ascontiguousarray(fields.transpose(0, 2, 1)[[0, 2, 1, 3, 4]])
    fill(fields, -1, Remove())
    fill(turned, -2, Remove())
    sweep(flux, fields, -1, 1, 0.4)
    sweep(flux, turned, -2, 2, 0.4)
    back = turned.transpose(0, 2, 1)[[0, 2, 1, 3, 4]]
    assert np.allclose(interior(fields), interior(np.ascontiguousarray(back)), atol=1e-15)


def faces(flux: Any, flat: Floats, first: int, cells: int) -> Floats:
    """What goes up through the lower faces of `cells` cells along x from `first` on, (K, cells).

    By the plain Python formulas.
    """
    return FACES[type(flux)](flux, stencils(flat, first, cells + 1))


def _faces_of_force(flux: Any, here: list[Stencil]) -> Floats:
    return np.transpose([plain(force.force_flux)(flux, each, 0.4) for each in here[1:]])


def _faces_of_ballistic(flux: Any, here: list[Stencil]) -> Floats:
    """What the cell below sends up less what the cell above sends down."""
    outflows = [plain(ballistic.ballistic_outflow)(flux, each, 0.4) for each in here]
    ups, downs = np.transpose(outflows, (1, 2, 0))
    return np.asarray(ups[:, :-1] - downs[:, 1:])


FACES: dict[type[Any], Callable[[Any, list[Stencil]], Floats]] = {
    Force: _faces_of_force,
    Ballistic: _faces_of_ballistic,
}
# How many numbers of a cell a flux keeps for the next face.
KEPT = {Force: 0, Ballistic: 5}


@BOTH
@pytest.mark.parametrize("columns", [5, 13, 16])
def test_compiled_sweep_equals_its_plain_twin(flux: Any, columns: int) -> None:
    """One row by the plain formulas and U += F_- - F_+, to rounding; whole vectors and parts of them."""
    fields = random_fields(1, columns)
    fill(fields, -1, Reflect())
    flat = fields.reshape(5, -1)
    first = GHOSTS * fields.shape[2] + GHOSTS
    through = faces(flux, flat, first, columns + 1)
    expected = flat[:, first : first + columns] + through[:, :-1] - through[:, 1:]
    sweep(flux, fields, -1, 1, 0.4)
    assert np.allclose(interior(fields)[:, 0], expected, atol=1e-14)


@pytest.mark.parametrize(("flux", "order"), [(Force(0.0), 1), (Ballistic((0.05, *(0.1,) * 4)), 2)])
def test_order_on_a_smooth_flight(flux: Any, order: int) -> None:
    """Rho = 1 + sin/2 flying with v = 1 + sin(2 pi x)/4 for t = 0.1, periodic; slope within 0.3.

    Exact: the density at x + v(x) t is rho(x) / (1 + v'(x) t), and v is carried along.
    """
    errors = []
    for n in (80, 160, 320):
        fields = np.zeros((5, 1 + 2 * GHOSTS, n + 2 * GHOSTS))
        edges = np.arange(n + 1) / n

        def mass(x: Floats) -> Floats:
            return x - 0.25 / math.pi * np.cos(2 * math.pi * x)

        x = edges[:-1] + 0.5 / n
        interior(fields)[0] = np.diff(mass(edges)) * n
        interior(fields)[1] = interior(fields)[0] * (1 + 0.25 * np.sin(2 * math.pi * x))
        steps = round(0.1 * n / 0.5)
        for _ in range(steps):
            fill_periodic(fields, 2)
            sweep(flux, fields, -1, 1, 0.1 / steps * n)
        errors.append(np.abs(interior(fields)[0, 0] - _flown_means(edges, mass, n)).mean())
    slopes = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert slopes[-1] == pytest.approx(order, abs=0.3)


def _flown_means(edges: Floats, mass: Any, n: int) -> Floats:
    """Cell means after t = 0.1: the mass between the feet of the cell's edges."""
    feet = edges.copy()
    for _ in range(60):
        feet = edges - 0.1 * (1 + 0.25 * np.sin(2 * math.pi * feet))
    return np.asarray(np.diff(mass(feet)) * n)


def test_an_open_edge_lets_mass_leave() -> None:
    """A block beside the right edge, all at speed 0.8: at CFL 0.8 just 0.8 of its last column."""
    fields = np.zeros((5, 9, 13))
    interior(fields)[0][:, -4:] = 2.0
    interior(fields)[1] = 0.8 * interior(fields)[0]
    fill(fields, -1, Remove())
    sweep(Ballistic((0.05, *(0.1,) * 4)), fields, -1, 1, 1.0)
    assert interior(fields)[0].sum() == pytest.approx(5 * 2.0 * (4 - 0.8), rel=1e-14)


def test_a_periodic_direction_is_a_ring() -> None:
    fields = random_fields(8, 8)
    fill_periodic(fields, 1)
    assert np.array_equal(fields[:, :2, 2:-2], interior(fields)[:, -2:])
    assert np.array_equal(fields[:, -2:, 2:-2], interior(fields)[:, :2])


class Strange(NamedTuple):
    vacuum: float


def test_an_unknown_flux_is_refused() -> None:
    cell = (1.0, 0.0)
    stencil = Stencil(cell, cell, cell, (1.0, 1.0, 1.0), 0, 1)
    with pytest.raises(TypeError, match=r"not known for Strange, but for .*Force"):
        through_face(Strange(0.0), stencil, (), 1.0)
    with pytest.raises(TypeError, match="not known for Strange"):
        kept_for(Strange(0.0), cell)


@BOTH
def test_python_finds_the_flux_of_a_type(flux: Any) -> None:
    """A sweep's loop in Python, to rounding: fused multiply-adds round once in kernels."""
    flat = random_fields(1, 13).reshape(5, -1)
    first = GHOSTS * (13 + 2 * GHOSTS) + GHOSTS
    up = kept_for(flux, (0.0,) * 5)
    assert up == (0.0,) * KEPT[type(flux)]
    through = []
    for here in stencils(flat, first, 12):
        face, up = through_face(flux, here, up, 0.4)
        through.append(face)
    expected = faces(flux, flat, first, 11)
    np.testing.assert_allclose(np.transpose(through[1:]), expected, atol=1e-15)

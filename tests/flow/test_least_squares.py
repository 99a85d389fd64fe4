"""The fit of a bicubic spline: its rows, its regulariser, and the order of elimination."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from ellipsoid_coupling.flow.least_squares import (
    Equations,
    Nodes,
    _dissected,
    solve,
    spline_rows,
    third_differences,
)

NODES = Nodes(-1.0, 2.0, 0.25, 0.5, 9, 7)


def _cubic() -> np.ndarray:
    """The coefficients of x^3 - 2 x y^2: those of x^k are x^k - k (k - 1) h^2 / 6 x^(k - 2)."""
    x = NODES.x0 + NODES.dx * (np.arange(NODES.nx + 3) - 1.0)
    y = (NODES.y0 + NODES.dy * (np.arange(NODES.ny + 3) - 1.0))[:, None]
    return x**3 - NODES.dx**2 * x - 2.0 * x * (y**2 - NODES.dy**2 / 3.0)


def test_rows_are_the_spline_and_its_derivatives() -> None:
    """A cubic is met to rounding, up to the last nodes."""
    x, y = NODES.lines()
    at = np.concatenate((
        np.random.default_rng(0).uniform((x[0], y[0]), (x[-1], y[-1]), (100, 2)),
        [(x[0], y[0]), (x[-1], y[-1])],
    ))  # fmt: skip
    (px, py), c = at.T, _cubic().ravel()
    for along, exact in (
        ("", px**3 - 2.0 * px * py**2),
        ("x", 3.0 * px**2 - 2.0 * py**2),
        ("y", -4.0 * px * py),
    ):
        np.testing.assert_allclose(spline_rows(NODES, at, along) @ c, exact, atol=1e-11)


def test_third_differences_leave_quadratics_alone() -> None:
    used = np.ones(NODES.shape, np.bool_)
    i, j = np.indices(NODES.shape)
    quadratic = (1.0 + i - 2.0 * j + i * j + 3.0 * i**2 - j**2).ravel()
    assert np.abs(third_differences(used).rows @ quadratic).max() < 1e-12
    # Of x^2 y each one is 2, and it counts three times.
    mixed = third_differences(used).rows @ (j**2 * i).ravel().astype(float)
    np.testing.assert_allclose(np.unique(np.round(np.abs(mixed), 9)), [0.0, 2.0 * np.sqrt(3.0)])


def test_third_differences_take_used_coefficients_only() -> None:
    used = np.zeros(NODES.shape, np.bool_)
    used[2:6, 3:8] = True
    rows = third_differences(used).rows
    assert rows.shape[0] == 4 * 2 + 3 * 3 + 2 * 4 + 1 * 5
    assert set(np.unique(rows.indices)) == set(np.flatnonzero(used))


def test_the_best_fit_is_that_of_dense_least_squares() -> None:
    """To rounding; coefficients that are not looked for repeat the nearest one that is."""
    random = np.random.default_rng(1)
    used = np.ones(NODES.shape, np.bool_)
    used[:, 9:] = False
    x, y = NODES.lines()
    at = random.uniform((x[0], y[0]), (x[6], y[-1]), (200, 2))
    data = Equations(spline_rows(NODES, at, ""), random.standard_normal(200))
    parts = [data, third_differences(used).weighted(0.1)]
    found = solve(parts, used)
    dense = np.vstack([part.rows.toarray() for part in parts])[:, used.ravel()]
    right = np.concatenate([part.values for part in parts])
    expected = np.linalg.lstsq(dense, right, rcond=None)[0]
    np.testing.assert_allclose(found[used], expected, atol=1e-9)
    np.testing.assert_array_equal(found[:, 9:], np.repeat(found[:, 8:9], 3, axis=1))


@pytest.mark.parametrize("shape", [(1, 1), (5, 200), (60, 70)])
def test_the_order_is_one_of_all(shape: tuple[int, int]) -> None:
    places = np.stack(np.divmod(np.arange(shape[0] * shape[1]), shape[1]))
    order = _dissected(places)
    np.testing.assert_array_equal(np.sort(order), np.arange(order.size))


def test_elimination_grows_like_n_log_n() -> None:
    """Numbers in the factor, a coefficient: 4 times as many coefficients, less than 1.6 times as many.

    In the order of rows that would be 2 times.
    """
    filled = []
    for side in (60, 120):
        nodes = Nodes(0.0, 0.0, 1.0, 1.0, side, side)
        at = np.stack(np.meshgrid(*nodes.lines()), axis=-1).reshape(-1, 2)
        rows = spline_rows(nodes, at + 0.25, "")
        places = np.stack(np.divmod(np.arange(rows.shape[1]), nodes.shape[1]))
        rows = csr_array(rows)[:, _dissected(places)]
        normal = (rows.T @ rows).tocsc()
        normal.setdiag(normal.diagonal() + 1.0)
        options = {"SymmetricMode": True}
        factor = splu(normal, permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)
        filled.append(factor.L.nnz / rows.shape[1])
    assert filled[1] < 1.6 * filled[0], filled

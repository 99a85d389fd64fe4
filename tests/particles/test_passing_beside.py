"""Edges that a path passes beside are left out of the search for the edge that it meets: none too many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.edge_grid import ALONG_X, ALONG_Y, REFLECTS, EdgeGrid, X, Y
from ellipsoid_coupling.geometry.edge_sorting import Edges, edge_grid
from ellipsoid_coupling.particles.path_parts import Path, next_part
from ellipsoid_coupling.particles.paths import _crosses, _meets, _passes_beside

Floats = NDArray[np.float64]
DAMPING, TIME = 10.0, 0.02


def split_box(parts: int) -> EdgeGrid:
    """A box whose sides are many edges on one line each."""
    corners, t = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]), np.arange(parts + 1)
    pairs = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    lines = [a + t[:, None] / parts * (b - a) for a, b in pairs]
    ends = np.concatenate([np.stack((line[:-1], line[1:]), axis=1) for line in lines])
    count = len(ends)
    edges = Edges(ends, np.zeros((count, 2)), np.full(count, REFLECTS), np.arange(count))
    return edge_grid(edges, (0.0, 2.0), (0.0, 1.0))


@kernel
def search(edges: EdgeGrid, starts: Floats, counts: NDArray[np.int64]) -> None:
    """Counts, over paths and edges that they begin before: left out, met, and met though left out."""
    for i in range(len(starts)):
        x, y, u, v, f, g, s, r = starts[i]
        path = Path((x, y), (u, v), (f, g), (s, r), (0.1 * v, 0.1 * u), (0.0, 0.0), DAMPING)
        part = next_part(edges, path, TIME)
        for e in range(len(edges.lines)):
            line = edges.lines[e]
            nx, ny = -line[ALONG_Y], line[ALONG_X]
            before = nx * (x - line[X]) + ny * (y - line[Y])
            after = nx * (part.position[0] - line[X]) + ny * (part.position[1] - line[Y])
            if before >= 0.0:
                beside = _passes_beside(edges, line, path, part)
                met = _meets(edges, e, path, part, before) < np.inf
                # That one is asked of ways that end beyond the line.
                crossed = after < 0.0 and _crosses(edges, e, path, part, (before, after)) < np.inf
                counts[0] += beside
                counts[1] += met or crossed
                counts[2] += beside and (met or crossed)


def test_no_edge_that_is_met_is_left_out() -> None:
    """Of paths that bend, near a wall and its corners; most of the wall's edges are left out."""
    rng, n = np.random.default_rng(3), 4000
    starts = np.column_stack(
        (
            2.0 - rng.uniform(0.0, 0.01, n) ** 1.5,
            rng.choice([0.0, 0.25, 0.5, 1.0], n) + rng.normal(0.0, 0.004, n),
            *rng.normal(0.0, 2.0, (2, n)),
            *rng.normal(0.0, 60.0, (2, n)),
            *rng.normal(0.0, 2000.0, (2, n)),
        )
    )
    starts[:, 1] = np.clip(np.abs(starts[:, 1]), 1e-6, 1.0 - 1e-6)
    counts = np.zeros(3, np.int64)
    search(split_box(64), starts, counts)
    left_out, met, wrong = counts.tolist()
    assert wrong == 0
    assert met > 1000
    assert left_out > 20 * met

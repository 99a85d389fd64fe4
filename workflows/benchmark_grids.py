"""Sweeps, interaction integrals, whole q and rho steps."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from unittest import mock

import numba
import numpy as np
from benchmark_tools import Floats, Row, Sizes, limits, seconds, step_seconds, with_threads

from ellipsoid_coupling import load_scene, simulate
from ellipsoid_coupling.compiled.jit import parallel_kernel
from ellipsoid_coupling.finite_volume import cells as cell_fields
from ellipsoid_coupling.finite_volume import q_grid
from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force
from ellipsoid_coupling.finite_volume.fluxes.contract import Flux
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.q_transport import transport, transport_in_plane
from ellipsoid_coupling.geometry.boundaries import Remove, everywhere
from ellipsoid_coupling.geometry.ghost_table import ghost_table
from ellipsoid_coupling.interaction.grid_forces import half_widths
from ellipsoid_coupling.interaction.q_grid import AngleGridInteraction
from ellipsoid_coupling.interaction.select import choose_interaction
from ellipsoid_coupling.models import Setup, build_model
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape
from ellipsoid_coupling.scenes import terms_of
from ellipsoid_coupling.simulation import scene_flow

SHAPE = potential_shape(0.1, 0.05)
SPACING = 0.02
# Tolerances of the rho integral. They bound any field of angles; the measured errors are a tenth of them.
TOLERANCES = (7e-2, 5e-2, 2e-2, 1e-4)


def smooth_fields(cells: int, angles: int) -> Floats:
    """Four padded fields without vacuum, velocities of order 1."""
    fields = np.zeros((4, angles + 4, cells + 4, cells + 4))
    inner = q_grid.inside(fields)
    rng = np.random.default_rng(0)
    inner[0] = 1.0 + rng.random(inner[0].shape)
    inner[1:] = 0.3 * rng.standard_normal(inner[1:].shape) * inner[0]
    return fields


def sweep_rate(flux: Flux, cells: int, angles: int, repeats: int) -> float:
    """10^6 cell updates a second, the mean of the three directions, as the scheme `paper` takes them."""
    fields = smooth_fields(cells, angles)
    extents = q_grid.occupied_extents(fields)
    table = ghost_table(everywhere(Remove()), (cells, cells), GHOSTS)

    def sweeps() -> None:
        transport_in_plane(flux, fields, Move(True, 1e-3, 0.0), extents, table)
        transport(flux, fields, -3, 1e-3, extents, table, 0.0)

    return 3e-6 * cells * cells * angles / seconds(sweeps, repeats)


def _sweep_rows(sizes: Sizes) -> Iterator[Row]:
    size = sizes.q_cells, sizes.angles, sizes.repeats
    one, two = (with_threads(n, lambda: sweep_rate(Force(0.0), *size)) for n in (1, 2))
    second = sweep_rate(Ballistic((0.05, *(0.1,) * 3)), *size)
    # Four fields of 8 bytes are read and written.
    memory = limits(sizes)["two threads"] * 1e3 / 64.0
    work = f"FORCE sweep, 4 fields, {size[0]}x{size[0]}x{size[1]}"
    yield Row(
        work,
        "35 M cell updates/s on two threads, 60 % of the triad",
        f"{two:.0f} M/s (one thread {one:.0f})",
        f"the triad's bytes would give {memory:.0f}: {100 * two / memory:.0f} %",
        {"rate": 1e6 * two, "one_thread": 1e6 * one, "part_of_triad": two / memory},
    )
    yield Row(
        "second-order (ballistic) sweep",
        "at most 3x the cost of FORCE",
        f"{two / second:.1f}x",
        f"{second:.0f} M cell updates/s",
        {"ratio": two / second, "rate": 1e6 * second},
    )


@parallel_kernel
def tabulate(h: float, widths: Floats, angles: int, shape: tuple[float, ...], out: Floats) -> None:
    """grad_r U and dU/dtheta of every offset and pair of angles: out (2R+1, 2R+1, 3, n, n)."""
    reach = out.shape[0] // 2
    for task in numba.prange(out.shape[0]):
        constants = PotentialShape(shape[0], shape[1], shape[2], shape[3])
        j = task - reach
        width = int(widths[abs(j)])
        for i in range(-width, width + 1):
            for a in range(angles):
                for b in range(angles):
                    s, t = 2.0 * np.pi * a / angles, 2.0 * np.pi * b / angles
                    cs, ss, ct, st = np.cos(s), np.sin(s), np.cos(t), np.sin(t)
                    values = pair_potential(i * h, j * h, cs, ss, ct, st, constants)
                    for c in range(3):
                        out[task, i + reach, c, a, b] = values[c + 1]


@parallel_kernel
def direct_sum(density: Floats, table: Floats, widths: Floats, out: Floats) -> None:
    """The rival: every cell adds its neighbours' angles, from a table, along contiguous x."""
    reach = table.shape[0] // 2
    n, rows, columns = density.shape
    for task in numba.prange(n * rows):
        a, j = task // rows, task % rows
        for dj in range(max(-reach, -j), min(reach, rows - 1 - j) + 1):
            width = int(widths[abs(dj)])
            for di in range(-width, width + 1):
                first, end = max(0, -di), min(columns, columns - di)
                for b in range(n):
                    fx = table[dj + reach, di + reach, 0, a, b]
                    fy = table[dj + reach, di + reach, 1, a, b]
                    turn = table[dj + reach, di + reach, 2, a, b]
                    row = density[b, j + dj]
                    for i in range(first, end):
                        out[0, a, j, i] -= fx * row[i + di]
                        out[1, a, j, i] -= fy * row[i + di]
                        out[2, a, j, i] -= turn * row[i + di]


def _integral_row(sizes: Sizes) -> Row:
    grid = sizes.angles, sizes.q_cells, sizes.q_cells
    density = np.random.default_rng(1).random(grid)
    n = sizes.angles // 2
    widths = half_widths(SHAPE, SPACING).astype(np.float64)
    table = np.zeros((2 * widths.size - 1, 2 * widths.size - 1, 3, n, n))
    tabulate(SPACING, widths, n, tuple(SHAPE), table)
    folded, out = density[:n] + density[n:], np.zeros((3, n, *grid[1:]))
    direct_sum(folded[:, :1], table, widths, np.zeros((3, n, 1, grid[2])))

    def direct() -> None:
        out[:] = 0.0
        direct_sum(folded, table, widths, out)

    slow = seconds(direct, 1)
    exact = out * SPACING**2 * 2.0 * np.pi / sizes.angles
    times, errors = [], []
    for tolerance in (0.0, 2e-2):
        kernel = AngleGridInteraction(grid, SPACING, SHAPE, 1.0, tolerance=tolerance)
        found = np.array([part for part in kernel.forces(density) if part is not None])
        errors.append(
            max(np.abs(f - e).max() / np.abs(e).max() for f, e in zip(found, exact, strict=True))
        )
        times.append(seconds(partial(kernel.forces, density), sizes.repeats))
    return Row(
        f"q integral {grid[1]}x{grid[2]}x{grid[0]}, three components",
        "15x the direct sum at 1e-12, 35x at 1e-6",
        f"{slow / times[0]:.0f}x at {errors[0]:.0e}, {slow / times[1]:.0f}x at {errors[1]:.0e}",
        f"{times[0]:.3f} and {times[1]:.3f} s; direct, from a table: {slow:.2f} s",
        {"ratio_double": slow / times[0], "ratio_single": slow / times[1], "seconds": times[0]},
    )


def _rho_integral_row(sizes: Sizes) -> Row:
    grid = sizes.rho_cells, sizes.rho_cells
    rng = np.random.default_rng(2)
    density, angle = rng.random(grid), 6.0 * rng.random(grid)
    h, shape = 1.0 / sizes.rho_cells, potential_shape(0.05, 0.025)
    direct = choose_interaction(grid, h, shape, 1.0, 1.0, "direct")
    slow, exact = seconds(lambda: direct(density, angle), 1), direct(density, angle).x
    times, errors = [], []
    for tolerance in TOLERANCES:
        fast = choose_interaction(grid, h, shape, 1.0, tolerance)
        errors.append(float(np.abs(fast(density, angle).x - exact).max() / np.abs(exact).max()))
        times.append(seconds(partial(fast, density, angle), sizes.repeats))
    texts = ", ".join(f"{slow / t:.1f}x at {e:.1e}" for t, e in zip(times, errors, strict=True))
    wanted = ", ".join(f"{tolerance:g}" for tolerance in TOLERANCES)
    return Row(
        f"rho integral {grid[0]}x{grid[1]}",
        "12x the direct sum at 5e-3, faster at 1e-4",
        texts,
        f"{', '.join(f'{1e3 * t:.1f}' for t in times)} ms; direct {1e3 * slow:.0f} ms; "
        f"tolerances {wanted}",
        {f"ratio_{k}": slow / t for k, t in enumerate(times)},
    )


def _everywhere(fields: Floats, within: Floats | None = None) -> Floats:
    """Extents as if all cells held mass, in place of `occupied_extents`."""
    del within
    shape = q_grid.inside(fields[0]).shape
    return np.broadcast_to(np.array([0, shape[2]]), (*shape[:2], 2)).copy()


def _box_share(density: Floats) -> float:
    """Of the plane, the rectangle that holds all mass of (angles, ny, nx)."""
    rows, columns = np.nonzero(density.sum(axis=0))
    return float((np.ptp(rows) + 1) * (np.ptp(columns) + 1) / density[0].size)


def _empty_row(sizes: Sizes) -> Row:
    # Transforms in double precision: those of another rectangle round otherwise.
    exact = {"numerics.cell": sizes.scene_cell, "numerics.interaction": "direct"}

    def run(until: float) -> tuple[float, Floats]:
        result = simulate(load_scene("rotation", exact | {"times": [until]}), "q_mono_kinetic")
        return float(result.attributes["wall_seconds"]), result.variables["density"][-1]

    run(0.01)
    times, shares, apart = [], [], 0.0
    for until in sizes.scene_times:
        found = []
        for _ in range(sizes.pairs):
            fast, one = run(until)
            with mock.patch.object(cell_fields, "occupied_extents", _everywhere):
                slow, other = run(until)
            found.append((fast, slow))
            apart = max(apart, float(np.abs(one - other).max() / one.max()))
        times.append([float(np.median(each)) for each in zip(*found, strict=True)])
        shares.append(_box_share(one))
    ratios = [slow / fast for fast, slow in times]
    fast_times, slow_times = (
        ", ".join(f"{t:.2f}" for t in each) for each in zip(*times, strict=True)
    )
    return Row(
        f"rotation, q, h = {sizes.scene_cell:g}, to t = {', '.join(f'{t:g}' for t in sizes.scene_times)}",
        "5x by leaving out what is empty, equal to 1e-12",
        f"{', '.join(f'{ratio:.1f}x' for ratio in ratios)}; apart by {apart:.0e}",
        f"{fast_times} s instead of {slow_times} s; the rectangle with mass is then "
        f"{', '.join(f'{100 * share:.0f}' for share in shares)} % of the plane",
        {f"ratio_{k}": ratio for k, ratio in enumerate(ratios)} | {"apart": apart},
    )


def _step_cost(name: str, cells: int, angles: int, repeats: int) -> float:
    """Seconds of a step without interaction where all cells hold mass, median of some calls."""
    box = {"start.x": [-1.5, 1.5], "start.y": [-1.5, 1.5], "interaction": None}
    settings = box | {"numerics.cell": 3.0 / cells, "numerics.angle_cells": angles}
    scene = load_scene("rotation", settings)
    model = build_model(name, Setup(scene, terms_of(scene), "accurate", scene_flow(scene), 0, 1))
    state = model.state()
    if angles > 1:
        state["fields"][:] = state["fields"].max(axis=1, keepdims=True)
    model.restore(state)
    return step_seconds(model, 10.0, repeats)


def _growth_row(sizes: Sizes) -> Row:
    """A step of the rho-equation and of a q-equation without interaction: ns a cell."""
    texts: list[str] = []
    numbers: dict[str, float] = {}
    starts = (
        ("rho_mono_kinetic", sizes.rho_cells, 1),
        ("q_mono_kinetic", sizes.q_cells // 2, sizes.angles // 2),
    )
    for model, cells, angles in starts:
        each = []
        for factor in (1, 2, 4, 8):
            n = cells * factor
            each.append(1e9 * _step_cost(model, n, angles, sizes.repeats) / (n * n * angles))
        spread = 100 * (max(each) / min(each) - 1)
        texts.append(f"{model} {' / '.join(f'{t:.1f}' for t in each)} (+{spread:.0f} %)")
        numbers |= {f"{model}_{k}": t for k, t in enumerate(each)}
    grids = " and ".join("x".join(map(str, [n, n, a] if a > 1 else [n, n])) for _, n, a in starts)
    return Row(
        "rho and q, 64-fold cells",
        "cost per cell flat within 25 %",
        f"{'; '.join(texts)} ns a cell and step",
        f"each four grids, from {grids} cells on, all of them with mass",
        numbers,
    )


def grid_rows(sizes: Sizes) -> Iterator[Row]:
    """All rows of grids."""
    yield from _sweep_rows(sizes)
    yield _integral_row(sizes)
    yield _rho_integral_row(sizes)
    yield _empty_row(sizes)
    yield _growth_row(sizes)

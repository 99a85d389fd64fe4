"""Loops that own whole vectors, and how work is cut into tasks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from ellipsoid_coupling.compiled.jit import KERNEL_OPTIONS, inline_kernel
from ellipsoid_coupling.compiled.rows import Rows, prefetch
from ellipsoid_coupling.compiled.simd_sums import DOUBLES
from ellipsoid_coupling.compiled.tuning import CACHE_LINES_AT_ONCE

_OPTIONS: Any = KERNEL_OPTIONS


@inline_kernel
def round_up_to_vectors(width: int) -> int:
    """The next number of cells, or whatever numbers, that is whole vectors."""
    return (width + DOUBLES - 1) // DOUBLES * DOUBLES


def over_row(width: int, formula: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """Run ``formula(i, *arguments)`` for the cells i = 0 .. width - 1 of a row.

    In kernels the loop goes on to the end of a vector and leaves out with an `if` what lies beyond
    `width`: the rest of a loop would go one cell at a time, which takes as long as three vectors.

    formula : an inline kernel, by its name in the module; it loads and stores its cell itself.
    """
    for i in range(width):
        formula(i, *arguments)


@overload(over_row, inline="always", strict=False, jit_options=_OPTIONS)
def _choose_over_row(width: Any, formula: Any, arguments: Any) -> Any:
    del width, formula, arguments

    def loop(width: int, formula: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        for i in range(round_up_to_vectors(width)):
            if i < width:
                formula(i, *arguments)

    return loop


@inline_kernel
def chunk(task: int, tasks: int, count: int) -> tuple[int, int]:
    """First and end of the part of `count` things that task number `task` of `tasks` has."""
    return task * count // tasks, (task + 1) * count // tasks


@inline_kernel
def block_size(rows: int) -> int:
    """So many cells of each of these rows may be asked for at once.

    A loop over long rows goes block by block, and asks for the same block of the next rows before it
    works on one: hardware prefetch is too short here, and too many software prefetches stall.
    """
    return max(1, CACHE_LINES_AT_ONCE // rows) * DOUBLES


@inline_kernel
def prefetch_block(rows: Rows, width: int) -> None:
    """Ask for so many cells of each row."""
    for i in range(0, width, DOUBLES):
        prefetch(rows, i)

"""Loops that own whole vectors, and how work is cut into tasks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.kernel_forms import in_kernels
from ellipsoid_coupling.compiled.rows import Rows, prefetch
from ellipsoid_coupling.compiled.simd_vectors import DOUBLES
from ellipsoid_coupling.compiled.tuning import CACHE_LINES_AT_ONCE


@inline_kernel
def round_up_to_vectors(width: int) -> int:
    """The least number of whole vectors, in numbers, that holds `width` of them."""
    return (width + DOUBLES - 1) // DOUBLES * DOUBLES


def over_row(width: int, formula: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """Run ``formula(i, *arguments)`` for the cells i = 0 .. width - 1 of a row.

    In kernels the loop runs over whole vectors, and an `if` masks the cells beyond `width`: a remainder
    loop would go one cell at a time, which takes as long as three vectors.

    formula : an inline kernel, by its name in the module; it loads and stores its cell itself.
    """
    for i in range(width):
        formula(i, *arguments)


@in_kernels(over_row)
def _choose_over_row(width: Any, formula: Any, arguments: Any) -> Any:
    del width, formula, arguments

    def loop(width: int, formula: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        for i in range(round_up_to_vectors(width)):
            if i < width:
                formula(i, *arguments)

    return loop


@inline_kernel
def chunk(task: int, tasks: int, count: int) -> tuple[int, int]:
    """First and end of the indices 0 .. count - 1 that task number `task` of `tasks` has."""
    return task * count // tasks, (task + 1) * count // tasks


@inline_kernel
def block_size(rows: int) -> int:
    """How many cells of each of so many rows to prefetch at once.

    A loop over long rows goes block by block, and prefetches the same block of the next rows before it
    works on one: hardware prefetch is too short here, and too many software prefetches in flight stall.
    """
    return max(1, CACHE_LINES_AT_ONCE // rows) * DOUBLES


@inline_kernel
def prefetch_block(rows: Rows, width: int) -> None:
    """Prefetch `width` cells of each row."""
    for i in range(0, width, DOUBLES):
        prefetch(rows, i)

"""What is done to each row of a plane just before or after its transport, while it is in cache.

A work is a NamedTuple (what it needs) and a formula, registered for that type: numba compiles the sweep
of `fused_xy_sweep.py` with it. `sources.py` has some.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.extending import overload

from ellipsoid_coupling.compiled.jit import KERNEL_OPTIONS
from ellipsoid_coupling.compiled.rows import Rows

_OPTIONS: Any = KERNEL_OPTIONS


def work_on_row(work: Any, cells: Rows, j: int, width: int, strip: int) -> None:
    """What is done to row j of a plane, besides transport; nothing for None.

    Work before transport is done to copies of some rows as well: it is not to count anything.

    Parameters
    ----------
    work : NamedTuple or None
        Chooses what is done and holds what that needs.
    cells : Rows
        Its interior, all components, density first.
    j, width : int
        The row among those of the interior, and its cells.
    strip : int
        The number of the strip, each of which is worked on by one thread at a time.
    """
    del cells, j, width, strip
    if work is not None:
        raise TypeError(f"{type(work).__name__} is no registered work")


def register_row_work(kind: type[Any], formula: Callable[..., None]) -> None:
    """Make `formula`, an inline kernel, what is done to rows for a `work` of this type."""

    def run(work: Any, cells: Any, j: Any, width: Any, strip: Any) -> None:
        formula(work, cells, j, width, strip)

    def choose(work: Any, cells: Any, j: Any, width: Any, strip: Any) -> Any:
        del cells, j, width, strip
        return run if getattr(work, "instance_class", None) is kind else None

    overload(work_on_row, inline="always", strict=False, jit_options=_OPTIONS)(choose)


@overload(work_on_row, inline="always", strict=False, jit_options=_OPTIONS)
def _choose_no_work(work: Any, cells: Any, j: Any, width: Any, strip: Any) -> Any:
    del cells, j, width, strip
    return (lambda work, cells, j, width, strip: None) if work == types.none else None  # noqa: ARG005

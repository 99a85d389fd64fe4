"""One text for Python and for kernels, whose parts are chosen by type."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.jitable import jitable


class Halves(NamedTuple):
    first: float


class Listed(NamedTuple):
    """Holds what no kernel can take."""

    terms: dict[int, float]


@chosen_by_type
def term(series: Halves | Listed, k: int) -> float:
    """Term number k."""
    raise NotImplementedError


def _halves(series: Halves, k: int) -> float:
    return series.first * 0.5**k


def _listed(series: Listed, k: int) -> float:
    return series.terms[k]


register_formula(term, Halves, _halves)
register_formula(term, Listed, _listed)


@jitable
def summed(series: Halves | Listed, count: int) -> float:
    total = 0.0
    for k in range(count):
        total += term(series, k)
    return total


@kernel
def _summed_in_a_kernel(series: Halves, count: int) -> float:
    return summed(series, count)


def test_python_and_kernels_run_the_same_text() -> None:
    """Powers of two: exact. The dictionary is only for Python."""
    assert _summed_in_a_kernel(Halves(1.0), 5) == summed(Halves(1.0), 5) == 1.9375
    assert summed(Listed({0: 1.0, 1: 3.0}), 2) == 4.0

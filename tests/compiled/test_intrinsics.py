"""Instructions that Python has no words for, against their plain twins."""

from __future__ import annotations

from ellipsoid_coupling.compiled.intrinsics import fma
from ellipsoid_coupling.compiled.jit import kernel


@kernel
def compiled_fused(a: float, b: float, c: float) -> float:
    return fma(a, b, c)


def test_fused_rounds_once() -> None:
    """(1 + e)(1 - e) - 1 = -e^2, which two roundings lose."""
    e = 2.0**-30
    assert compiled_fused(1.0 + e, 1.0 - e, -1.0) == -(e**2)
    assert fma(2.0, 3.0, 4.0) == 10.0

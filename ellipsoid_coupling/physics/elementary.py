"""Exponential, cosine and sine as polynomials: a library call would stop a loop from vectorising."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.compiled.intrinsics import fma
from ellipsoid_coupling.compiled.jit import inline_kernel

LOG2_E = 1.4426950408889634
LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
# Added to a whole number below 2^51, it leaves that number in the low bits: AVX2 has no other way
# from float64 to int64 that vectorises.
TO_LOW_BITS = 6755399441055744.0
# pi/2 to twice the digits that a float64 has.
HALF_PI_HIGH = 1.5707963267948966
HALF_PI_LOW = 6.123233995736766e-17
INVERSE_HALF_PI = 0.6366197723675814


@inline_kernel
def exp_of_negative(x: float) -> float:
    """exp(x) for -700 < x <= 0, to 3e-14.

    exp(x) = 2^n exp(r) with n = round(x / ln 2) and |r| <= ln(2)/2, the Taylor series up to r^12
    (remainder 2e-16) in parts that the processor adds up side by side, and 2^n written into the
    exponent bits.
    """
    n: float = np.floor(fma(x, LOG2_E, 0.5))
    r = fma(n, -LN2_LOW, fma(n, -LN2_HIGH, x))
    r2 = r * r
    low = fma(r2, fma(r, 1.0 / 6.0, 0.5), 1.0 + r)
    middle = fma(r2, fma(r, 1.0 / 5040.0, 1.0 / 720.0), fma(r, 1.0 / 120.0, 1.0 / 24.0))
    high = fma(r2, fma(r, 1.0 / 39916800.0, 1.0 / 3628800.0), fma(r, 1.0 / 362880.0, 1.0 / 40320.0))
    r4 = r2 * r2
    high = fma(r4, 1.0 / 479001600.0, high)
    bits = np.float64(n + TO_LOW_BITS).view(np.int64)
    power: float = np.int64((bits + 1023) << 52).view(np.float64)
    return power * fma(r4, fma(r4, high, middle), low)


@inline_kernel
def cos_sin(x: float) -> tuple[float, float]:
    """cos(x) and sin(x) to 2e-16 for |x| < 1e15; not a number where x is not finite.

    x = n pi/2 + r with |r| <= pi/4; the Taylor series up to r^16 and r^17 (remainder 2e-18), and
    n modulo 4 tells which is which, and the signs.
    """
    n: float = np.floor(fma(x, INVERSE_HALF_PI, 0.5))
    r = fma(n, -HALF_PI_LOW, fma(n, -HALF_PI_HIGH, x))
    z = r * r
    even = fma(z, 1.0 / 20922789888000.0, -1.0 / 87178291200.0)
    even = fma(z, fma(z, even, 1.0 / 479001600.0), -1.0 / 3628800.0)
    even = fma(z, fma(z, even, 1.0 / 40320.0), -1.0 / 720.0)
    even = fma(z, fma(z, fma(z, even, 1.0 / 24.0), -0.5), 1.0)
    uneven = fma(z, 1.0 / 355687428096000.0, -1.0 / 1307674368000.0)
    uneven = fma(z, fma(z, uneven, 1.0 / 6227020800.0), -1.0 / 39916800.0)
    uneven = fma(z, fma(z, uneven, 1.0 / 362880.0), -1.0 / 5040.0)
    uneven = fma(z, fma(z, uneven, 1.0 / 120.0), -1.0 / 6.0)
    uneven = fma(z * r, uneven, r)
    quarter = 0.25 * n - np.floor(0.25 * n)
    crossed = quarter == 0.25 or quarter == 0.75
    cosine = uneven if crossed else even
    sine = even if crossed else uneven
    return (
        -cosine if quarter == 0.25 or quarter == 0.5 else cosine,
        -sine if quarter >= 0.5 else sine,
    )

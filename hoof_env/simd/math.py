"""Powers, exponential, cosine and sine that round the same in one lane and in many.

Only + - * /, fused operations and sqrt, which IEEE 754 rounds correctly in scalar and in vector code, and
selections; no library function, no table, no branch that depends on the data. So a lane has the bits that it
would have alone. Ordinary floats are accepted, too, but their products are rounded before they enter a sum.
NaN stays NaN.

Sources: Cody & Waite 1980 (Software Manual for the Elementary Functions) for the reduction in two parts;
the coefficients of sine and cosine are fdlibm's (Sun Microsystems, k_sin.c and k_cos.c, minimax on
[-pi/4, pi/4]); Estrin's scheme, which makes short chains of operations.
"""

from __future__ import annotations

import math
from typing import TypeVar

from hoof_env.simd.machines import CURRENT
from hoof_env.simd.values import (
    Lanes,
    Number,
    absolute,
    maximum,
    quarter_turns,
    rounded,
    sqrt,
    steady,
    where,
)

Real = TypeVar("Real", float, Lanes)

EXPONENT_UNIT = 8
"""Denominator of the exponents that `root_power` takes: whole multiples of 1 / EXPONENT_UNIT."""

MIN_EXPONENT = -40.0
"""Lowest exponent of `exp_of_negative`: below it the result stays at exp(-40) = 4e-18."""

TWO_OVER_PI = 2 / math.pi
HALF_PI_HIGH = float.fromhex("0x1.921fb54400000p+0")  # 33 bits of pi / 2: exact times whole numbers < 2^20
HALF_PI_LOW = float.fromhex("0x1.0b4611a626331p-34")  # the rest
ROUNDER = 1.5 * 2.0**52  # adding and subtracting it rounds to the nearest whole number


def root_power(d: Real, eighths: int) -> Real:
    """Return d^(eighths / 8) by square roots; 0 for negative d, relative error below 1e-15. `eighths` is a
    whole number from 8 to 24, the same in all lanes."""
    base = maximum(d, 0.0)
    power = base
    if eighths >= 16:
        power = power * base
    if eighths == 24:
        power = power * base
    # the bits of the rest: 1/2, 1/4 and 1/8
    rest = eighths & 7
    if rest != 0:
        half = sqrt(base)
        if rest & 4:
            power = power * half
        if rest & 3:
            quarter = sqrt(half)
            if rest & 2:
                power = power * quarter
            if rest & 1:
                power = power * sqrt(quarter)
    return rounded(power)


def exp_of_negative(x: Real) -> Real:
    """Return exp(x) for x <= 0, relative error below 1e-13; exp(-40) below -40. The series of exp(x / 256),
    squared eight times."""
    # Taylor's series to the tenth power, by Horner's rule
    y = maximum(x, MIN_EXPONENT) * (1 / 256)
    e = 1 / 3628800 * y + 1 / 362880
    e = e * y + 1 / 40320
    e = e * y + 1 / 5040
    e = e * y + 1 / 720
    e = e * y + 1 / 120
    e = e * y + 1 / 24
    e = e * y + 1 / 6
    e = e * y + 1 / 2
    e = e * y + 1.0
    e = e * y + 1.0
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return rounded(e * e)


def tanh(x: Lanes) -> Lanes:
    """Return the hyperbolic tangent, error below 1e-13."""
    e = exp_of_negative(-2.0 * absolute(x))
    part = (1.0 - e) / (1.0 + e)
    return where(x < 0.0, -part, part)


def cos_sin(angle: Lanes) -> tuple[Lanes, Lanes]:
    """Return the cosine and sine of `angle` [rad], error below 2e-16 for |angle| < 1e4."""
    machine, n = CURRENT.machine, angle.n
    if machine.has_angles:
        cosine_x, sine_x = machine.cos_sin(angle.x)
        return Lanes(cosine_x, n), Lanes(sine_x, n)
    shifted = steady(angle * TWO_OVER_PI + ROUNDER)
    turns = shifted - ROUNDER  # quarter turns to the nearest multiple of pi / 2
    # the first product is exact for up to 2^20 quarter turns, so no digits are lost in the difference
    r = (angle - turns * HALF_PI_HIGH) - turns * HALF_PI_LOW
    z = r * r
    z2 = z * z
    s = -1.66666666666666324348e-01 + 8.33333333332248946124e-03 * z
    s = s + z2 * (-1.98412698298579493134e-04 + 2.75573137070700676789e-06 * z)
    s = s + z2 * z2 * (-2.50507602534068634195e-08 + 1.58969099521155010221e-10 * z)
    sine = r + r * (z * s)
    c = 4.16666666666666019037e-02 + -1.38888888888741095749e-03 * z
    c = c + z2 * (2.48015872894767294178e-05 + -2.75573143513906633035e-07 * z)
    c = c + z2 * z2 * (2.08757232129817482790e-09 + -1.13596475577881948265e-11 * z)
    half = 0.5 * z
    main = 1.0 - half
    # (1 - main) - half is the rounding error of `main`
    cosine = main + (((1.0 - main) - half) + z * (z * c))
    return quarter_turns(cosine, sine, shifted)


def clip(x: Lanes, bound: Number) -> Lanes:
    """Return `x` limited to [-bound, bound], where `bound` is a number; NaN stays NaN."""
    # one comparison each: `minimum` and `maximum` would look whether the bound is NaN, too
    above = where(x < -bound, -bound, x)
    return where(above > bound, bound, above)

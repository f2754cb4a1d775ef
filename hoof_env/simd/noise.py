"""Random numbers inside kernels, without a state: each is a function of a key, a count and a number, so that
it has the same bits in one lane and in many, on any number of threads, and when it is computed again.

The bits are those of splitmix64 (Steele, Lea & Flood 2014, Fast Splittable Pseudorandom Number Generators),
with a seed that is mixed from key and count.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types

from hoof_env.simd.types import INDEX, Code, instruction, spread, wide

GOLDEN = 0x9E3779B97F4A7C15
"""Increment of splitmix64's state."""

_MIXING = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB), (31, 1))
"""Shifts and factors of its output function."""

_ONE = 0x3FF0000000000000  # bits of the double 1


@instruction(lambda key, count, number: key(key, count, types.intp))
def uniform(code: Code, key: Any, count: Any, number: Any) -> Any:
    """Return random numbers in [-1, 1), one for each lane.

    Args:
        key: any double, of which all bits count.
        count: double that tells times apart, such as the number of steps.
        number: whole number that tells numbers of one time apart, the same in all lanes.
    """
    builder = code.builder
    lanes = getattr(code.args[0], "count", 1)
    kind = wide(INDEX, lanes)

    def constant(bits: int) -> Any:
        return spread(builder, ir.Constant(INDEX, bits), lanes)

    def mixed(z: Any) -> Any:
        for shift, factor in _MIXING:
            z = builder.xor(z, builder.lshr(z, constant(shift)))
            z = builder.mul(z, constant(factor))
        return z

    # Neither depends on the number: the compiler computes both before a loop over numbers.
    of_count = mixed(builder.bitcast(code.number(code.args[1], count, lanes), kind))
    seed = mixed(builder.add(builder.bitcast(key, kind), of_count))
    step = builder.mul(builder.add(number, INDEX(1)), ir.Constant(INDEX, GOLDEN))
    bits = mixed(builder.add(seed, spread(builder, step, lanes)))
    # The upper 52 bits, as the fraction of a double in [1, 2).
    fraction = builder.or_(builder.lshr(bits, constant(12)), constant(_ONE))
    between = builder.bitcast(fraction, key.type)
    double = [code.number(types.float64, ir.Constant(ir.DoubleType(), value), lanes) for value in (2.0, 3.0)]
    # Twice a number in [1, 2) less 3 is exact.
    return builder.fsub(builder.fmul(between, double[0]), double[1])

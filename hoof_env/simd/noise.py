"""Random numbers inside kernels, without a state: each is a function of a key, a count and a number. The bits
are made by splitmix64 (Steele, Lea & Flood 2014), with a seed mixed from key and count."""

from __future__ import annotations

from typing import Any

from hoof_env.simd.machines import CURRENT
from hoof_env.simd.values import Lanes, Number, Whole, full, rounded, word

GOLDEN = 0x9E3779B97F4A7C15
_MIXING = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB), (31, 1))
_ONE = 0x3FF0000000000000  # bits of the double 1


def uniform(key: Lanes, count: Number, number: Whole) -> Lanes:
    """Return random numbers in [-1, 1), one for each lane, see the package."""
    machine, n = CURRENT.machine, key.n

    def mixed(z: Any) -> Any:
        for shift, factor in _MIXING:
            z = machine.whole("xor", z, machine.whole("lshr", z, shift, n), n)
            z = machine.whole("mul", z, factor, n)
        return z

    of_count = mixed(machine.bits(full(count, n).x, n))
    seed = mixed(machine.whole("add", machine.bits(key.x, n), of_count, n))
    step = machine.index_bits(word((number + 1) * GOLDEN), n)
    bits = mixed(machine.whole("add", seed, step, n))
    fraction = machine.whole("or", machine.whole("lshr", bits, 12, n), _ONE, n)
    between = Lanes(machine.of_bits(fraction, n), n)
    return rounded(2.0 * between) - 3.0

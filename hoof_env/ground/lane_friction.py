"""The laws of `friction` for lanes: without library functions or branches on the data (see `simd.math`)."""

from __future__ import annotations

from hoof_env.simd import larger, smaller
from hoof_env.simd.compile import inlined
from hoof_env.simd.math import exp_of_negative

AMBROSIO, THRELFALL, TANH = range(3)  # positions in friction.FRICTION_LAWS


@inlined
def friction_part(speed, law, slow, fast):  # type: ignore[no-untyped-def]
    """Friction coefficient over its kinetic value [-], 0 to 1; 0 at rest.

    Args:
        speed: sliding speed |v| [m/s].
        law: index into `friction.FRICTION_LAWS`, the same in all lanes.
        slow, fast: threshold speeds [m/s].
    """
    if law == AMBROSIO:
        part = (speed - slow) / (fast - slow)
    elif law == THRELFALL:
        part = 1.0 - exp_of_negative(-3.0 * smaller(speed / fast, 1.0))
    else:
        e = exp_of_negative(-2.0 * (speed / fast))
        part = (1.0 - e) / (1.0 + e)
    return smaller(larger(part, 0.0), 1.0)

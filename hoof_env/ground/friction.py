"""Friction laws: F_t = -mu(v) F_n v / |v| with a coefficient that depends on the sliding speed.

Eq. 15 of the paper is Coulomb friction with Ambrosio's dynamic correction c_d; its c_f is read as the
direction v / |v|, for friction opposes sliding. All laws here are functions of the sliding speed alone: they
cannot hold a hoof at rest, it creeps. Sources: Ambrosio 2003 (in Virtual Nonlinear Multibody Systems, 57-81);
Threlfall 1978 (Mech Mach Theory 13:475); hyperbolic tangent, common in robotics.
"""

from __future__ import annotations

import math

from hoof_env.simd.compile import kernel

FRICTION_LAWS = ("ambrosio", "threlfall", "tanh")
"""Names of the friction laws; the kernel takes the position in this tuple."""


@kernel
def friction_coefficient(speed, law, kinetic, slow, fast):  # type: ignore[no-untyped-def]
    """Friction coefficient mu(|v|) [-].

    Args:
        speed: sliding speed |v| [m/s].
        law: index into `FRICTION_LAWS`. 0, Ambrosio: mu_k c_d with c_d = 0 below `slow`, 1 above `fast`,
            linear between. 1, Threlfall: mu_k (1 - exp(-3 |v| / v0)) up to v0 = `fast`, constant above.
            2: mu_k tanh(|v| / `fast`).
        kinetic: mu_k [-].
        slow, fast: threshold speeds v0 and v1 [m/s]; the paper does not print them.
    """
    if law == 0:
        correction = (speed - slow) / (fast - slow)
    elif law == 1:
        correction = 1.0 - math.exp(-3.0 * min(speed / fast, 1.0))
    else:
        correction = math.tanh(speed / fast)
    return kinetic * min(max(correction, 0.0), 1.0)


@kernel
def friction_force(velocity, normal, law, kinetic, slow, fast):  # type: ignore[no-untyped-def]
    """Friction force along x [N] on a point that slides with `velocity` [m/s] under `normal` [N] (Eq. 15)."""
    if velocity == 0.0:
        return 0.0
    return -math.copysign(friction_coefficient(abs(velocity), law, kinetic, slow, fast) * normal, velocity)

"""The contact of one hoof point as plain functions of numbers, for loops over many legs.

The same laws as `contact`, `normal_force` and `friction`, without records, library functions or branches on
the data, so that a loop over lanes vectorises and rounds as one lane does (see `exact_math`). The power d^n
comes as an argument, from `root_power`. What is not a number stays so in the forces.

Symbols: d penetration [m], positive inside; rate [m/s], positive while going in; v0 approach speed [m/s].
"""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.ground.exact_math import exp_of_negative

AMBROSIO, THRELFALL, TANH = range(3)  # positions in friction.FRICTION_LAWS


@inlined
def approach_speed(inside, stored, d_before, rate_before, d, rate, floor, interpolated):  # type: ignore[no-untyped-def]
    """Approach speed v0 [m/s] of a point after a step, 0 outside; `contact.latch` without the record.

    Args:
        inside: whether the point was in the ground before the step, as a truth value or as 0.0 and 1.0; with
            `stored` from this function, `stored > 0.0` says the same.
        stored: v0 before the step [m/s], kept while the point stays inside.
        d_before, rate_before: before the step [m, m/s].
        d, rate: now [m, m/s].
        floor: smallest v0 of a touch-down [m/s].
        interpolated: v0 at the interpolated crossing, or else that of the first sample inside; the same for
            all lanes.
    """
    span = d_before - d
    part = d_before / span  # of the step, to the crossing
    crossing = rate_before + part * (rate - rate_before)
    use_crossing = (d_before < 0.0) & (interpolated > 0.5)
    speed = crossing if use_crossing else rate
    entering = (d > 0.0) & (inside < 0.5)
    kept = max(speed, floor) if entering else stored
    return kept if d > 0.0 else 0.0


@inlined
def normal_force(d, rate, approach, power, stiffness, chi, dashpot):  # type: ignore[no-untyped-def]
    """Normal force [N] on a point: max(0, K d^n (1 + chi rate / v0) + c rate) inside, 0 outside (Eq. 14).

    Args:
        d, rate: penetration [m] and its rate [m/s].
        approach: v0 [m/s], any number outside.
        power: d^n [m^n], any number outside.
        stiffness: K [N/m^n].
        chi, dashpot: damping factor [-] and c [N s/m], see `normal_force.damping`.
    """
    force = stiffness * power * (1.0 + chi * rate / approach) + dashpot * rate
    force = max(force, 0.0)
    return 0.0 if d <= 0.0 else force


@inlined
def friction_part(speed, law, slow, fast):  # type: ignore[no-untyped-def]
    """Friction coefficient over its kinetic value [-], 0 to 1; 0 at rest.

    Args:
        speed: sliding speed |v| [m/s].
        law: index into `friction.FRICTION_LAWS`, the same for all lanes.
        slow, fast: threshold speeds [m/s].
    """
    if law == AMBROSIO:
        part = (speed - slow) / (fast - slow)
    elif law == THRELFALL:
        part = 1.0 - exp_of_negative(-3.0 * min(speed / fast, 1.0))
    else:
        e = exp_of_negative(-2.0 * (speed / fast))
        part = (1.0 - e) / (1.0 + e)
    return min(max(part, 0.0), 1.0)


@inlined
def friction_part_lanes(speed, law, slow, fast, out):  # type: ignore[no-untyped-def]
    """`friction_part` of each lane: `speed` and `out` are rows of one length that do not overlap (slow).

    One loop for each law: the exponential is not computed where the law has none.
    """
    if law == AMBROSIO:
        for lane in range(out.size):
            out[lane] = friction_part(speed[lane], AMBROSIO, slow, fast)
    elif law == THRELFALL:
        for lane in range(out.size):
            out[lane] = friction_part(speed[lane], THRELFALL, slow, fast)
    else:
        for lane in range(out.size):
            out[lane] = friction_part(speed[lane], TANH, slow, fast)


@inlined
def friction_coefficient(speed, law, kinetic, slow, fast):  # type: ignore[no-untyped-def]
    """Friction coefficient mu(|v|) [-], as `friction.friction_coefficient` to rounding of its exponential."""
    return kinetic * friction_part(speed, law, slow, fast)


@inlined
def friction_force(velocity, normal, coefficient):  # type: ignore[no-untyped-def]
    """Friction force [N] along the ground on a point that slides with `velocity` [m/s] (Eq. 15).

    Args:
        velocity: along the ground [m/s].
        normal: normal force [N].
        coefficient: mu(|velocity|) [-], 0 at rest.
    """
    size = coefficient * normal
    return -size if velocity > 0.0 else size


@inlined
def contact_power(d, rate, power, normal, stiffness, velocity, friction):  # type: ignore[no-untyped-def]
    """What a contact stores and loses: elastic, damping and friction power [W].

    The first, K d^n rate, goes into the ground's spring and comes back; its integral is `elastic_energy`. The
    others are lost, never negative. Their sum is the power that the leg gives to the ground.

    Args:
        d, rate, power, stiffness: as for `normal_force`.
        normal: the normal force [N].
        velocity, friction: sliding velocity [m/s] and the friction force on the point [N].
    """
    elastic = stiffness * power
    elastic = 0.0 if d <= 0.0 else elastic
    return elastic * rate, (normal - elastic) * rate, -friction * velocity


@inlined
def elastic_energy(d, power, stiffness, exponent):  # type: ignore[no-untyped-def]
    """Energy [J] in the ground's spring, K d^(n + 1) / (n + 1), 0 outside."""
    energy = stiffness * power * d / (exponent + 1.0)
    return 0.0 if d <= 0.0 else energy

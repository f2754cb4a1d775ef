"""One step in time: the stages of an explicit scheme (`schemes`); see `lanes`."""

from __future__ import annotations

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.trunk import FIXED, FREE
from hoof_env.gait.motion_law import INNER, SPEED
from hoof_env.simd import below, choose
from hoof_env.simd.compile import inlined
from hoof_env.simd.math import clip


@inlined
def bend_filters(limb, settings):  # type: ignore[no-untyped-def]
    """Accelerations of the command filters: bounded, towards a bounded rate, towards the command.

    `settings` points to gain, bound of the rate and bound of the acceleration of each filter.
    """
    for k in range(4):
        gain, rate_bound, acc_bound = settings[3 * k], settings[3 * k + 1], settings[3 * k + 2]
        wanted = clip(gain * (limb[b.COMMAND + k] - limb[b.VALUE + k]), rate_bound)
        limb[b.BEND + k] = clip(INNER * gain * (wanted - limb[b.RATE + k]), acc_bound)


@inlined
def go_on(trunk, kind, to, start, factor, slope):  # type: ignore[no-untyped-def]
    """trunk[to] = trunk[start] + factor trunk[slope] for all rows that move; two are of the pitch."""
    for k in range(t.MOVING - 2):
        trunk[to + k] = trunk[start + k] + factor * trunk[slope + k]
    if kind == FREE:
        for k in range(t.MOVING - 2, t.MOVING):
            trunk[to + k] = trunk[start + k] + factor * trunk[slope + k]


@inlined
def begin_step(trunk, limbs, legs, model):  # type: ignore[no-untyped-def]
    """The first stage is at the state itself."""
    if model.kind != FIXED:
        for k in range(t.MOVING):
            trunk[t.NOW + k] = trunk[t.FIRST + k]
            trunk[t.MEAN + k] = 0.0
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        bend_filters(limb, model.settings)
        limb[b.ANGLE], limb[b.SPIN] = limb[b.THETA], limb[b.OMEGA]
        limb[b.SPIN_MEAN], limb[b.SPIN_RATE_MEAN] = 0.0, 0.0


@inlined
def weigh_stage(trunk, limbs, legs, model, weight):  # type: ignore[no-untyped-def]
    """Add the derivatives at the present stage to their means."""
    if weight == 0.0:
        return
    if model.kind != FIXED:
        go_on(trunk, model.kind, t.MEAN, t.MEAN, weight, t.FLOW)
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        limb[b.SPIN_MEAN] = limb[b.SPIN_MEAN] + weight * limb[b.SPIN]
        limb[b.SPIN_RATE_MEAN] = limb[b.SPIN_RATE_MEAN] + weight * limb[b.SPIN_RATE]


@inlined
def prescribed(limb, elapsed):  # type: ignore[no-untyped-def]
    """Angle and rate of a prescribed crank `elapsed` [s] into the step, exactly as the filter moves them."""
    value, rate, bend = limb[b.VALUE + SPEED], limb[b.RATE + SPEED], limb[b.BEND + SPEED]
    theta = limb[b.THETA] + elapsed * (value + elapsed * (0.5 * rate + elapsed * (1 / 6) * bend))
    return theta, value + elapsed * (rate + 0.5 * elapsed * bend)


@inlined
def next_stage(trunk, limbs, legs, model, elapsed):  # type: ignore[no-untyped-def]
    """Go `elapsed` [s] from the step's start with the derivatives of the present stage."""
    if model.kind != FIXED:
        go_on(trunk, model.kind, t.NOW, t.FIRST, elapsed, t.FLOW)
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        is_motor = limb[b.MOTOR] > 0.0
        angle, spin = prescribed(limb, elapsed)
        limb[b.ANGLE] = choose(is_motor, limb[b.THETA] + elapsed * limb[b.SPIN], angle)
        limb[b.SPIN] = choose(is_motor, limb[b.OMEGA] + elapsed * limb[b.SPIN_RATE], spin)


@inlined
def use_new_rates(trunk, h):  # type: ignore[no-untyped-def]
    """Semi-implicit Euler: centre and pitch go with the velocities that the step ends with."""
    for k in range(2):
        trunk[t.MEAN + k] = trunk[t.MEAN + k] + h * trunk[t.FORCE + k] * trunk[t.PER_MASS]
    pitch = t.MEAN + t.PITCH - t.FIRST
    trunk[pitch] = trunk[pitch] + h * trunk[t.PITCH_ACC]


@inlined
def end_step(trunk, limbs, legs, model, h):  # type: ignore[no-untyped-def]
    """The state a step later; the filters advance exactly."""
    if model.kind != FIXED:
        if model.new_rates:
            use_new_rates(trunk, h)
        go_on(trunk, model.kind, t.FIRST, t.FIRST, h, t.MEAN)
    trunk[t.TIME] = trunk[t.TIME] + h
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        is_motor = limb[b.MOTOR] > 0.0
        angle, spin = prescribed(limb, h)
        omega, mean = limb[b.OMEGA] + h * limb[b.SPIN_RATE_MEAN], limb[b.SPIN_MEAN]
        if model.new_rates:
            mean = omega
        limb[b.THETA] = choose(is_motor, limb[b.THETA] + h * mean, angle)
        limb[b.OMEGA] = choose(is_motor, omega, spin)
        for k in range(4):
            rate, bend = limb[b.RATE + k], limb[b.BEND + k]
            limb[b.VALUE + k] = limb[b.VALUE + k] + h * (rate + 0.5 * h * bend)
            limb[b.RATE + k] = rate + h * bend

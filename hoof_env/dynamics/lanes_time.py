"""One step in time for a tile of environments: the stages of an explicit scheme (`schemes`); see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.trunk import FIXED
from hoof_env.dynamics.vectors import set_six
from hoof_env.gait.motion_law import INNER, SPEED, clip


@inlined
def bend_filters(limbs, settings):  # type: ignore[no-untyped-def]
    """Accelerations of the command filters: bounded, towards a bounded rate, towards the command."""
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        for k in range(4):
            gain, rate_bound, acc_bound = settings[k, 0], settings[k, 1], settings[k, 2]
            for lane in range(limb.shape[1]):
                wanted = clip(gain * (limb[b.COMMAND + k, lane] - limb[b.VALUE + k, lane]), rate_bound)
                limb[b.BEND + k, lane] = clip(INNER * gain * (wanted - limb[b.RATE + k, lane]), acc_bound)


@inlined
def begin_step(trunk, limbs, model):  # type: ignore[no-untyped-def]
    """The first stage is at the state itself."""
    if model.kind != FIXED:
        for lane in range(trunk.shape[1]):
            set_six(trunk, t.NOW, t.FIRST, 0.0, t.FIRST, lane)
            set_six(trunk, t.MEAN, t.FIRST, -1.0, t.FIRST, lane)
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        for lane in range(limb.shape[1]):
            limb[b.ANGLE, lane] = limb[b.THETA, lane]
            limb[b.SPIN, lane] = limb[b.OMEGA, lane]
            limb[b.SPIN_MEAN, lane] = 0.0
            limb[b.SPIN_RATE_MEAN, lane] = 0.0


@inlined
def weigh_stage(trunk, limbs, model, weight):  # type: ignore[no-untyped-def]
    """Add the derivatives at the present stage to their means."""
    if weight == 0.0:
        return
    if model.kind != FIXED:
        for lane in range(trunk.shape[1]):
            set_six(trunk, t.MEAN, t.MEAN, weight, t.FLOW, lane)
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        for lane in range(limb.shape[1]):
            limb[b.SPIN_MEAN, lane] += weight * limb[b.SPIN, lane]
            limb[b.SPIN_RATE_MEAN, lane] += weight * limb[b.SPIN_RATE, lane]


@inlined
def prescribed(limb, lane, elapsed):  # type: ignore[no-untyped-def]
    """Angle and rate of a prescribed crank `elapsed` [s] into the step, exactly as the filter moves them."""
    value, rate = limb[b.VALUE + SPEED, lane], limb[b.RATE + SPEED, lane]
    bend = limb[b.BEND + SPEED, lane]
    theta = limb[b.THETA, lane] + elapsed * (value + elapsed * (rate / 2.0 + elapsed * bend / 6.0))
    return theta, value + elapsed * (rate + elapsed * bend / 2.0)


@inlined
def next_stage(trunk, limbs, model, elapsed):  # type: ignore[no-untyped-def]
    """Go `elapsed` [s] from the step's start with the derivatives of the present stage."""
    if model.kind != FIXED:
        for lane in range(trunk.shape[1]):
            set_six(trunk, t.NOW, t.FIRST, elapsed, t.FLOW, lane)
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        for lane in range(limb.shape[1]):
            is_motor = limb[b.MOTOR, lane] > 0.0
            angle, spin = prescribed(limb, lane, elapsed)
            theta = limb[b.THETA, lane] + elapsed * limb[b.SPIN, lane]
            omega = limb[b.OMEGA, lane] + elapsed * limb[b.SPIN_RATE, lane]
            limb[b.ANGLE, lane] = theta if is_motor else angle
            limb[b.SPIN, lane] = omega if is_motor else spin


@inlined
def use_new_rates(trunk, h):  # type: ignore[no-untyped-def]
    """Semi-implicit Euler: centre and pitch go with the velocities that the step ends with."""
    for lane in range(trunk.shape[1]):
        for k in range(2):
            trunk[t.MEAN + k, lane] += h * trunk[t.FORCE + k, lane] * trunk[t.PER_MASS, lane]
        trunk[t.MEAN + t.PITCH - t.FIRST, lane] += h * trunk[t.PITCH_ACC, lane]


@inlined
def end_step(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    """The state a step later; the filters advance exactly."""
    if model.kind != FIXED:
        if model.new_rates:
            use_new_rates(trunk, h)
        for lane in range(trunk.shape[1]):
            set_six(trunk, t.FIRST, t.FIRST, h, t.MEAN, lane)
    for lane in range(trunk.shape[1]):
        trunk[t.TIME, lane] += h
    new_rates = model.new_rates
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        for lane in range(limb.shape[1]):
            is_motor = limb[b.MOTOR, lane] > 0.0
            angle, spin = prescribed(limb, lane, h)
            omega = limb[b.OMEGA, lane] + h * limb[b.SPIN_RATE_MEAN, lane]
            mean = omega if new_rates else limb[b.SPIN_MEAN, lane]
            theta = limb[b.THETA, lane] + h * mean
            limb[b.THETA, lane] = theta if is_motor else angle
            limb[b.OMEGA, lane] = omega if is_motor else spin
        for k in range(4):
            for lane in range(limb.shape[1]):
                limb[b.VALUE + k, lane] += h * (limb[b.RATE + k, lane] + 0.5 * h * limb[b.BEND + k, lane])
            for lane in range(limb.shape[1]):
                limb[b.RATE + k, lane] += h * limb[b.BEND + k, lane]

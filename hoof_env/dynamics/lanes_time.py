"""One step in time for a tile of environments: the stages of an explicit scheme (`schemes`); see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.trunk import FIXED
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
        for k in range(t.MOVING):
            for lane in range(trunk.shape[1]):
                trunk[t.NOW + k, lane] = trunk[t.FIRST + k, lane]
                trunk[t.MEAN + k, lane] = 0.0
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
    if model.kind != FIXED:
        for k in range(t.MOVING):
            for lane in range(trunk.shape[1]):
                trunk[t.MEAN + k, lane] += weight * trunk[t.FLOW + k, lane]
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        for lane in range(limb.shape[1]):
            limb[b.SPIN_MEAN, lane] += weight * limb[b.SPIN, lane]
            limb[b.SPIN_RATE_MEAN, lane] += weight * limb[b.SPIN_RATE, lane]


@inlined
def next_stage(trunk, limbs, model, elapsed):  # type: ignore[no-untyped-def]
    """Go `elapsed` [s] from the step's start with the derivatives of the present stage."""
    if model.kind != FIXED:
        for k in range(t.MOVING):
            for lane in range(trunk.shape[1]):
                trunk[t.NOW + k, lane] = trunk[t.FIRST + k, lane] + elapsed * trunk[t.FLOW + k, lane]
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        if model.motors[i] != 0.0:
            for lane in range(limb.shape[1]):
                limb[b.ANGLE, lane] = limb[b.THETA, lane] + elapsed * limb[b.SPIN, lane]
                limb[b.SPIN, lane] = limb[b.OMEGA, lane] + elapsed * limb[b.SPIN_RATE, lane]
        else:
            prescribe(limb, b.ANGLE, b.SPIN, elapsed)


@inlined
def prescribe(limb, angle, spin, elapsed):  # type: ignore[no-untyped-def]
    """Crank angle and rate as the speed filter moves them, exactly."""
    for lane in range(limb.shape[1]):
        value, rate = limb[b.VALUE + SPEED, lane], limb[b.RATE + SPEED, lane]
        bend = limb[b.BEND + SPEED, lane]
        limb[angle, lane] = limb[b.THETA, lane] + elapsed * (
            value + elapsed * (rate / 2.0 + elapsed * bend / 6.0)
        )
        limb[spin, lane] = value + elapsed * (rate + elapsed * bend / 2.0)


@inlined
def end_step(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    """The state a step later; the filters advance exactly."""
    for lane in range(trunk.shape[1]):
        trunk[t.TIME, lane] += h
    if model.kind != FIXED:
        if model.new_rates:
            for lane in range(trunk.shape[1]):
                for k in range(2):
                    gain = h * trunk[t.FORCE + k, lane]
                    trunk[t.MOMENTUM + k, lane] += gain
                    trunk[t.MEAN + k, lane] += gain * trunk[t.PER_MASS, lane]
                trunk[t.MEAN + t.PITCH - t.FIRST, lane] += h * trunk[t.PITCH_ACC, lane]
                trunk[t.MEAN + t.MOMENTUM - t.FIRST, lane] = 0.0
                trunk[t.MEAN + t.MOMENTUM - t.FIRST + 1, lane] = 0.0
        for k in range(t.MOVING):
            for lane in range(trunk.shape[1]):
                trunk[t.FIRST + k, lane] += h * trunk[t.MEAN + k, lane]
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        if model.motors[i] == 0.0:
            prescribe(limb, b.THETA, b.OMEGA, h)
        elif model.new_rates:
            for lane in range(limb.shape[1]):
                limb[b.OMEGA, lane] += h * limb[b.SPIN_RATE_MEAN, lane]
                limb[b.THETA, lane] += h * limb[b.OMEGA, lane]
        else:
            for lane in range(limb.shape[1]):
                limb[b.THETA, lane] += h * limb[b.SPIN_MEAN, lane]
                limb[b.OMEGA, lane] += h * limb[b.SPIN_RATE_MEAN, lane]
        for k in range(4):
            for lane in range(limb.shape[1]):
                rate, bend = limb[b.RATE + k, lane], limb[b.BEND + k, lane]
                limb[b.VALUE + k, lane] += h * (rate + 0.5 * h * bend)
                limb[b.RATE + k, lane] = rate + h * bend

"""One step in time for a tile of environments: the stages of an explicit scheme (`schemes`); see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.trunk import FIXED
from hoof_env.dynamics.vectors import copy_row, fill_row, set_four_rows, set_row, set_six_rows
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
            copy_row(trunk, t.NOW + k, t.FIRST + k)
            fill_row(trunk, t.MEAN + k, 0.0)
    for i in range(limbs.shape[0]):
        copy_row(limbs[i], b.ANGLE, b.THETA)
        copy_row(limbs[i], b.SPIN, b.OMEGA)
        fill_row(limbs[i], b.SPIN_MEAN, 0.0)
        fill_row(limbs[i], b.SPIN_RATE_MEAN, 0.0)


@inlined
def weigh_stage(trunk, limbs, model, weight):  # type: ignore[no-untyped-def]
    """Add the derivatives at the present stage to their means."""
    if weight == 0.0:
        return
    if model.kind != FIXED:
        set_six_rows(trunk, t.MEAN, t.MEAN, weight, t.FLOW)
    for i in range(limbs.shape[0]):
        set_row(limbs[i], b.SPIN_MEAN, b.SPIN_MEAN, weight, b.SPIN)
        set_row(limbs[i], b.SPIN_RATE_MEAN, b.SPIN_RATE_MEAN, weight, b.SPIN_RATE)


@inlined
def next_stage(trunk, limbs, model, elapsed):  # type: ignore[no-untyped-def]
    """Go `elapsed` [s] from the step's start with the derivatives of the present stage."""
    if model.kind != FIXED:
        set_six_rows(trunk, t.NOW, t.FIRST, elapsed, t.FLOW)
    for i in range(limbs.shape[0]):
        if model.motors[i] != 0.0:
            set_row(limbs[i], b.ANGLE, b.THETA, elapsed, b.SPIN)
            set_row(limbs[i], b.SPIN, b.OMEGA, elapsed, b.SPIN_RATE)
        else:
            prescribe(limbs[i], b.ANGLE, b.SPIN, elapsed)


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
def use_new_rates(trunk, h):  # type: ignore[no-untyped-def]
    """Semi-implicit Euler: place and pitch go with the velocities that the step ends with."""
    for lane in range(trunk.shape[1]):
        for k in range(2):
            trunk[t.MEAN + k, lane] += h * trunk[t.FORCE + k, lane] * trunk[t.PER_MASS, lane]
        trunk[t.MEAN + t.PITCH - t.FIRST, lane] += h * trunk[t.PITCH_ACC, lane]


@inlined
def end_step(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    """The state a step later; the filters advance exactly."""
    for lane in range(trunk.shape[1]):
        trunk[t.TIME, lane] += h
    if model.kind != FIXED:
        if model.new_rates:
            use_new_rates(trunk, h)
        set_six_rows(trunk, t.FIRST, t.FIRST, h, t.MEAN)
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        if model.motors[i] == 0.0:
            prescribe(limb, b.THETA, b.OMEGA, h)
        elif model.new_rates:
            set_row(limb, b.OMEGA, b.OMEGA, h, b.SPIN_RATE_MEAN)
            set_row(limb, b.THETA, b.THETA, h, b.OMEGA)
        else:
            set_row(limb, b.THETA, b.THETA, h, b.SPIN_MEAN)
            set_row(limb, b.OMEGA, b.OMEGA, h, b.SPIN_RATE_MEAN)
        set_four_rows(limb, b.VALUE, b.VALUE, 0.5 * h * h, b.BEND)
        set_four_rows(limb, b.VALUE, b.VALUE, h, b.RATE)
        set_four_rows(limb, b.RATE, b.RATE, h, b.BEND)

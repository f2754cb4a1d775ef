"""What the kernels report: drive torques, powers and where the energy went; see `lanes`."""

from __future__ import annotations

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes_ground import HEEL, TOE
from hoof_env.dynamics.vectors import add, add_vector, vector
from hoof_env.leg import profile as f
from hoof_env.simd import across, below, choose, dot, write
from hoof_env.simd.compile import inlined

ACCOUNT = (
    "crank_work", "swing_work",  # by the drives [J]
    "ground_stored",  # in the ground's springs; it comes back [J]
    "ground_loss", "friction_loss", "drag_loss", "damper_loss",  # never negative [J]
    "impulse_x", "impulse_y",  # of the ground on all hoofs [N s]
)  # fmt: skip
"""Integrals over time, taken with the stages and weights of the scheme."""
(
    CRANK_WORK, SWING_WORK, GROUND_STORED, GROUND_LOSS, FRICTION_LOSS, DRAG_LOSS, DAMPER_LOSS, IMPULSE,
) = range(8)  # fmt: skip

TRUNK_REPORT = ("x", "y", "vx", "vy", "ax", "ay", "pitch_rate", "pitch_acc")
"""Of the trunk's centre of mass; its pitch is in the state [m, s, rad]."""

LIMB_REPORT = (
    "theta_acc", "phi", "phi_rate", "phi_acc",  # crank and swing [rad, s]
    "crank_torque", "hip_torque",  # along theta and phi [N m]
    "crank_power", "hip_power",  # of the crank's drive and of the swing's [W]
    "toe_x", "toe_y", "toe_slide", "toe_normal", "toe_friction",  # [m, m/s, N], along the ground's normal
    "heel_x", "heel_y", "heel_slide", "heel_normal", "heel_friction",  # and its tangent
)  # fmt: skip
"""Of each leg. A motor turns crank and swing: its torque is the crank's, the hip's is what the gear between
them carries, and the hip's power is that of the actuator which changes the swing's parameters."""


@inlined
def feel_drives(trunk, limb):  # type: ignore[no-untyped-def]
    """Torques and powers of crank and swing from the accelerations (Lagrange's equations)."""
    w, acc, k, sway = limb[b.SPIN], limb[b.SPIN_RATE], limb[b.K], limb[b.SWAY]
    frame, pitch_acc = limb[b.FRAME], trunk[t.PITCH_ACC]
    coupling = limb[b.COUPLING] - k * frame
    turning = pitch_acc + k * acc
    lift = vector(trunk, t.ACC) + pitch_acc * across(vector(limb, b.HIP))
    by_frame = (
        coupling * acc
        + frame * turning
        + limb[b.REST_BETA]
        + dot(lift, across(vector(limb, b.S)))
        - limb[b.Q_BETA]
    )
    needed = (
        (limb[b.VALUES + f.A] + limb[b.ROTOR_A]) * acc
        + coupling * turning
        + limb[b.REST_THETA]
        + dot(lift, vector(limb, b.DS))
        - limb[b.Q_THETA]
    )
    is_motor = limb[b.MOTOR] > 0.0
    torque = choose(is_motor, limb[b.CRANK_TORQUE], needed)
    limb[b.FRAME_TORQUE], limb[b.CRANK_TORQUE], limb[b.CRANK_POWER] = by_frame, torque, torque * w
    limb[b.SWING_POWER] = by_frame * choose(is_motor, sway, k * w + sway)


@inlined
def keep_account(trunk, limbs, legs, model, account, weight):  # type: ignore[no-untyped-def]
    """Add the present stage's powers and forces, times `weight` [s], to the rows of `ACCOUNT`."""
    velocity, together = vector(trunk, t.VELOCITY), model.together
    drag = trunk[t.DRAG] * (velocity.real * velocity.real)
    damper = trunk[t.DAMPER] * (velocity.imag * velocity.imag)
    account[DRAG_LOSS] = account[DRAG_LOSS] + weight * drag
    account[DAMPER_LOSS] = account[DAMPER_LOSS] + weight * damper
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        feel_drives(trunk, limb)
        toe, heel = limb[TOE + b.DEPTH_RATE], limb[HEEL + b.DEPTH_RATE]
        stored = limb[TOE + b.SPRING] * toe + limb[HEEL + b.SPRING] * heel
        spent = limb[TOE + b.NORMAL] * toe + limb[HEEL + b.NORMAL] * heel - stored
        rubbed = limb[TOE + b.RUB] * limb[TOE + b.SLIDE] + limb[HEEL + b.RUB] * limb[HEEL + b.SLIDE]
        add(account, CRANK_WORK, weight * limb[b.CRANK_POWER], together)
        add(account, SWING_WORK, weight * limb[b.SWING_POWER], together)
        add(account, GROUND_STORED, weight * stored, together)
        add(account, GROUND_LOSS, weight * spent, together)
        add(account, FRICTION_LOSS, -weight * rubbed, together)
        add_vector(account, IMPULSE, weight * vector(limb, b.PUSH), together)


@inlined
def report_trunk(trunk, data, start, row, stride):  # type: ignore[no-untyped-def]
    """Write `TRUNK_REPORT` to the rows of `data`, `row` apart from `start` on; lanes are `stride` apart."""
    for k in range(6):
        write(trunk[t.PLACE + k], data, start + k * row, stride)
    write(trunk[t.PITCH_RATE], data, start + 6 * row, stride)
    write(trunk[t.PITCH_ACC], data, start + 7 * row, stride)


@inlined
def report_leg(trunk, limb, data, start, row, stride):  # type: ignore[no-untyped-def]
    """`LIMB_REPORT` likewise."""
    feel_drives(trunk, limb)
    side, k, w, acc = limb[b.SIDE], limb[b.K], limb[b.SPIN], limb[b.SPIN_RATE]
    write(acc, data, start, stride)
    write(limb[b.PHI], data, start + row, stride)
    write(side * (k * w + limb[b.SWAY]), data, start + 2 * row, stride)
    write(side * (k * acc + limb[b.SWAY_RATE]), data, start + 3 * row, stride)
    write(limb[b.CRANK_TORQUE], data, start + 4 * row, stride)
    write(side * limb[b.FRAME_TORQUE], data, start + 5 * row, stride)
    write(limb[b.CRANK_POWER], data, start + 6 * row, stride)
    write(limb[b.SWING_POWER], data, start + 7 * row, stride)
    report_point(limb, TOE, data, start + 8 * row, row, stride)
    report_point(limb, HEEL, data, start + 13 * row, row, stride)


@inlined
def report_point(limb, c, data, start, row, stride):  # type: ignore[no-untyped-def]
    """The part of `LIMB_REPORT` that belongs to the hoof point with rows `c`."""
    write(limb[c + b.SPOT], data, start, stride)
    write(limb[c + b.SPOT + 1], data, start + row, stride)
    write(limb[c + b.SLIDE], data, start + 2 * row, stride)
    write(limb[c + b.NORMAL], data, start + 3 * row, stride)
    write(limb[c + b.RUB], data, start + 4 * row, stride)

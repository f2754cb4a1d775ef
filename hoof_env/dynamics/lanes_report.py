"""What a tile of environments reports: drive torques, powers and where the energy went; see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.vectors import across, vector
from hoof_env.leg import profile as f
from hoof_env.leg.kinematics import dot

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
"""Of each leg. A motor turns crank and swing: its torque is the crank's, the hip's is what the gear between them
carries, and the hip's power is that of the actuator which changes the swing's parameters."""


@inlined
def feel_drives(trunk, limb, is_motor):  # type: ignore[no-untyped-def]
    """Torques and powers of crank and swing from the accelerations (Lagrange's equations)."""
    for lane in range(limb.shape[1]):
        w, acc, k = limb[b.SPIN, lane], limb[b.SPIN_RATE, lane], limb[b.K, lane]
        frame = limb[b.VALUES + f.C, lane] + limb[b.ROTOR_C, lane]
        coupling = limb[b.COUPLING, lane] - k * frame
        turning = trunk[t.PITCH_ACC, lane] + k * acc
        lift = vector(trunk, t.ACC, lane) + across(vector(limb, b.HIP, lane)) * trunk[t.PITCH_ACC, lane]
        by_frame = (
            coupling * acc
            + frame * turning
            + limb[b.REST_BETA, lane]
            + dot(lift, across(vector(limb, b.S, lane)))
            - limb[b.Q_BETA, lane]
        )
        limb[b.FRAME_TORQUE, lane] = by_frame
        if is_motor:
            torque, sway = limb[b.CRANK_TORQUE, lane], limb[b.SWAY, lane]
        else:
            torque = (
                (limb[b.VALUES + f.A, lane] + limb[b.ROTOR_A, lane]) * acc
                + coupling * turning
                + limb[b.REST_THETA, lane]
                + dot(lift, vector(limb, b.DS, lane))
                - limb[b.Q_THETA, lane]
            )
            limb[b.CRANK_TORQUE, lane] = torque
            sway = k * w + limb[b.SWAY, lane]
        limb[b.CRANK_POWER, lane] = torque * w
        limb[b.SWING_POWER, lane] = by_frame * sway


@inlined
def keep_account(trunk, limbs, model, account, weight):  # type: ignore[no-untyped-def]
    """Add the present stage's powers and forces, times `weight` [s], to the rows of `ACCOUNT`."""
    for lane in range(trunk.shape[1]):
        velocity = vector(trunk, t.VELOCITY, lane)
        account[DRAG_LOSS, lane] += weight * (trunk[t.DRAG, lane] * (velocity.real * velocity.real))
        account[DAMPER_LOSS, lane] += weight * (trunk[t.DAMPER, lane] * (velocity.imag * velocity.imag))
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        feel_drives(trunk, limb, model.motors[i] != 0.0)
        for lane in range(limb.shape[1]):
            account[CRANK_WORK, lane] += weight * limb[b.CRANK_POWER, lane]
            account[SWING_WORK, lane] += weight * limb[b.SWING_POWER, lane]
            account[IMPULSE, lane] += weight * limb[b.PUSH, lane]
            account[IMPULSE + 1, lane] += weight * limb[b.PUSH + 1, lane]
        for point in range(2):
            c = b.CONTACT + point * b.CONTACT_ROWS
            for lane in range(limb.shape[1]):
                spring = trunk[t.STIFFNESS, lane] * limb[c + b.FIRMNESS, lane] * limb[c + b.POWER, lane]
                spring = spring if limb[c + b.DEPTH, lane] > 0.0 else 0.0
                rate = limb[c + b.DEPTH_RATE, lane]
                account[GROUND_STORED, lane] += weight * (spring * rate)
                account[GROUND_LOSS, lane] += weight * ((limb[c + b.NORMAL, lane] - spring) * rate)
                account[FRICTION_LOSS, lane] -= weight * (limb[c + b.RUB, lane] * limb[c + b.SLIDE, lane])


@inlined
def report(trunk, limbs, model, trunk_out, limb_out, n, lanes):  # type: ignore[no-untyped-def]
    """Write `TRUNK_REPORT` and `LIMB_REPORT` of the first `lanes` lanes into columns n, n + 1, ... of the outputs."""
    for lane in range(lanes):
        for k in range(2):
            trunk_out[k, n + lane] = trunk[t.PLACE + k, lane]
            trunk_out[2 + k, n + lane] = trunk[t.VELOCITY + k, lane]
            trunk_out[4 + k, n + lane] = trunk[t.ACC + k, lane]
        trunk_out[6, n + lane] = trunk[t.PITCH_RATE, lane]
        trunk_out[7, n + lane] = trunk[t.PITCH_ACC, lane]
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        feel_drives(trunk, limb, model.motors[i] != 0.0)
        for lane in range(lanes):
            side, w, acc = limb[b.SIDE, lane], limb[b.SPIN, lane], limb[b.SPIN_RATE, lane]
            limb_out[i, 0, n + lane] = acc
            limb_out[i, 1, n + lane] = limb[b.PHI, lane]
            limb_out[i, 2, n + lane] = side * (limb[b.K, lane] * w + limb[b.SWAY, lane])
            limb_out[i, 3, n + lane] = side * (limb[b.K, lane] * acc + limb[b.SWAY_RATE, lane])
            limb_out[i, 4, n + lane] = limb[b.CRANK_TORQUE, lane]
            limb_out[i, 5, n + lane] = side * limb[b.FRAME_TORQUE, lane]
            limb_out[i, 6, n + lane] = limb[b.CRANK_POWER, lane]
            limb_out[i, 7, n + lane] = limb[b.SWING_POWER, lane]
            for point in range(2):
                c, first = b.CONTACT + point * b.CONTACT_ROWS, 8 + 5 * point
                limb_out[i, first, n + lane] = limb[c + b.SPOT, lane]
                limb_out[i, first + 1, n + lane] = limb[c + b.SPOT + 1, lane]
                limb_out[i, first + 2, n + lane] = limb[c + b.SLIDE, lane]
                limb_out[i, first + 3, n + lane] = limb[c + b.NORMAL, lane]
                limb_out[i, first + 4, n + lane] = limb[c + b.RUB, lane]

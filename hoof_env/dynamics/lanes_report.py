"""What a tile of environments reports: drive torques, powers and where the energy went; see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined, pasted
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.vectors import across, gather_row, vector
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
"""Of each leg. A motor turns crank and swing: its torque is the crank's, the hip's is what the gear between
them carries, and the hip's power is that of the actuator which changes the swing's parameters."""


@inlined
def feel_drives(trunk, limb):  # type: ignore[no-untyped-def]
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
        needed = (
            (limb[b.VALUES + f.A, lane] + limb[b.ROTOR_A, lane]) * acc
            + coupling * turning
            + limb[b.REST_THETA, lane]
            + dot(lift, vector(limb, b.DS, lane))
            - limb[b.Q_THETA, lane]
        )
        is_motor = limb[b.MOTOR, lane] > 0.0
        given, held = limb[b.CRANK_TORQUE, lane], limb[b.SWAY, lane]
        torque = given if is_motor else needed
        sway = held if is_motor else k * w + held
        limb[b.CRANK_TORQUE, lane] = torque
        limb[b.CRANK_POWER, lane] = torque * w
        limb[b.SWING_POWER, lane] = by_frame * sway


@pasted
def keep_account(trunk, limbs, model, account, weight):  # type: ignore[no-untyped-def]
    """Add the present stage's powers and forces, times `weight` [s], to the rows of `ACCOUNT`."""
    for lane in range(trunk.shape[1]):
        velocity = vector(trunk, t.VELOCITY, lane)
        account[DRAG_LOSS, lane] += weight * (trunk[t.DRAG, lane] * (velocity.real * velocity.real))
        account[DAMPER_LOSS, lane] += weight * (trunk[t.DAMPER, lane] * (velocity.imag * velocity.imag))
    for i in range(limbs.shape[0]):
        limb = limbs[i]
        feel_drives(trunk, limb)
        for lane in range(limb.shape[1]):
            for k in range(3):
                limb[b.PART + k, lane] = 0.0
        for point in range(2):
            c = b.CONTACT + point * b.CONTACT_ROWS
            for lane in range(limb.shape[1]):
                spring = trunk[t.STIFFNESS, lane] * limb[c + b.FIRMNESS, lane] * limb[c + b.POWER, lane]
                spring = spring if limb[c + b.DEPTH, lane] > 0.0 else 0.0
                rate = limb[c + b.DEPTH_RATE, lane]
                limb[b.PART, lane] += spring * rate
                limb[b.PART + 1, lane] += (limb[c + b.NORMAL, lane] - spring) * rate
                limb[b.PART + 2, lane] -= limb[c + b.RUB, lane] * limb[c + b.SLIDE, lane]
        gather_row(account, CRANK_WORK, limb, b.CRANK_POWER, weight, model.together)
        gather_row(account, SWING_WORK, limb, b.SWING_POWER, weight, model.together)
        gather_row(account, GROUND_STORED, limb, b.PART, weight, model.together)
        gather_row(account, GROUND_LOSS, limb, b.PART + 1, weight, model.together)
        gather_row(account, FRICTION_LOSS, limb, b.PART + 2, weight, model.together)
        gather_row(account, IMPULSE, limb, b.PUSH, weight, model.together)
        gather_row(account, IMPULSE + 1, limb, b.PUSH + 1, weight, model.together)


@pasted
def report(trunk, limbs, together, trunk_out, limb_out, n, lanes):  # type: ignore[no-untyped-def]
    """Write `TRUNK_REPORT` and `LIMB_REPORT` into columns n, n + 1, ... of the outputs: of `lanes`
    environments, or of one whose legs the lanes are."""
    for i in range(limbs.shape[0]):
        feel_drives(trunk, limbs[i])
    for lane in range(limbs.shape[2] if together else lanes):
        e = n if together else n + lane
        for k in range(2):
            trunk_out[k, e] = trunk[t.PLACE + k, lane]
            trunk_out[2 + k, e] = trunk[t.VELOCITY + k, lane]
            trunk_out[4 + k, e] = trunk[t.ACC + k, lane]
        trunk_out[6, e] = trunk[t.PITCH_RATE, lane]
        trunk_out[7, e] = trunk[t.PITCH_ACC, lane]
        for i in range(limbs.shape[0]):
            limb, leg = limbs[i], lane if together else i
            side, w, acc = limb[b.SIDE, lane], limb[b.SPIN, lane], limb[b.SPIN_RATE, lane]
            limb_out[leg, 0, e] = acc
            limb_out[leg, 1, e] = limb[b.PHI, lane]
            limb_out[leg, 2, e] = side * (limb[b.K, lane] * w + limb[b.SWAY, lane])
            limb_out[leg, 3, e] = side * (limb[b.K, lane] * acc + limb[b.SWAY_RATE, lane])
            limb_out[leg, 4, e] = limb[b.CRANK_TORQUE, lane]
            limb_out[leg, 5, e] = side * limb[b.FRAME_TORQUE, lane]
            limb_out[leg, 6, e] = limb[b.CRANK_POWER, lane]
            limb_out[leg, 7, e] = limb[b.SWING_POWER, lane]
            for point in range(2):
                c, first = b.CONTACT + point * b.CONTACT_ROWS, 8 + 5 * point
                limb_out[leg, first, e] = limb[c + b.SPOT, lane]
                limb_out[leg, first + 1, e] = limb[c + b.SPOT + 1, lane]
                limb_out[leg, first + 2, e] = limb[c + b.SLIDE, lane]
                limb_out[leg, first + 3, e] = limb[c + b.NORMAL, lane]
                limb_out[leg, first + 4, e] = limb[c + b.RUB, lane]

"""Rows that belong to one leg, in the kernels and, where state or settings, in the engine's memory.

Names are row numbers; a vector takes two rows, x at its name and y at the next. SI units and radians. The leg
enters through its functions of the crank angle (`leg.profile`); beta = pitch + side phi is the world angle
of its frame.
"""

from __future__ import annotations

from hoof_env.leg.profile import SLOPED, WIDTH

# The state.
THETA, OMEGA, VALUE, _, _, _, RATE, _, _, _, MEMORY, _, _, _, _, _ = range(16)
STATE = (
    "theta", "theta_rate",
    "crank_speed", "swing_offset", "swing_sin", "swing_cos",
    "crank_speed_rate", "swing_offset_rate", "swing_sin_rate", "swing_cos_rate",
    "toe_penetration", "toe_rate", "toe_slowness", "heel_penetration", "heel_rate", "heel_slowness",
)  # fmt: skip
"""Crank angle and rate; command filters; what each hoof point remembers of the last whole step: penetration,
its rate, and while it is in the ground its slowness at entry, 1 / approach speed [s/m], else 0."""

STANCE_OPEN, STANCE_BEGAN, STANCE_PEAK = range(16, 19)
STRIDES = ("stance_open", "stance_began", "stance_peak")
"""Whether there is a stance (1 or 0), the crank angle where it opened [rad], and its highest force [N]; see
`lanes_strides`."""

STRIDE_SUM = 19
PEAK_INCREASE, HIGHEST, POSITIVE_WORK, LOAD_IMPULSE, LOADED_TIME, STANCES, TRAVEL = range(19, 26)
STRIDE_SUMS = (
    "peak_increase", "highest", "positive_work", "load_impulse", "loaded_time", "stances", "travel",
)  # fmt: skip
"""Of one call of the engine: increases of running peaks and highest force [N], positive work of both drives
[J], impulse of the normal force [N s], time under load [s], stances that began, and load-weighted backward
travel of the hoof along the ground [m]."""

VALUES = 26  # the leg's functions at the present stage, in the profile's order
SLOPES = VALUES + WIDTH  # derivatives of the first of them by the crank angle
(
    COMMAND, _, _, _,  # what is commanded of the filters
    BEND, _, _, _,  # and the acceleration that this gives them
    ANGLE, SPIN, SPIN_RATE,  # crank angle, rate and acceleration at the present stage
    SPIN_MEAN, SPIN_RATE_MEAN,  # weighted means over the stages so far
    PHI, K,  # swing; beta by theta, time and pitch held
    SWAY, SWAY_RATE,  # beta's rate less pitch_t and K theta_t; its acceleration less pitch_tt and K theta_tt
    FRAME_RATE,  # rate of beta
    TURN, _, HIP, _,  # e^(i beta); from the trunk's centre of mass to O
    S, _, DS, _, U, _,  # first moment about O; by theta with the frame held, and swinging: DS + i K S [kg m]
    FRAME, COUPLING, INERTIA,  # of the geared crank and frame: c, b + c K, a + 2 b K + c K^2 [kg m^2]
    LEVER,  # coupling of geared crank and pitch, COUPLING + HIP x U [kg m^2]
    Q_THETA, Q_BETA, PUSH, _,  # the ground: generalised forces [N m], force [N]
    REST_THETA, REST_BETA,  # generalised inertia forces at rest of the accelerations, weight included [N m]
    SPIN_RATE_FREE, SOFTNESS,  # crank acceleration if the trunk kept still; 1 / INERTIA, 0 if prescribed
    CRANK_TORQUE, FRAME_TORQUE, CRANK_POWER, SWING_POWER,  # drives [N m, W]; FRAME_: along beta
) = range(SLOPES + SLOPED, SLOPES + SLOPED + 44)  # fmt: skip

CONTACT = SLOPES + SLOPED + 44
CONTACT_ROWS = 15
"""Toe's rows begin at CONTACT, heel's at CONTACT + CONTACT_ROWS; the names below count from there."""
(
    SPOT, _, DEPTH, DEPTH_RATE,  # where the point is, penetration and its rate [m, m/s]
    NORMAL_X, _, FIRMNESS, ROUGHNESS,  # the ground there: normal, factors of K and mu
    SLIDE, SPRING,  # speed along the ground [m/s]; the part of the normal force that comes back [N]
    SLOWNESS,  # 1 / approach speed [s/m]
    NORMAL, RUB,  # force along the ground's normal and along the ground [N]
    FORCE, _,  # in the world [N]
) = range(15)  # fmt: skip

_P = CONTACT + 2 * CONTACT_ROWS
HIP_ON_TRUNK, _, MASS, SIDE, FIRST, MOTOR, GAIN, LIMIT, ROTOR_A, ROTOR_B, ROTOR_C, LIFT_OFF = range(
    _P, _P + 12
)
PARAMETERS = (
    "hip_x", "hip_y", "mass", "side", "first_row", "is_motor", "speed_gain", "torque_limit",
    "rotor_a", "rotor_b", "rotor_c", "lift_off",
)  # fmt: skip
"""Settings of a leg: its place on the trunk, mass, which way it travels, the row where its table begins, its
motor, what the rotor adds to the inertias a, b, c, and the
normal force that tells stance from swing [N]."""

ROWS = _P + 12

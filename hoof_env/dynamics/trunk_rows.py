"""Rows that belong to the trunk, in the kernels and, where state or settings, in the engine's memory.

Names are row numbers; a vector takes two rows, x at its name and y at the next. SI units and radians. 'All'
means trunk and legs together.
"""

from __future__ import annotations

# The state. Where the trunk cannot move, the centre is the trunk's place and a momentum is 0.
TIME, CENTRE, _, MOMENTUM, _, PITCH, SPIN = range(7)
STATE = ("time", "centre_x", "centre_y", "momentum_x", "momentum_y", "pitch", "spin")
"""Time; centre of mass and momentum of all; pitch of the trunk; angular momentum of all about the centre."""

FIRST, MOVING = 1, 6
"""The `MOVING` rows from `FIRST` on are integrated; those from NOW, FLOW and MEAN on belong to them."""

NOW = 7  # the same at the present stage of a step
NOW_CENTRE, _, NOW_MOMENTUM, _, NOW_PITCH, NOW_SPIN = range(NOW, NOW + 6)
FLOW = 13  # time derivatives there
CENTRE_FLOW, _, FORCE, _, PITCH_RATE, TWIST = range(FLOW, FLOW + 6)
# FORCE: outer, weight included [N]; TWIST: its moment about the centre [N m]
MEAN = 19  # weighted mean of the derivatives at the stages so far

(
    PLACE, _, VELOCITY, _, ACC, _, PITCH_ACC,  # of the trunk's own centre of mass
    TURN, _,  # e^(i pitch)
    MOMENT, _,  # first moment of all about the trunk's centre of mass [kg m]
    DRIFT, _,  # its rate [kg m/s], but for the pitch's part
    ROUND, SWIRL,  # inertia of all about the trunk's centre [kg m^2]; their spin, but for the pitch's
    LOAD, _, LOAD_TURN,  # right side of the trunk's equations [N, N m]
    M_XX, M_XY, M_YY, M_XP, M_YP, M_PP,  # and their matrix, with the cranks of the motors eliminated
    STUCK, FELL,  # 1 once a crank was where its linkage does not close; once the trunk was below BOTTOM
) = range(25, 51)  # fmt: skip

(
    TOTAL_MASS, PER_MASS, PITCH_INERTIA, SUPPORT, SPRING, DAMPER, HEIGHT, DRAG, GRAVITY,
    STIFFNESS, CHI, DASHPOT, FLOOR, FRICTION, SLOW, FAST, BOTTOM,
) = range(51, 68)  # fmt: skip
PARAMETERS = (
    "total_mass", "per_mass", "pitch_inertia", "support", "spring", "damper", "height", "drag", "gravity",
    "stiffness", "chi", "dashpot", "approach_floor", "friction", "friction_slow", "friction_fast",
    "bottom",
)  # fmt: skip
"""Settings of an environment: mass of all and its inverse, what the rest of the animal bears [N] and its
spring and damper, ..., the ground's (`ground.contact.Ground`), and the height below which the trunk has
fallen through it [m]."""

ROWS = 68

FARTHEST = 1e9
"""Largest angles [rad] and places [m] of a state, which are as good as numbers are fine there: to 6e-10 at
1e6, to 6e-7 at 1e9; also the largest rates of a start, whose squares are then numbers still."""

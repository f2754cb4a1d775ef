"""Names of all rows of memory, of trunk and legs on the kernels' stack and in the engine's array.

SI units and radians. beta = pitch + side phi is the world angle of a leg's frame. 'All' means trunk and legs
together; a 'fixed' frame does not swing while the crank turns.

Blocks that only some engines have (`Features`) are of size 0 in all other engines, whose memory, speed and
bits they do not change.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, NamedTuple

from hoof_env.dynamics.leg_constants import PAPER_STRUCTURE, LegConstants, Structure, constants_layout
from hoof_env.gait import parameter_names
from hoof_env.leg.profile import Functions, Slopes
from hoof_env.simd.layout import AnyLayout, Block, Layout, Row, Size, Vector

MAX_STATE = 1e9
"""Largest angle [rad] and place [m] of a state, where rounding is 6e-7 (6e-10 at 1e6); also the largest rate
of a start, because its square must stay finite."""

# sizes of the blocks that depend on `Features`, with the sizes for `PLAIN` as defaults
GAIT = Size("gait", 4)
SPRING = Size("spring", 0)
SPRUNG = Size("sprung", 0)
LIMITED = Size("limited", 0)
LIMITS = Size("limits", 0)

# and with the sizes for the paper's structure
JOINT_ROWS = Size("joint_rows", 2 * len(PAPER_STRUCTURE.mechanism.joints))
WELDS = Size("welds", len(PAPER_STRUCTURE.mechanism.welds))


class Features(NamedTuple):
    """Options of an engine beyond the paper's rigid leg. They are constants of its kernels: an option that is
    off costs neither time nor memory.

    Attributes:
        harmonics: order of the swing law, 1 to `gait.MAX_HARMONICS`.
        has_springs: true for springs in series with the ground at each hoof point; see `parts.HoofSpring`.
        has_limits: true for limits of the motion, legs of other sizes in some environments, and horizontal
            impulses.
        structure: structure of the legs, from which kernels find joints for limits and joint reactions;
            without these features it is the paper's, so that all legs share kernels.
        feet: number of points of a hoof, 1 or 2.
    """

    harmonics: int = 1
    has_springs: bool = False
    has_limits: bool = False
    structure: Structure = PAPER_STRUCTURE
    feet: int = 2

    @property
    def gait_size(self) -> int:
        """Number of gait parameters of a leg."""
        return 2 + 2 * self.harmonics

    def of(self, layout: type[AnyLayout]) -> type[AnyLayout]:
        """Return a layout of this module in the sizes of engines with these features."""
        # spring: normal and tangential; limits: lowest and highest pitch and height, and the clearance
        sized: type[AnyLayout] = layout.sized(
            gait=self.gait_size,
            spring=2 * self.has_springs,
            sprung=int(self.has_springs),
            limited=int(self.has_limits),
            limits=5 * self.has_limits,
        )
        return sized


PLAIN = Features()
"""The paper's leg, without features."""


# The trunk


class Moving(Layout):
    """Integrated quantities of the trunk. Where it cannot move, `centre` is its place and the momentum is
    0."""

    centre: Vector  # centre of mass of all [m]
    momentum: Vector  # of all [kg m/s]
    pitch: Row  # of the trunk [rad]
    angular_momentum: Row  # of all bodies about `centre` [kg m^2/s]


class Rates(Layout):
    """Time derivatives of `Moving`."""

    velocity: Vector  # of the centre of mass of all [m/s]
    force: Vector  # sum of the outer forces, weight included [N]
    pitch_rate: Row  # [rad/s]
    moment: Row  # of the outer forces about the centre [N m]


class TrunkState(Layout):
    """State of the trunk: all that changes from step to step."""

    time: Row  # [s]
    moving: Moving


class TrunkSettings(Layout):
    """Settings of one environment: trunk and ground."""

    total_mass: Row  # of all [kg]
    inverse_mass: Row  # [1/kg]
    pitch_inertia: Row  # of the trunk about its own centre of mass [kg m^2]
    support: Row  # part of the weight that the rest of the animal bears [N]
    spring: Row  # [N/m]
    damper: Row  # [N s/m]
    height: Row  # height at which the spring is at rest [m]
    drag: Row  # [N s/m]
    gravity: Row  # [m/s^2]
    stiffness: Row  # K of Eq. 14 [N/m^n]; this and what follows is the ground's; see `ground.contact.Ground`
    chi: Row  # [-]
    dashpot: Row  # [N s/m]
    approach_floor: Row  # [m/s]
    friction: Row  # [-]
    friction_slow: Row  # [m/s]
    friction_fast: Row  # [m/s]
    bottom: Row  # height below which the trunk has fallen through the ground [m]
    limits: Annotated[Block, LIMITS]  # `parts.Limits`: pitch [rad], height [m], two each; clearance [m]


class TrunkRows(Layout):
    """Rows of a trunk in the kernels."""

    state: TrunkState
    stage: Moving  # at the present stage of a step
    rates: Rates  # at that stage
    mean_rates: Rates  # weighted mean over the stages so far; used only by schemes that average
    place: Vector  # of the trunk's own centre of mass [m]
    velocity: Vector  # [m/s]
    acceleration: Vector  # [m/s^2]
    pitch_acceleration: Row  # [rad/s^2]
    turn: Vector  # e^(i pitch)
    first_moment: Vector  # of all about the trunk's centre of mass [kg m]
    relative_momentum: Vector  # of the legs against a trunk that does not pitch [kg m/s]
    composite_inertia: Row  # of all about the trunk's centre of mass [kg m^2]
    relative_angular_momentum: Row  # of the legs against a trunk that does not pitch [kg m^2/s]
    load: Vector  # the legs' inertia forces on the right of (E8) [N]
    load_moment: Row  # [N m]
    mass_xx: Row  # matrix of (E8), with the cranks of the motors eliminated
    mass_xy: Row
    mass_yy: Row
    mass_xp: Row
    mass_yp: Row
    mass_pp: Row
    at_dead_point: Row  # 1 once a crank was where its linkage does not close
    fallen: Row  # 1 once the trunk was below `bottom`
    violated_limit: Annotated[Block, LIMITED]  # the first limit that was passed, a number of `parts.Result`
    settings: TrunkSettings


class Account(Layout):
    """Energy account: integrals over time, with the stages and weights of the scheme."""

    crank_work: Row  # by the drives [J]
    swing_work: Row
    ground_stored: Row  # in the ground's springs; it comes back [J]
    ground_loss: Row  # never negative, like the losses below [J]
    friction_loss: Row
    drag_loss: Row
    damper_loss: Row
    impulse: Vector  # of the ground on all hooves [N s]
    hoof: Annotated[Block, SPRING]  # stored in the hooves' springs, lost in their dampers [J]


class TrunkReport(Layout):
    """Motion of the trunk's centre of mass, and pitch."""

    place: Vector  # [m]
    velocity: Vector  # [m/s]
    acceleration: Vector  # [m/s^2]
    pitch_rate: Row  # [rad/s]
    pitch_acceleration: Row  # [rad/s^2]


class TrunkMemory(Layout):
    """A trunk in the engine's array. The quantities in infos are contiguous; see `episodes.infos`."""

    settings: TrunkSettings
    account: Account
    state: TrunkState
    report: TrunkReport
    result: Row  # of the last call; see `parts.Result`


# A leg


class ContactMemory(Layout):
    """Memory of a hoof point: its contact at the last whole step."""

    penetration: Row  # [m]
    penetration_rate: Row  # [m/s]
    inverse_approach_speed: Row  # 1 / approach speed while it is in the ground, else 0 [s/m]
    deflection: Annotated[Block, SPRING]  # of the hoof's spring, along normal and tangent of the ground [m]


class LegState(Layout):
    """State of a leg: all that changes from step to step."""

    crank_angle: Row  # [rad]
    crank_angle_rate: Row  # [rad/s]
    gait: Annotated[Block, GAIT]  # outputs of the command filters, in the order of `gait.parameter_names`
    gait_rate: Annotated[Block, GAIT]
    toe: ContactMemory
    heel: ContactMemory


class Strides(Layout):
    """Open stance of a leg; see `observables`."""

    stance_open: Row  # 1 in a stance, else 0
    stance_began: Row  # crank angle there [rad]
    stance_peak: Row  # highest resultant force of this stance [N]
    steepest_rise: Row  # of the normal force while this stance's peak grew [N/s]
    normal_force: Row  # on the hoof [N]
    running_peak: Row  # of the resultant force, at most twice that force [N]


class Quantity(NamedTuple):
    """Description of a measured quantity, written where it is declared.

    Attributes:
        unit: of the number.
        text: meaning, for the manual.
        is_peak: the largest value counts where values are put together, not their sum.
    """

    unit: str
    text: str
    is_peak: bool = False


class StrideSums(Layout):
    """Quantities of one call of the engine, which a control step is: the table of its measurements.

    A new quantity takes a row here, the line that computes it in `observables.count_stride`, and one in
    `PaperEngine._sum`. It is then in `step.sums` of the reward's terms, in `episode.sums`, in infos and in
    the manual. Each field has one row or, in engines without it, no row and the value NaN; a sum or a peak
    starts at 0.
    """

    peak_grf_increase: Annotated[Row, Quantity("N", "increase of the stances' peaks in the control step")]
    running_peak_increase: Annotated[
        Row,
        Quantity("N", "increase of the running peak in the control step; the reward's peak term charges it"),
    ]
    loading_rate_increase: Annotated[
        Row, Quantity("N/s", "increase of the stances' steepest rises in the control step")
    ]
    highest_grf: Annotated[
        Row, Quantity("N", "highest resultant force of any substep of the control step", is_peak=True)
    ]
    positive_work: Annotated[
        Row, Quantity("J", "of both drives in the control step; braking is not recovered")
    ]
    normal_impulse: Annotated[
        Row, Quantity("N s", "normal force integrated over the control step; divided by `dt`, its mean [N]")
    ]
    loaded_time: Annotated[Row, Quantity("s", "part of the control step with load on the hoof")]
    stances: Annotated[Row, Quantity("-", "stances that began in the control step")]
    backward_travel: Annotated[
        Row, Quantity("m", "load-weighted backward travel of the hoof along the ground in the control step")
    ]
    slip: Annotated[
        Row, Quantity("m", "distance that the hoof slid in stance in the control step, in both directions")
    ]
    braking: Annotated[Row, LIMITED, Quantity("N s", "impulse of the ground backward in the control step")]
    propulsion: Annotated[Row, LIMITED, Quantity("N s", "impulse of the ground forward in the control step")]


class LegSettings(Layout):
    """Settings of one leg."""

    hip_on_trunk: Vector  # O from the trunk's centre of mass [m]
    mass: Row  # [kg]
    side: Row  # 1, or -1 of a geometry that travels towards -x
    first_row: Row  # row of the tables at which the leg's own begins
    is_motor: Row  # 1, or 0 of a prescribed crank
    speed_gain: Row  # [N m s/rad]
    torque_limit: Row  # [N m]
    rotor_crank: Row  # additions of the rotor to the inertias a, b, c [kg m^2]
    rotor_coupling: Row
    rotor_frame: Row
    lift_off: Row  # normal force that tells stance from swing [N]
    hoof_stiffness: Annotated[Block, SPRING]  # of the hoof's springs, normal and tangential [N/m]
    hoof_damping: Annotated[Block, SPRING]  # [N s/m]
    hoof_length: Annotated[Row, SPRUNG]  # of the springs at rest, from the leg's point to the sole [m]
    length_scale: Annotated[Block, LIMITED]  # ratio to the length in the table [-]
    mass_scale: Annotated[Block, LIMITED]  # [-]


class Contact(Layout):
    """A hoof point on the ground, at the present stage."""

    penetration: Row  # of the ground, less than of the leg's point with a spring [m]
    penetration_rate: Row  # [m/s]
    deflection: Annotated[Block, SPRING]  # of the spring at the present stage [m]
    deflection_rate: Annotated[Block, SPRING]  # [m/s]
    mean_deflection_rate: Annotated[Block, SPRING]  # weighted mean over the stages so far
    ground_normal: Vector  # [-]
    stiffness_scale: Row  # factor of K there [-]
    friction_scale: Row  # factor of mu there [-]
    slide: Row  # along the ground, with a spring of the sole [m/s]
    spring_force: Row  # the part of the normal force that comes back [N]
    inverse_approach_speed: Row  # [s/m]
    normal: Row  # [N]
    friction: Row  # along the ground [N]


class LegRows(Layout):
    """Rows of a leg in the kernels."""

    state: LegState
    strides: Strides
    sums: StrideSums
    row_begin: Row  # of the leg's table where the crank angle is, plus `profile.WHOLE`
    cell_angle: Row  # from the middle of that row's cell [rad]
    functions: Functions  # of the crank angle, at the present stage
    slopes: Slopes
    sine: Row  # of the crank angle [-]
    cosine: Row
    command: Annotated[Block, GAIT]
    gait_acceleration: Annotated[Block, GAIT]  # second derivatives of the command filters
    theta: Row  # crank angle, rate and acceleration at the present stage
    theta_rate: Row
    theta_acceleration: Row
    mean_theta_rate: Row  # weighted means over the stages so far, where the scheme averages
    mean_theta_acceleration: Row
    phi: Row  # swing [rad]
    beta_by_theta: Row  # beta' with time and pitch held [-]
    swing_rate: Row  # beta's rate less pitch_t and beta' theta_t [rad/s]
    swing_acceleration: Row  # beta's acceleration less pitch_tt and beta' theta_tt [rad/s^2]
    beta_rate: Row  # [rad/s]
    turn: Vector  # e^(i beta)
    hip: Vector  # O from the trunk's centre of mass [m]
    first_moment: Vector  # S of (E3), about O [kg m]
    moment_by_theta: Vector  # D of (E2), derivative of S with the frame fixed [kg m]
    moment_by_crank: Vector  # U of (E5), the same with the frame swinging along
    frame_inertia: Row  # c [kg m^2]
    crank_coupling: Row  # b + beta' c
    crank_inertia: Row  # I of (E5): a + 2 beta' b + beta'^2 c
    crank_pitch_coupling: Row  # L of (E5): b + beta' c + hip x moment_by_crank
    ground_moment_theta: Row  # generalised forces of the ground [N m]
    ground_moment_beta: Row
    ground_force: Vector  # [N]
    rest_moment_theta: Row  # generalised inertia forces at rest of the accelerations, weight included [N m]
    rest_moment_beta: Row
    free_theta_acceleration: Row  # w_t0 of (E8): of the crank if the trunk did not accelerate [rad/s^2]
    crank_mobility: Row  # 1 / crank_inertia, 0 if prescribed
    crank_torque: Row  # drives [N m, W]
    frame_torque: Row  # along beta
    crank_power: Row
    swing_power: Row
    inverse_damping: Annotated[Block, SPRING]  # 1 / damping of the hoof's springs [m/(N s)]
    toe: Contact
    heel: Contact
    settings: LegSettings


class PointReport(Layout):
    """Report of a hoof point, along the ground's tangent and normal."""

    x: Row  # [m]
    y: Row
    slide: Row  # [m/s]
    normal: Row  # [N]
    friction: Row


class LegReport(Layout):
    """Report of a leg. A motor turns crank and swing: its torque is `crank_torque`, `hip_torque` is
    transmitted by the gear between them, and `hip_power` is the power of the actuator that changes the
    swing's parameters."""

    crank_angle_acceleration: Row  # [rad/s^2]
    swing_angle: Row  # [rad]
    swing_angle_rate: Row  # [rad/s]
    swing_angle_acceleration: Row  # [rad/s^2]
    crank_torque: Row  # along the crank angle [N m]
    hip_torque: Row  # along the swing angle [N m]
    crank_power: Row  # of the crank's drive [W]
    hip_power: Row  # of the swing's [W]
    toe: PointReport
    heel: PointReport


class LegMemory(Layout):
    """Rows of a leg in the engine's array; the legs follow the trunk."""

    state: LegState
    strides: Strides
    sums: StrideSums
    command: Annotated[Block, GAIT]
    report: LegReport
    settings: LegSettings


class Reactions(Layout):
    """Joint forces and moments of a leg."""

    joints: Annotated[Block, JOINT_ROWS]  # force of each joint, as in `Mechanism.joints`: x and y [N]
    lock: Annotated[Block, WELDS]  # moment on the first body of each weld by the second [N m]
    driver: Row  # moment on the crank by the leg's frame [N m]
    hip: Row  # moment on the leg's frame by the trunk, about O [N m]


def reactions_layout(structure: Structure) -> type[Reactions]:
    """Return the layout of the reactions of legs with a structure."""
    joints, welds = structure.mechanism.joints, structure.mechanism.welds
    sized: type[Reactions] = Reactions.sized(joint_rows=2 * len(joints), welds=len(welds))
    return sized


# Names in records, states and infos

TRUNK_STATE = ("time", "centre_x", "centre_y", "momentum_x", "momentum_y", "pitch", "angular_momentum")
TRUNK_REPORT = ("x", "y", "vx", "vy", "ax", "ay", "pitch_rate", "pitch_acceleration")
LEG_REPORT = LegReport.names
STRIDES = Strides.names


def leg_state(features: Features = PLAIN) -> tuple[str, ...]:
    """Return the names of the rows of a `LegState`."""
    gait = parameter_names(features.harmonics)
    contact = (
        "penetration",
        "penetration_rate",
        "inverse_approach_speed",
        *("deflection_normal", "deflection_tangential")[: 2 * features.has_springs],
    )
    points = (f"{point}_{name}" for point in ("toe", "heel") for name in contact)
    return ("crank_angle", "crank_angle_rate", *gait, *(f"{name}_rate" for name in gait), *points)


def stride_sums(features: Features = PLAIN) -> tuple[str, ...]:
    """Return the names of the rows of `StrideSums`."""
    return tuple(name for name, field in features.of(StrideSums).fields.items() if field.size)


def stride_peaks(features: Features = PLAIN) -> tuple[bool, ...]:
    """Return for each row of `StrideSums` True if it is a peak."""
    return tuple(StrideSums.notes[name].is_peak for name in stride_sums(features))


def account(features: Features = PLAIN) -> tuple[str, ...]:
    """Return the names of the rows of an `Account`."""
    return (*Account.names, *("hoof_stored", "hoof_loss")[: 2 * features.has_springs])


LEG_STATE = leg_state()
ACCOUNT = account()


class EngineLayout(NamedTuple):
    """Layouts of engines with the same `Features`, and the numbers that their kernels are made for.

    Attributes:
        trunk, leg, account: layouts of rows on the stack.
        trunk_memory, leg_memory: layouts of rows in the engine's array, the trunk's first.
        constants, reactions: layouts of a leg's constants and reactions.
        trunk_rows, leg_rows: numbers of rows in the engine's array.
        trunk_state, leg_state, strides, sums: numbers of rows of these parts.
        gait: number of gait parameters of a leg.
        harmonics, has_limits, feet: as in `Features`.
        springs: number of rows of a hoof point's spring, 0 or 2.
    """

    trunk: type[TrunkRows]
    leg: type[LegRows]
    account: type[Account]
    trunk_memory: type[TrunkMemory]
    leg_memory: type[LegMemory]
    constants: type[LegConstants]
    reactions: type[Reactions]
    trunk_rows: int
    leg_rows: int
    trunk_state: int
    leg_state: int
    strides: int
    sums: int
    gait: int
    harmonics: int
    has_limits: bool
    feet: int
    springs: int


@cache
def engine_layout(features: Features = PLAIN) -> EngineLayout:
    """Return the `EngineLayout` of engines with these features."""
    trunk_memory, leg_memory = features.of(TrunkMemory), features.of(LegMemory)
    return EngineLayout(
        trunk=features.of(TrunkRows),
        leg=features.of(LegRows),
        account=features.of(Account),
        trunk_memory=trunk_memory,
        leg_memory=leg_memory,
        constants=constants_layout(features.structure),
        reactions=reactions_layout(features.structure),
        trunk_rows=trunk_memory.size,
        leg_rows=leg_memory.size,
        trunk_state=TrunkState.size,
        leg_state=features.of(LegState).size,
        strides=Strides.size,
        sums=features.of(StrideSums).size,
        gait=features.gait_size,
        harmonics=features.harmonics,
        has_limits=features.has_limits,
        feet=features.feet,
        springs=2 * features.has_springs,
    )

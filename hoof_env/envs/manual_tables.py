"""What the manual pages say of settings, reward terms, reset options and figures: unit and meaning, by name.

Defaults, limits and weights are read from the data that has them, never written here.
"""

from __future__ import annotations

from hoof_env.dynamics.integrators import INTEGRATORS
from hoof_env.dynamics.schemes import SCHEMES
from hoof_env.dynamics.trunk import ONE_LEG
from hoof_env.envs.grounds import SPACING
from hoof_env.envs.start import HIGHEST, LOWEST
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.leg.geometry import preset_names

Rows = dict[str, tuple[str, str]]


def _one_of(names: object) -> str:
    return ", ".join(f'"{name}"' for name in names)  # type: ignore[attr-defined]


SETTINGS: Rows = {
    "preset": (
        "",
        f"leg and gaits: {_one_of(preset_names())}, or [one's own](../own_leg.md): a mapping or a JSON file",
    ),
    "gait": (
        "",
        "gait that actions are offsets to and episodes start in; None for neither",
    ),
    "trunk": ("", f"{_one_of(ONE_LEG)}; a fixed one stays where it is"),
    "hip_height": (
        "m",
        f"nominal height of O, the crank centre, {LOWEST:g} to {HIGHEST:g} times the geometry's own;"
        " None for that",
    ),
    "trunk_mass": ("kg", "of the trunk that goes with this leg"),
    "trunk_share": ("-", "part of the weight of trunk and leg that the leg must bear; suspended"),
    "trunk_stiffness": ("N/m", "of the suspension's spring; suspended"),
    "trunk_damping": ("N s/m", "of the suspension's damper; suspended"),
    "trunk_drag": ("N s/m", "resistance to forward motion"),
    "stiffness": ("N/m^n", "K of the contact law (Eq. 14); None for the preset's"),
    "exponent": ("-", "n of the contact law, 1 to 3 in steps of 1/8; None for the preset's"),
    "normal_law": ("", _one_of(NORMAL_LAWS)),
    "restitution": ("-", "nominal coefficient of restitution, 0 to 1"),
    "approach_floor": ("m/s", "smallest approach speed in the damping term"),
    "friction_law": ("", _one_of(FRICTION_LAWS)),
    "friction": ("-", "mu_k"),
    "friction_slow": ("m/s", "lower threshold of the friction law"),
    "friction_fast": ("m/s", "upper threshold of the friction law"),
    "terrain": (
        "",
        'None for level ground, {"kind": "slope", "angle": rad}, {"kind": "hills", ...} as in'
        " [HorseLegTerrain](HorseLegTerrain.md#terrain), or what `Terrain.to_dict` gives",
    ),
    "drive": ("", '"prescribed": the crank follows its command; "motor": a servo that the ground can slow'),
    "motor_gain": ("N m s/rad", "torque of the motor per difference of crank speed"),
    "motor_torque": ("N m", "largest torque of the motor, at the crank"),
    "motor_inertia": ("kg m^2", "of its rotor, at the crank"),
    "solver": (
        "",
        '"exact": the closed form; "paper": Eq. 8 as the paper solves it, on a fixed trunk'
        " over level ground, with a prescribed drive and nothing drawn",
    ),
    "baumgarte_alpha": ("1/s", "alpha of the paper's solver"),
    "baumgarte_beta": ("1/s", "beta of the paper's solver; by default as printed, sqrt(2 * 15)"),
    "integrator": (
        "",
        f"{_one_of(SCHEMES)}; of the paper's solver {_one_of(INTEGRATORS)}; None for midpoint, and for the"
        " paper's Euler",
    ),
    "sim_dt": (
        "s",
        "substep; it is divided where ground, suspension or motor need shorter ones; None for the solver's"
        " own, 1e-4 or the paper's 1e-3",
    ),
    "dt": ("s", "control step, a whole multiple of `sim_dt`"),
    "episode_seconds": ("s", "time limit of an episode"),
    "target_speed": ("m/s", "lowest and highest commanded speed; None for no command"),
    "target_seconds": ("s", "shortest and longest time for which a command holds"),
    "observation": ("", "groups to observe, in this order"),
    "reward_weights": ("", "mapping of the weights that are to differ from those above"),
    "randomize": (
        "",
        "physical parameters to draw at each reset, as the reset option `parameters`; None for none",
    ),
}
"""Unit and meaning of each field of `tasks.Settings`."""

OPTIONS: Rows = {
    "gait": ("", "name of a gait of the preset, mapping of the four gait parameters, or `GaitParameters`"),
    "crank_angle": ("rad", "at the start"),
    "speed": ("m/s", "forward, at the start; 0 on a fixed trunk"),
    "height": ("m", "of O above y = 0, at the start; where a suspended trunk does not fail at once"),
    "x": ("m", "of O, at the start"),
    "parameters": (
        "",
        "mapping of physical parameters of this episode, each a number, or two to draw between",
    ),
}
"""Unit and meaning of the reset options."""

HILLS: Rows = {
    "seed": ("-", "another one, another terrain"),
    "length": ("m", "of it; the ground goes on level beyond"),
    "rise": ("m", "heights are within +- this"),
    "slope": ("-", "steepest slope"),
    "patch": ("m", f"mean length of a patch of ground; knots are {SPACING:g} m apart"),
    "stiffness": ("-", "lowest and highest factor on `stiffness`"),
    "friction": ("-", "lowest and highest factor on `friction`"),
}
"""Unit and meaning of what hills are described by."""

VECTOR: Rows = {
    "autoreset_mode": ("", "a `gymnasium.vector.AutoresetMode` or its name; also SAME_STEP and DISABLED"),
    "max_episode_steps": ("", "control steps that an episode lasts at most, besides `episode_seconds`"),
    "render_mode": ("", '"rgb_array"'),
    "rendered": (
        "",
        "how many are drawn, the first ones; None: all, of at most 16. `render` gives a frame of each"
        " environment, (H, W, 3) uint8, black where it is not drawn",
    ),
}
"""Meaning of what the vector environment takes besides."""

SUMMARY: Rows = {
    "seconds": ("s", "how long it lasted"),
    "distance_m": ("m", "forward travel"),
    "speed_m_s": ("m/s", "its mean speed"),
    "peak_grf_n": ("N", "highest resultant GRF of any substep"),
    "mean_grf_n": ("N", "mean normal force over the whole time"),
    "stance_peak_sum_n": ("N", "sum of the peaks of all stances"),
    "stances": ("-", "how many"),
    "duty_factor": ("-", "part of the time with load on the hoof"),
    "drive_work_j": ("J", "positive work of both drives"),
    "cost_of_transport": ("-", "work per weight and distance; infinite without forward progress"),
    "weight_share": ("-", "mean normal force over weight: what the leg bore"),
    "support_share": ("-", "the rest, which rail or suspension bore"),
    "failed": ("-", "0 or 1"),
}
"""Unit and meaning of the figures of an episode."""

INFO: Rows = {
    "crank_angle": ("rad", "at the start of the episode"),
    "speed": ("m/s", "forward, at its start"),
    "height": ("m", "of O above y = 0, at its start"),
    "x": ("m", "of O, at its start"),
    "gait": ("", "the gait at its start: the four gait parameters, by position or by name"),
    "parameters": ("", "those that were set or drawn for it, likewise; only where there are some"),
    "measured": ("", "what is measured now, see [below](#what-is-measured); by position or by name"),
}
"""Unit and meaning of what infos hold beside the reward's terms."""

_BOTH, _RECORD, _MEASURED = "both", "record", "measured"

QUANTITIES: dict[tuple[str, ...], tuple[str, str, str]] = {
    ("time",): (_RECORD, "s", "since the reset"),
    ("x", "y"): (_BOTH, "m", "place of O, the crank centre"),
    ("vx", "vy"): (_BOTH, "m/s", "its velocity: forward and upward speed"),
    ("ax", "ay"): (_BOTH, "m/s^2", "its acceleration"),
    ("pitch",): (_RECORD, "rad", "of the trunk; 0, for one leg cannot pitch it"),
    ("pitch_rate", "pitch_acc"): (_BOTH, "rad/s, rad/s^2", "of the trunk; 0"),
    ("centre_x", "centre_y"): (_RECORD, "m", "centre of mass of trunk and leg"),
    ("momentum_x", "momentum_y"): (_RECORD, "kg m/s", "of trunk and leg"),
    ("spin",): (_RECORD, "kg m^2/s", "angular momentum about the centre; 0 on these trunks"),
    ("result",): (_MEASURED, "-", "0, or why the step could not be simulated: it did not happen then"),
    ("theta", "theta_rate"): (_BOTH, "rad, rad/s", "crank angle, which goes on after a turn, and its rate"),
    ("theta_acc",): (_RECORD, "rad/s^2", "crank acceleration"),
    ("phi", "phi_rate", "phi_acc"): (_RECORD, "rad, rad/s, rad/s^2", "swing of the leg's frame"),
    ("crank_speed", "swing_offset", "swing_sin", "swing_cos"): (
        _BOTH, "rad/s, rad", "the gait parameters now, after the filters",
    ),
    ("crank_speed_rate", "swing_offset_rate", "swing_sin_rate", "swing_cos_rate"): (
        _BOTH, "rad/s^2, rad/s", "how they change",
    ),
    ("toe_penetration", "heel_penetration"): (_BOTH, "m", "depth in the ground; contact where above 0"),
    ("toe_rate", "heel_rate"): (_BOTH, "m/s", "its rate"),
    ("toe_slowness", "heel_slowness"): (_BOTH, "s/m", "1 / approach speed; 0 in the air"),
    ("toe_x", "toe_y", "heel_x", "heel_y"): (_RECORD, "m", "places of the hoof points"),
    ("toe_slide", "heel_slide"): (_RECORD, "m/s", "their speeds along the ground"),
    ("toe_normal", "heel_normal"): (_RECORD, "N", "ground reaction force along the ground's normal"),
    ("toe_friction", "heel_friction"): (_RECORD, "N", "and along the ground"),
    ("crank_torque", "hip_torque"): (_RECORD, "N m", "of crank and swing drive, along theta and phi"),
    ("crank_power", "hip_power"): (_RECORD, "W", "of the two drives"),
    ("stance_open",): (_MEASURED, "-", "1 in a stance, else 0"),
    ("stance_began",): (_MEASURED, "rad", "crank angle where the last stance began"),
    ("stance_peak",): (_MEASURED, "N", "highest resultant force of the stance so far"),
    ("highest",): (_MEASURED, "N", "highest resultant force of any substep of the control step"),
    ("load_impulse",): (
        _MEASURED, "N s", "normal force integrated over the control step; over `dt` its mean [N]",
    ),
    ("loaded_time",): (_MEASURED, "s", "part of the control step with load on the hoof"),
    ("stances",): (_MEASURED, "-", "stances that began in it"),
    ("peak_increase",): (_MEASURED, "N", "increase of the stances' running peaks in it"),
    ("positive_work",): (_MEASURED, "J", "of both drives in it"),
    ("travel",): (_MEASURED, "m", "load-weighted backward travel of the hoof along the ground in it"),
}  # fmt: skip
"""Where to find them, unit and meaning of what an engine tells, by its names."""

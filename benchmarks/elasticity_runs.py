"""Highest normal force on the hoof of one leg, on grounds of any restitution, as the trunk is held or moves.

The crank turns as the gait prescribes, the trunk does not pitch. The vertical motion then depends on no
horizontal force, and friction is left out: the force on the hoof is the normal force.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from benchmarks.prescribed import contact_on
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, Trunk, broken
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.ground.laws import FACTORS, MIN_RESTITUTION, REGULAR_LAWS, restitution_of_factor
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.presets import DEFAULT_PRESET
from hoof_env.tasks.settings import Settings

PAPER_LAW = "lankarani-nikravesh"
GAITS = ("walk", "run")
RESTITUTIONS = (1.0, 0.75, 0.5, 0.25, 0.0)

PAPER_FLOOR = 1e-4
"""Smallest approach speed that the paper's ground divides by [m/s]."""

RISES = tuple(np.linspace(-1e-3, 1e-3, 41).tolist())
"""Rises of the ground over which medians are taken [m]."""

DT = 1e-4
EARLY = 1e-4
"""Time before the touch-down at which a landing begins [s]."""

SETTLE = 10
TURNS = 10
STARTS = 8
"""Turns of the crank before and in a measurement of the steady gait, and its number of starts."""

LEG = load_geometry(DEFAULT_PRESET)
HEIGHT = LEG.hip_height

_DEFAULT = Settings()
SUSPENDED = Trunk(
    "suspended",
    mass=_DEFAULT.trunk_mass,
    share=_DEFAULT.trunk_share,
    stiffness=_DEFAULT.trunk_stiffness,
    damping=_DEFAULT.trunk_damping,
    drag=_DEFAULT.trunk_drag,
    height=HEIGHT,
)
"""Trunk of HorseLeg-v0."""


def softer(part: float) -> Trunk:
    """Return the suspended trunk with a part of its stiffness and damping."""
    return replace(SUSPENDED, stiffness=part * SUSPENDED.stiffness, damping=part * SUSPENDED.damping)


def balanced(mass: float) -> Trunk:
    """Return a trunk of a mass [kg] without spring and damper, whose weight a constant force bears."""
    return replace(SUSPENDED, mass=mass, share=0.0, stiffness=0.0, damping=0.0)


SETUPS = {
    "fixed": replace(SUSPENDED, kind="fixed"),
    "rail": replace(SUSPENDED, kind="rail"),
    "suspended": SUSPENDED,
    "suspended, 1/10": softer(0.1),
    "suspended, 1/100": softer(0.01),
    "free": softer(0.0),
}
"""Trunks from held to free. The last four bear the same share of the weight, by a constant force."""

STEADY = ("fixed", "rail", "suspended", "suspended, 1/10")
"""Set-ups in which the gait repeats itself from turn to turn."""

HELD = ("fixed", "rail")

MASSES = (10.0, 50.0, 100.0, 300.0, 1000.0, 10000.0)
"""Masses of balanced trunks [kg]."""


def nominal(law: str, restitution: float) -> float:
    """Return the restitution, or the smallest that the law takes."""
    return restitution if law in REGULAR_LAWS else max(restitution, MIN_RESTITUTION)


def ground_of(law: str, restitution: float, floor: float = PAPER_FLOOR) -> Ground:
    """Return the paper's ground without friction, with a law and a restitution."""
    ground = load_ground(
        DEFAULT_PRESET, normal_law=law, restitution=nominal(law, restitution), approach_floor=floor
    )
    return replace(ground, friction=0.0, reference_mass=SUSPENDED.mass + LEG.mass)


def delivered(law: str, restitution: float) -> float | None:
    """Return the restitution of a free impact under a law; None where it depends on the mass."""
    if law not in FACTORS:
        return None
    return restitution_of_factor(FACTORS[law](nominal(law, restitution)))


def free_mass(chi: float, exponent: float) -> float:
    """Return the highest force in the impact of a free mass over the highest force of an elastic impact [-],
    for any mass, speed and stiffness.

    From m v dv/dd = -K d^n (1 + chi v / v0), with u = v / v0: d^(n + 1) is proportional to
    (1 - u) / chi - ln((1 + chi) / (1 + chi u)) / chi^2 on the way in, to (1 - u^2) / 2 without damping. The
    highest force is on the way in, where damping adds to the spring.
    """
    u = np.linspace(0.0, 1.0, 20_001)
    g = (1 - u**2) / 2
    if chi > 1e-6:
        g = np.maximum((1 - u) / chi - (np.log1p(chi) - np.log1p(chi * u)) / chi**2, 0.0)
    return float(np.max((2 * g) ** (exponent / (exponent + 1)) * (1 + chi * u)))


@dataclass(frozen=True)
class Touch:
    """Start of a landing: the crank angle [rad], and how long the stance lasts from there [s]."""

    crank: float
    seconds: float


@lru_cache(maxsize=256)
def touch_down(gait: str, rise: float = 0.0) -> Touch:
    """Find where the hoof touches ground that lies higher by `rise` [m] under a held trunk."""
    held = SETUPS["fixed"]
    engine = TrunkEngine(_limb(), held, ground_of(PAPER_LAW, 1.0), sim_dt=DT, substeps=1)
    parameters = load_gait(gait, DEFAULT_PRESET)
    engine.reset(parameters, 0.0)
    contact = contact_on(gait, ground_of(PAPER_LAW, 1.0), rise)
    deep = contact.depth.max(axis=1)
    first = int(np.argmax(deep > 0.0))
    part = deep[first - 1] / (deep[first - 1] - deep[first])
    begin = contact.time[first - 1] + part * (contact.time[first] - contact.time[first - 1])
    last = int(len(deep) - np.argmax(deep[::-1] > 0.0))
    crank = _crank_at_start() + parameters.crank_speed * (begin - EARLY)
    return Touch(float(crank), float(contact.time[last] - begin + EARLY))


def _crank_at_start() -> float:
    """Return the crank angle with which the paper's cycles begin [rad]."""
    from benchmarks.prescribed import cycle_of_gait

    return float(cycle_of_gait("walk")["crank_angle"][0])


def _limb() -> Limb:
    return Limb(LEG, drive=Prescribed())


def _engine(trunk: Trunk, ground: Ground, num_envs: int = 1) -> TrunkEngine:
    with warnings.catch_warnings():
        # Grounds that return next to nothing want more substeps than are allowed
        warnings.simplefilter("ignore", StepWarning)
        return TrunkEngine(_limb(), trunk, ground, sim_dt=DT, num_envs=num_envs, strides=True)


def landing(gait: str, trunk: Trunk, ground: Ground, rise: float = 0.0) -> float:
    """Return the highest force of one landing [N].

    The leg begins where its hoof touches the ground under a held trunk, with the trunk at its height and
    without vertical speed: every set-up has the touch-down of the fixed trunk. It ends when the stance under
    the fixed trunk does.
    """
    touch = touch_down(gait, rise)
    engine = _engine(replace(trunk, height=trunk.height - rise), ground)
    engine.reset(load_gait(gait, DEFAULT_PRESET), touch.crank)
    if broken(engine.advance(steps=round(touch.seconds / DT))).any():
        return math.nan
    return float(engine.strides["highest_grf"].max())


@dataclass(frozen=True)
class Steady:
    """Steady gait: mean, lowest and highest over turns and starts of the highest force in a turn [N], and the
    mean height of the trunk above its own [m]."""

    peak: float
    lowest: float
    highest: float
    height: float


def steady(gait: str, trunk: Trunk, ground: Ground) -> Steady:
    """Return the highest forces in turns of the crank, when the gait has settled."""
    engine = _engine(trunk, ground, STARTS)
    parameters = load_gait(gait, DEFAULT_PRESET)
    engine.reset(parameters, np.linspace(0.0, 2 * np.pi, STARTS, endpoint=False)[None])
    steps = round(2 * np.pi / parameters.crank_speed / DT)
    failed = broken(engine.advance(steps=SETTLE * steps)).any()
    peaks = []
    heights = []
    for _ in range(TURNS):
        failed |= broken(engine.advance(steps=steps)).any()
        peaks.append(np.array(engine.strides["highest_grf"]).ravel())
        heights.append(np.array(engine.report["y"]).mean())
    if failed:
        return Steady(*[math.nan] * 4)
    found = np.array(peaks)
    return Steady(
        float(found.mean()), float(found.min()), float(found.max()), float(np.mean(heights) - trunk.height)
    )

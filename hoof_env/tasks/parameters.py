"""From settings to mechanics: trunk, ground, terrain and motors, the same for all episodes or drawn for
each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hoof_env.dynamics.parts import Drive, HoofSpring, Motor, Prescribed
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import preset_error_type, preset_label, read_preset
from hoof_env.tasks.effects import check_effect
from hoof_env.tasks.settings import PER_EPISODE, SOLVERS, Settings

MOST_SUBSTEPS = 100_000  # of a control step


def resolved(settings: Settings) -> Settings:
    """The settings with values for None: the ground of the preset, the solver's own scheme and step."""
    is_paper = check_choice("solver", settings.solver, SOLVERS) == "paper"
    s: Any = settings
    if s.stiffness is None or s.exponent is None:
        if "ground" not in read_preset(s.preset):
            raise preset_error_type(s.preset)(
                f"{preset_label(s.preset)}: expected an entry 'ground' with the stiffness and the exponent"
                " that its gaits are for, {} for those of hoof_env.Ground, or both as arguments; got"
                f" stiffness={s.stiffness!r}, exponent={s.exponent!r}"
            )
        ground = load_ground(s.preset, stiffness=s.stiffness, exponent=s.exponent)
        s = replace(s, stiffness=ground.stiffness, exponent=ground.exponent)
    if s.integrator is None:
        s = replace(s, integrator="euler" if is_paper else "midpoint")
    if s.sim_dt is None:
        s = replace(s, sim_dt=1e-3 if is_paper else 1e-4)
    done: Settings = s
    return done


def check_range(
    name: str, value: Any, low: float, high: float = 1e6, *, or_one: bool = True
) -> tuple[float, float]:
    """A range from `low` to `high`, with `or_one` also one number as one; ParameterError of anything else."""
    if or_one and not isinstance(value, (list, tuple)):
        value = value, value
    try:
        first, last = value
    except (TypeError, ValueError):
        raise ParameterError(f"{name}: expected two numbers, got {value!r}") from None
    first = check_number(f"{name}[0]", first, low=low, high=high)
    return first, check_number(f"{name}[1]", last, low=first, high=high)


def substeps_of(dt: float, sim_dt: float) -> int:
    """How many substeps [s] make a control step [s]; ParameterError if no whole number does, or too many."""
    check_number("sim_dt", sim_dt, low=0, exclusive_low=True)
    check_number("dt", dt, low=0, exclusive_low=True)
    ratio = dt / sim_dt
    if not 0.5 < ratio <= MOST_SUBSTEPS or abs(ratio - round(ratio)) > 1e-6:
        raise ParameterError(
            f"dt: expected a whole multiple of sim_dt = {sim_dt:g} s, got {dt:g} s "
            f"(ratio {ratio:g}; at most {MOST_SUBSTEPS})"
        )
    return round(ratio)


def ground_of(s: Any, mass: float) -> Ground:
    """The ground of some `resolved` settings, under a trunk of so much mass [kg]."""
    return Ground(
        s.stiffness, s.exponent, s.normal_law, s.restitution, s.approach_floor,
        "sampled" if s.solver == "paper" else "interpolated",
        s.friction_law, s.friction, s.friction_slow, s.friction_fast, mass,
    )  # fmt: skip


def drive_of(s: Settings) -> Drive:
    """What turns the cranks."""
    if s.drive == "prescribed":
        return Prescribed()
    return Motor(s.motor_gain, s.motor_torque, s.motor_inertia, 1.0)


def hoof_spring(settings: Settings) -> HoofSpring | None:
    """The spring at toe and heel each; without a damping, with a tenth of the critical one under the trunk of
    the settings, whatever a reset draws."""
    stiffness = settings.hoof_stiffness
    damping = settings.hoof_damping
    if stiffness is None:
        if damping is not None:
            raise ParameterError(f"hoof_damping: expected a hoof_stiffness beside it, got {damping!r}")
        return None
    check_number("hoof_stiffness", stiffness, low=0, exclusive_low=True)
    if damping is None:
        return HoofSpring.with_ratio(stiffness, settings.trunk_mass)
    check_number("hoof_damping", damping, low=0, exclusive_low=True)
    return HoofSpring(stiffness, damping)


def check_parameters(name: str, given: Any, settings: Settings) -> dict[str, float | tuple[float, float]]:
    """Physical parameters of an episode, a number each or two to draw between; `ParameterError` where one
    cannot change, has no effect beside the settings, or is none."""
    if not isinstance(given, Mapping) or not set(given) <= set(PER_EPISODE):
        raise ParameterError(
            f"{name}: expected a mapping with some of {', '.join(PER_EPISODE)}, got {given!r}"
        )
    for key in given:
        check_effect(key, settings, name)
    checked: dict[str, float | tuple[float, float]] = {}
    for key, value in given.items():
        if isinstance(value, (list, tuple)):
            if len(value) != 2:
                raise ParameterError(f"{name}[{key!r}]: expected a number or two, got {value!r}")
            low, high = (check_number(f"{name}[{key!r}][{k}]", v) for k, v in enumerate(value))
            if low > high:
                raise ParameterError(f"{name}[{key!r}]: expected the lower one first, got {value!r}")
            checked[key] = low, high
        else:
            checked[key] = check_number(f"{name}[{key!r}]", value)
    return checked


def extremes(given: Mapping[str, float | tuple[float, float]]) -> list[dict[str, float]]:
    """Corners of what can be drawn: all lowest, all highest, closest friction thresholds, and what asks for
    the shortest steps under a light and a heavy trunk."""
    pairs = {name: value if isinstance(value, tuple) else (value, value) for name, value in given.items()}
    low, high = ({name: ends[k] for name, ends in pairs.items()} for k in (0, 1))

    def mixed(base: dict[str, float], other: dict[str, float], *names: str) -> dict[str, float]:
        return base | {name: other[name] for name in names if name in other}

    close = mixed(low, high, "friction_slow")
    hard = mixed(high, low, "restitution", "approach_floor", "trunk_mass")
    corners = (low, high, close, hard, mixed(hard, high, "trunk_mass"))
    return [corner for k, corner in enumerate(corners) if corner not in corners[:k]]


def draw_parameters(
    given: Mapping[str, float | tuple[float, float]], generator: np.random.Generator
) -> dict[str, float]:
    """A value for each parameter."""
    return {
        name: float(generator.uniform(*value)) if isinstance(value, tuple) else value
        for name, value in given.items()
    }


STRETCH = 10.0
DRIFT = 0.03
HIGHEST_HILLS = 0.2
"""Over so long a stretch of ground [m] its mean height must stay within so large a part of the hip height of
y = 0 where the trunk does not follow the ground. The springs of `HorseLeg-v0` take 1.1 times the weight off
the leg, or put it on, at that height. Hills rise and fall about y = 0, so they may be so much higher."""

HELD = ("suspended", "rail")
"""Trunks that move along and keep their height in the world."""


def check_drift(terrain: Terrain, description: Any, trunk: str, hip_height: float) -> None:
    """Raise `ParameterError` where a trunk that keeps its height would leave the ground, or press on it."""
    if trunk not in HELD or terrain == Terrain.flat():
        return
    remedy = (
        f"under a {trunk} trunk, which keeps its height in the world: the leg would climb into a wall or lose"
        " the ground; slopes are for hoof_env/Horse-v0, whose trunk follows them"
    )
    if isinstance(description, Mapping) and description.get("kind") == "hills":
        rise = float({**HILLS, **description}["rise"])
        most = HIGHEST_HILLS * hip_height
        if rise > most:
            raise ParameterError(f"terrain['rise']: expected at most {most:.3g} m {remedy}; got {rise:.3g} m")
        return
    where, mean = farthest_mean(terrain, STRETCH)
    if abs(mean) > (most := DRIFT * hip_height):
        raise ParameterError(
            f"terrain: expected ground whose mean height over {STRETCH:g} m stays within {most:.3g} m of 0"
            f" {remedy}; got a mean of {mean:.3g} m around x = {where:.4g} m"
        )


def farthest_mean(terrain: Terrain, stretch: float) -> tuple[float, float]:
    """The mean height over a stretch [m] of the ground that is farthest from 0 [m], of those that begin, end
    or have their middle at a knot or between two, and where the middle is [m]."""
    x = terrain.x
    height = np.array(terrain.height)
    areas = np.concatenate([[0.0], np.cumsum((height[1:] + height[:-1]) / 2 * terrain.spacing)])

    def area_to(to: Any) -> Any:
        """Integral of the height from the first knot on."""
        inside = np.clip(to, x[0], x[-1])
        k = np.minimum(((inside - x[0]) / terrain.spacing).astype(int), len(x) - 1)
        level = np.minimum(to - x[0], 0.0) * height[0] + np.maximum(to - x[-1], 0.0) * height[-1]
        return areas[k] + (height[k] + terrain.height_at(inside)) / 2 * (inside - x[k]) + level

    middles = np.concatenate([x, x[0] + terrain.spacing * np.arange(0.5, len(x) - 1)])
    middles = np.concatenate([middles, middles - stretch / 2, middles + stretch / 2])
    means = (area_to(middles + stretch / 2) - area_to(middles - stretch / 2)) / stretch
    farthest = int(np.argmax(np.abs(means)))
    return float(middles[farthest]), float(means[farthest])


KINDS = ("hills", "slope")
SPACING = 0.1  # between knots of hills [m]

HILLS: dict[str, Any] = {
    "seed": 0, "length": 400.0, "rise": 0.15, "slope": 0.15, "patch": 2.0,
    "stiffness": (0.25, 4.0), "friction": (0.5, 1.5),
}  # fmt: skip
"""What `hills` takes: seed; length [m]; heights are within +-rise [m]; steepest slope [-]; mean length of a
patch [m]; ranges of the factors of stiffness and friction."""


def make_terrain(description: Any) -> Terrain:
    """A terrain from None (level), {"kind": "hills", ...}, {"kind": "slope", "angle": rad} or what
    `Terrain.to_dict` gives; `ParameterError` from anything else.

    Hills go straight from one random height to the next, each at a slope of its own, over patches of random
    stiffness and friction; the same for the same seed. They begin at x = 0. The rest of the animal, which a
    suspended trunk hangs from, does not follow them: they are low.
    """
    if description is None:
        return Terrain.flat()
    if not isinstance(description, Mapping):
        raise ParameterError(f"terrain: expected None or a mapping, got {description!r}")
    if "kind" not in description:
        return Terrain.from_dict(description)
    rest = dict(description)
    kind = check_choice("terrain['kind']", rest.pop("kind"), KINDS)
    known = {"angle": 0.0} if kind == "slope" else HILLS
    if unknown := set(rest) - set(known):
        raise ParameterError(
            f"terrain: {kind} has no {', '.join(sorted(unknown))}; expected some of {', '.join(known)}"
        )
    if kind == "slope":
        return Terrain.slope(rest.get("angle", 0.0))
    return _hills({**HILLS, **rest})


def _hills(given: dict[str, Any]) -> Terrain:
    seed = int(check_number("terrain['seed']", given["seed"], low=0, high=2**32))
    length = check_number("terrain['length']", given["length"], low=10.0, high=1e5)
    rise = check_number("terrain['rise']", given["rise"], low=0.0, high=10.0)
    steepest = check_number("terrain['slope']", given["slope"], low=1e-3, high=1.0)
    patch = check_number("terrain['patch']", given["patch"], low=0.2, high=1e3)
    generator = np.random.default_rng(seed)
    knots = round(length / SPACING) + 1

    height = 0.0
    row = np.zeros(knots)
    k = 1
    while k < knots:
        there = generator.uniform(-rise, rise)
        slope = generator.uniform(0.2, 1.0) * steepest
        many = max(round(abs(there - height) / slope / SPACING), 1)
        row[k : k + many] = np.linspace(height, there, many + 1)[1:][: knots - k]
        height = there
        k = k + many
    factors = {}
    for name in ("stiffness", "friction"):
        low, high = np.log(check_range(f"terrain[{name!r}]", given[name], 1e-3, 1e3, or_one=False))
        factor = np.empty(knots)
        k = 0
        while k < knots:
            many = max(round(generator.exponential(patch) / SPACING), 5)
            factor[k : k + many] = np.exp(generator.uniform(low, high))
            k += many
        factors[name] = tuple(factor.tolist())
    return Terrain(tuple(row.tolist()), factors["stiffness"], factors["friction"], 0.0, SPACING)

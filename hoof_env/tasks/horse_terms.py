"""Entries of the observation and terms of the reward of `Horse-v0`; `observation` and `reward` have the
entries and terms of one leg."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from hoof_env.dynamics.layout import LegMemory
from hoof_env.gait import PARAMETERS, WIDEST
from hoof_env.ground.terrain import surface
from hoof_env.simd import Lanes, Number, absolute, block_at, maximum, minimum, where
from hoof_env.simd.math import cos_sin
from hoof_env.tasks.horse_gaits import LEGS, offset_name
from hoof_env.tasks.observation import (
    CONTEXT_ENTRIES,
    LOAD,
    PLAIN,
    PRESSURE,
    TRUE_RATE,
    TRUTH,
    Entry,
    ObservationInputs,
    Scale,
    centre_of_pressure,
    heel_contact,
    heel_load,
    tanh_of,
    toe_contact,
    toe_load,
)
from hoof_env.tasks.reward import Outcome, Term

# The observation

IN_WEIGHTS = Scale("tanh(x / weight)", lambda x, scene: x / scene.episode.weight, True)
"""Scale of forces, in units of the horse's weight."""


IN_LOADS = Scale("tanh(2 x / weight)", lambda x, scene: 2.0 * x / scene.episode.weight, True)
"""Scale of the load of a whole hoof."""


def _height(scene: ObservationInputs) -> Lanes:
    """Measure the height of the trunk above the ground below it [m]."""
    place = scene.trunk.report.place
    return place.imag - surface(place.real, scene.ground, scene.ground_origin, scene.ground_per_metre)[0]


def _from_hips(x: Lanes, scene: ObservationInputs) -> Lanes:
    """Scale a height, relative to the height of the hips."""
    # Relative to the hip height, so that horses of all sizes are seen alike.
    return (x - scene.task.height) / (0.2 * scene.task.height)


def _in_bounds(k: int) -> Scale:
    """Return the scale of the k-th gait parameter, linear between its widest limits."""
    low, high = list(WIDEST.values())[k]
    middle = (low + high) / 2
    per = 2 / (high - low)
    return Scale(f"linear, -1 at {low:g} and 1 at {high:g}", lambda x, scene: (x - middle) * per)


def _of_leg(i: int, measure: Callable[[Any, Any], Any]) -> Callable[[Any], Any]:
    """Return a function of a scene that measures its i-th leg."""
    return lambda scene: measure(block_at(scene.leg, i), scene)


def _sine(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    return cos_sin(leg.state.crank_angle)[1]


def _cosine(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    return cos_sin(leg.state.crank_angle)[0]


def _filter(k: int) -> Callable[[Any, Any], Any]:
    """Return a function that measures the k-th gait parameter of a leg, after its filter."""
    return lambda leg, scene: leg.state.gait[k]


def _filter_rate(k: int) -> Callable[[Any, Any], Any]:
    """Return a function that measures the rate of the k-th gait parameter of a leg."""
    return lambda leg, scene: leg.state.gait_rate[k]


def _offset(k: int) -> Callable[[Any], Any]:
    """Return a function that measures the k-th offset of the actions, of all legs."""
    return lambda scene: scene.episode.offset[k]


def _speed_error(scene: ObservationInputs) -> Lanes:
    """Measure the speed beyond the commanded one [m/s]."""
    return scene.trunk.report.velocity.real - scene.episode.target


def _load(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    """Measure the normal force on a hoof [N], as sensors read it."""
    return toe_load(leg, scene) + heel_load(leg, scene)


# Name, group, unit, function of a leg's memory and the scene, scale. A table, one entry a line.
_PER_LEG: tuple[tuple[str, str, str, Callable[[Any, Any], Any], Scale], ...] = (
    ("sin(crank angle)", "crank", "-", _sine, PLAIN),
    ("cos(crank angle)", "crank", "-", _cosine, PLAIN),
    (TRUE_RATE, "crank", "rad/s", lambda leg, scene: leg.state.crank_angle_rate, tanh_of(10.0)),
    ("crank speed", "gait", "rad/s", _filter(0), tanh_of(10.0)),
    ("swing offset", "gait", "rad", _filter(1), _in_bounds(1)),
    ("swing sine coefficient", "gait", "rad", _filter(2), _in_bounds(2)),
    ("swing cosine coefficient", "gait", "rad", _filter(3), _in_bounds(3)),
    ("rate of crank speed", "rates", "rad/s^2", _filter_rate(0), tanh_of(50.0)),
    ("rate of swing offset", "rates", "rad/s", _filter_rate(1), tanh_of(10.0)),
    ("rate of swing sine coefficient", "rates", "rad/s", _filter_rate(2), tanh_of(10.0)),
    ("rate of swing cosine coefficient", "rates", "rad/s", _filter_rate(3), tanh_of(10.0)),
    ("toe contact", "hoof", "-", toe_contact, TRUTH),
    ("heel contact", "hoof", "-", heel_contact, TRUTH),
    ("toe load", "hoof", "N", toe_load, IN_WEIGHTS),
    ("heel load", "hoof", "N", heel_load, IN_WEIGHTS),
    ("running peak force", "hoof", "N", lambda leg, scene: leg.strides.running_peak, IN_WEIGHTS),
)

OFFSETS = tuple(offset_name(leg, name) for leg in LEGS for name in PARAMETERS)
"""Names of the offsets, in the order of the actions."""

HORSE_ENTRIES = (
    Entry("forward speed", "trunk", "m/s", lambda s: s.trunk.report.velocity.real, tanh_of(5.0)),
    Entry("vertical speed", "trunk", "m/s", lambda s: s.trunk.report.velocity.imag, tanh_of(1.0)),
    Entry(
        "height above the ground",
        "trunk",
        "m",
        _height,
        Scale("tanh((x - hip height) / (0.2 hip height))", _from_hips, True),
    ),
    Entry("pitch", "trunk", "rad", lambda s: s.trunk.state.moving.pitch, tanh_of(0.3)),
    Entry("pitch rate", "trunk", "rad/s", lambda s: s.trunk.report.pitch_rate, tanh_of(2.0)),
    Entry("commanded speed", "target", "m/s", lambda s: s.episode.target, tanh_of(5.0)),
    *(
        Entry(f"{leg.replace('_', ' ')}: {name}", group, unit, _of_leg(i, measure), scale)
        for name, group, unit, measure, scale in _PER_LEG
        for i, leg in enumerate(LEGS)
    ),
    *(Entry(name, "offset", "-", _offset(k), PLAIN) for k, name in enumerate(OFFSETS)),
    *(
        Entry(
            f"{leg.replace('_', ' ')}: centre of pressure",
            PRESSURE,
            "-",
            _of_leg(i, centre_of_pressure),
            PLAIN,
        )
        for i, leg in enumerate(LEGS)
    ),
    *CONTEXT_ENTRIES,
    *(
        Entry(f"{leg.replace('_', ' ')}: load", LOAD, "N", _of_leg(i, _load), IN_LOADS)
        for i, leg in enumerate(LEGS)
    ),
)
"""Entries that can be observed of a horse; for each quantity, legs in the order of `LEGS`."""


def _of_speed(scale: float) -> Scale:
    """Return the scale of a speed, tanh(x / scale) for a horse of size 1 [m/s]."""
    per = 1 / scale
    return Scale(
        f"tanh(x / ({scale:g} sqrt(size)))", lambda x, scene: x * (per / scene.task.speed_scale), True
    )


FINE: Mapping[str, Scale] = MappingProxyType(
    {
        "vertical speed": _of_speed(0.3),
        "height above the ground": Scale(
            "tanh((x - 0.83 hip height) / (0.04 hip height))",
            lambda x, scene: (x - 0.83 * scene.task.height) / (0.04 * scene.task.height),
            True,
        ),
        "pitch": tanh_of(0.06),
        "pitch rate": Scale(
            "tanh(x sqrt(size) / 0.4)", lambda x, scene: x * (1 / 0.4) * scene.task.speed_scale, True
        ),
        "commanded speed": Scale(
            "tanh((x / sqrt(size) - 2.4) / 0.7)",
            lambda x, scene: (x / scene.task.speed_scale - 2.4) * (1 / 0.7),
            True,
        ),
        **dict.fromkeys(OFFSETS, Scale("tanh(3 x)", lambda x, scene: 3.0 * x, True)),
    }
)
"""Scales of `HorseRough-v0`, by entry. With those of `Horse-v0` a disturbance changes the entries of the
trunk by much less than a stride changes the sine of the crank angle, and learners follow larger entries."""

ROUGH_ENTRIES = tuple(
    # In place of the speed, the error of the speed: their difference is what a learner would have to find
    Entry("speed error", "trunk", "m/s", _speed_error, _of_speed(0.3))
    if entry.name == "forward speed"
    else replace(entry, scale=FINE.get(entry.name, entry.scale))
    for entry in HORSE_ENTRIES
)
"""Entries that can be observed on `HorseRough-v0`."""

# The reward


def alive(step: Outcome, weight: Number) -> Lanes:
    """Return the reward for the time in which the horse has not fallen."""
    return weight * step.seconds


def tracking(step: Outcome, weight: Number) -> Lanes:
    """Return the reward for speed: 1 at the commanded speed, less twice the relative error, at least -1."""
    # Twice the error: with a smaller factor, a policy gains by sliding less and lagging the command.
    asked = maximum(step.commanded_progress, 1e-9)
    error = absolute(step.progress - asked) / asked
    return where(step.seconds > 0.0, weight * step.seconds * maximum(1.0 - 2.0 * error, -1.0), 0.0)


def peak(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for the increase of the running peak GRF, in units of the horse's weight."""
    return -weight * step.sums.running_peak_increase / step.weight


def slip(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for sliding, relative to the commanded distance and at most 1, times the duration."""
    asked = maximum(step.commanded_progress, 1e-9)
    return -weight * step.seconds * minimum(step.sums.slip / asked, 1.0)


def landing(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for each stance that begins."""
    return -weight * step.sums.stances


def work(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for positive work divided by weight and commanded distance, times the duration."""
    asked = maximum(step.commanded_progress, 1e-9)
    return -weight * step.seconds * step.sums.positive_work / (step.weight * asked)


def pitch(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for the square of the trunk's pitch, times the duration."""
    angle = step.trunk.state.moving.pitch
    return -weight * step.seconds * (angle * angle)


def fall(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for a failure, in the step that ends the episode."""
    return where(step.failed > 0.0, -weight, 0.0)


HORSE_TERMS = (
    Term("alive", 45.0, "1/s", "per second", alive),
    Term(
        "tracking",
        16.0,
        "1/s",
        "per second, 1 less twice the relative error of the speed, at least -1",
        tracking,
    ),
    Term(
        "peak",
        0.25,
        "-",
        "minus the increase of each leg's running peak GRF divided by the weight: the highest so far, at most"
        " twice the present one",
        peak,
    ),
    Term(
        "slip",
        35.0,
        "1/s",
        "minus the distance that all hooves slide in stance, divided by the commanded distance; at most 1",
        slip,
    ),
    Term("landing", 0.25, "-", "minus the number of stances that begin", landing),
    Term(
        "work",
        0.4,
        "1/s",
        "minus the positive work of all drives divided by weight and commanded distance",
        work,
    ),
    Term("pitch", 3.0, "1/(s rad^2)", "minus the square of the trunk's pitch", pitch),
    Term("fall", 15.0, "-", "once, when the episode fails", fall),
)
"""Terms of the reward of `Horse-v0`, in the order in which they are added."""

ROUGH_WEIGHTS: Mapping[str, float] = MappingProxyType(
    {
        "alive": 0.9,
        "tracking": 1.28,
        "peak": 0.005,
        "slip": 0.7,
        "landing": 0.005,
        "work": 0.008,
        "pitch": 0.06,
        "fall": 2.0,
    }
)
"""Weights of `HorseRough-v0`: a fiftieth of the ones above, but `tracking` four times and `fall` nearly seven
times as much. With the ratios of `Horse-v0`, agents trade falls and the commanded speed for smoother gaits.
Stock PPO limits the norm of all gradients together: values of hundreds leave little of the policy's part."""

"""Observation of one leg: a table of entries, numbers in [-1, 1], in groups that can be chosen. A new entry
is a row of the table and needs no other change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hoof_env.errors import ParameterError, brief
from hoof_env.gait import LIMITS, FilterSettings
from hoof_env.ground.terrain import surface
from hoof_env.simd import Lanes, Number, where
from hoof_env.simd.math import cos_sin
from hoof_env.simd.user_functions import check_function, inputs
from hoof_env.tasks.user_parts import Constant, check_arguments, check_parts

if TYPE_CHECKING:
    from hoof_env.dynamics.layout import ContactMemory, LegMemory, TrunkMemory
    from hoof_env.tasks.episode import Episode

LOW, HIGH = (np.array([limit[i] for limit in LIMITS.values()]) for i in (0, 1))
MIDDLE = (LOW + HIGH) / 2
HALF_RANGE = (HIGH - LOW) / 2
"""Limits, middle and half range of the gait parameters of the published leg, shape (4,)."""

AHEAD = (0.25, 0.5, 0.75, 1.0)  # places at which the height of the ground is observed, forward of O [m]


@inputs
class ObservationInputs(NamedTuple):
    """Arguments of the entries' functions.

    Attributes:
        trunk, leg, episode: memory of engine and episode, with fields as in `dynamics.layout.TrunkMemory`,
            `LegMemory` and `episode.Episode`; `block_at(leg, i)` is a horse's i-th leg.
        task: record of the task's constants; see `episode.task_type`.
        ground, ground_origin, ground_per_metre: terrain, the arguments of `surface` after x.
    """

    trunk: TrunkMemory
    leg: LegMemory
    episode: Episode
    task: Any
    ground: Any
    ground_origin: Number
    ground_per_metre: Number


@dataclass(frozen=True)
class Scale:
    """Scaling of a measured number to [-1, 1]; the result is clipped.

    Attributes:
        text: formula, for the manual page and for files of policies, which are refused under another one.
        apply: function of the number and the `ObservationInputs`; None for the identity.
        saturates: True if the hyperbolic tangent of the result is taken.

    Raises:
        ParameterError: `apply` is not a function of two arguments.
    """

    text: str
    apply: Callable[[Any, Any], Any] | None = None
    saturates: bool = False

    def __post_init__(self) -> None:
        if self.apply is not None:
            check_function(f"scale {self.text!r}: apply", self.apply, 2)


@dataclass(frozen=True)
class Entry:
    """Entry of the observation.

    Attributes:
        name: name of the quantity.
        group: group by which the setting `observation` chooses it.
        unit: unit of the number before it is scaled.
        measure: function of `ObservationInputs` that returns the number; see `reward.Term.compute`.
        scale: scaling of the number.
        constants: further arguments of `measure`, which the setting `constants` changes.

    Raises:
        ParameterError: a name or group is missing, `measure` is not a function of one argument, or `scale` is
            not a `Scale`.
    """

    name: str
    group: str
    unit: str
    measure: Callable[..., Any]
    scale: Scale
    constants: Sequence[Constant] = ()

    def __post_init__(self) -> None:
        for text in (self.name, self.group):
            if not isinstance(text, str) or not text:
                raise ParameterError(f"name and group: expected a string, got {brief(text)}")
        constants = check_parts(f"{self.title}: constants", Constant, self.constants)
        object.__setattr__(self, "constants", constants)
        check_arguments(f"{self.title}: measure", self.measure, 1, constants)
        if not isinstance(self.scale, Scale):
            raise ParameterError(f"{self.title}: scale: expected a hoof_env.Scale, got {brief(self.scale)}")

    @property
    def title(self) -> str:
        """Name of the entry in messages."""
        return f"entry {self.name!r}"


def tanh_of(scale: float, text: str = "") -> Scale:
    """Return the scale tanh(x / scale); `text` replaces the formula on the manual page."""
    # A factor: a multiplication is several times faster than a division.
    per = 1 / scale
    return Scale(text or f"tanh(x / {scale:g})", lambda x, scene: x * per, True)


PLAIN = Scale("none")
TRUTH = Scale("0 or 1")
IN_WEIGHTS = Scale("tanh(x / 3 weights)", lambda x, scene: x / (3.0 * scene.episode.weight), True)
RISE = Scale("tanh(x / (30 weights / s))", lambda x, scene: x / (30.0 * scene.episode.weight), True)


def _height(x: Lanes, scene: ObservationInputs) -> Lanes:
    """Scale a height: relative to the nominal one, in units of 0.3 m."""
    return (x - scene.task.height) * (1 / 0.3)


def _in_range(k: int) -> Scale:
    """Return the scale of the k-th gait parameter, linear between its limits."""

    def apply(x: Lanes, scene: ObservationInputs) -> Lanes:
        return (x - scene.task.middle[k]) / scene.task.half[k]

    return Scale(range_text(LOW[k], HIGH[k]), apply)


def _in_rate(k: int) -> Scale:
    """Return the scale of the rate of the k-th gait parameter, divided by its bound."""

    def apply(x: Lanes, scene: ObservationInputs) -> Lanes:
        return x / scene.task.rate_bound[k]

    return Scale(rate_text(FilterSettings().to_array()[k, 1]), apply)


def range_text(low: float, high: float) -> str:
    """Return the formula of a scale between limits, for the manual page."""
    return f"linear, -1 at {low:.8g} and 1 at {high:.8g}"


def rate_text(bound: float) -> str:
    """Return the formula of the scale of a rate with a bound, for the manual page."""
    return f"/ {bound:.6g}"


def _gait(k: int) -> Callable[[Any], Any]:
    """Return a function that measures the k-th gait parameter, after its filter."""
    return lambda scene: scene.leg.state.gait[k]


def _gait_rate(k: int) -> Callable[[Any], Any]:
    """Return a function that measures the rate of the k-th gait parameter."""
    return lambda scene: scene.leg.state.gait_rate[k]


def _sine(scene: ObservationInputs) -> Lanes:
    return cos_sin(scene.leg.state.crank_angle)[1]


def _cosine(scene: ObservationInputs) -> Lanes:
    return cos_sin(scene.leg.state.crank_angle)[0]


def in_contact(memory: ContactMemory) -> Lanes:
    """Return 1 if a hoof point is inside the ground, else 0."""
    return where(memory.penetration > 0.0, 1.0, 0.0)


def felt(load: Lanes, x: Lanes, scene: ObservationInputs) -> Lanes:
    """Return what a sensor with a threshold reads of a number x: 0 where its load [N] is below the threshold,
    else the number."""
    # Not the other way round: without a threshold a number that is not finite stays one.
    return where(load < scene.task.force_threshold, 0.0, x)


def centre_of_pressure(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    """Return where the load acts on the hoof: 1 at the toe, -1 at the heel, 0 without load."""
    toe, heel = leg.report.toe.normal, leg.report.heel.normal
    load = toe + heel
    # The inner `where` avoids a division by 0 in the air.
    return felt(load, where(load > 0.0, (toe - heel) / where(load > 0.0, load, 1.0), 0.0), scene)


def toe_load(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    """Return the normal force on the toe [N], as a sensor reads it."""
    return felt(leg.report.toe.normal, leg.report.toe.normal, scene)


def heel_load(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    """Return the normal force on the heel [N], as a sensor reads it."""
    return felt(leg.report.heel.normal, leg.report.heel.normal, scene)


def toe_contact(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    """Return 1 if the toe is inside the ground, and a sensor reads its load; else 0."""
    return felt(leg.report.toe.normal, in_contact(leg.state.toe), scene)


def heel_contact(leg: LegMemory, scene: ObservationInputs) -> Lanes:
    """Return 1 if the heel is inside the ground, and a sensor reads its load; else 0."""
    return felt(leg.report.heel.normal, in_contact(leg.state.heel), scene)


def _approach_speed(memory: ContactMemory) -> Lanes:
    """Return the approach speed of a hoof point in contact [m/s], else 0."""
    inverse = memory.inverse_approach_speed
    # The inner `where` avoids a division by 0 in lanes out of contact.
    return where(inverse > 0.0, 1.0 / where(inverse > 0.0, inverse, 1.0), 0.0)


def _ahead(distance: float) -> Callable[[Any], Any]:
    """Return a function that measures the height of the ground at a distance ahead of O [m]."""

    # Relative to the ground under O: after hundreds of metres a height in the world is meaningless.
    def rise(scene: ObservationInputs) -> Lanes:
        x = scene.trunk.report.place.real
        here = surface(x, scene.ground, scene.ground_origin, scene.ground_per_metre)[0]
        return surface(x + distance, scene.ground, scene.ground_origin, scene.ground_per_metre)[0] - here

    return rise


TRUE_RATE = "true rate of the crank"
"""End of the names of entries that are observed only with a motor: without one it is the commanded rate."""

PRESSURE = "pressure"
"""Group of the centre of pressure."""

CONTEXT = "context"
"""Group of the physical parameters that contexts vary."""

LOAD = "load"
"""Group of the force on a whole hoof."""

LATE = (PRESSURE, CONTEXT, LOAD)
"""Groups whose entries have the last slots, behind the slots of users' own entries: the noise of an entry
follows from its slot, and these groups were added later."""

_PARAMETERS = ("crank speed", "swing offset", "swing sine coefficient", "swing cosine coefficient")
_UNITS = ("rad/s", "rad", "rad", "rad")
IN_RANGE = tuple(map(_in_range, range(4)))
IN_RATE = tuple(map(_in_rate, range(4)))
"""Scales of the gait parameters and their rates. They use the limits and bounds of the leg; their texts show
the limits and bounds of the published leg; see `envs.manual_bodies.LegTables.scaling`."""


def _beside(usual: str) -> Scale:
    """Return the scale of a positive number by its usual value, a field of the task's record: 0 there, and
    odd in the logarithm of their ratio."""

    def apply(x: Lanes, scene: ObservationInputs) -> Lanes:
        return (x - getattr(scene.task, usual)) / (x + getattr(scene.task, usual))

    return Scale("(x - usual) / (x + usual)", apply)


def _share(scene: ObservationInputs) -> Lanes:
    """Measure the part of the weight that the leg must bear; what supports the rest is 0 on a rail."""
    return 1.0 - scene.trunk.settings.support / scene.episode.weight


CONTEXT_ENTRIES = (
    Entry(
        "stiffness of the ground",
        CONTEXT,
        "N/m^n",
        lambda s: s.trunk.settings.stiffness,
        _beside("usual_stiffness"),
    ),
    Entry("friction", CONTEXT, "-", lambda s: s.trunk.settings.friction, _beside("usual_friction")),
    Entry("weight", CONTEXT, "N", lambda s: s.episode.weight, _beside("usual_weight")),
)
"""Entries of contexts that any body has."""

ENTRIES = (
    Entry("sin(crank angle)", "crank", "-", _sine, PLAIN),
    Entry("cos(crank angle)", "crank", "-", _cosine, PLAIN),
    Entry(TRUE_RATE, "crank", "rad/s", lambda s: s.leg.state.crank_angle_rate, IN_RANGE[0]),
    *(Entry(name, "gait", _UNITS[k], _gait(k), IN_RANGE[k]) for k, name in enumerate(_PARAMETERS)),
    *(
        Entry(f"rate of {name}", "gait", "rad/s^2" if k == 0 else "rad/s", _gait_rate(k), IN_RATE[k])
        for k, name in enumerate(_PARAMETERS)
    ),
    Entry("forward speed", "trunk", "m/s", lambda s: s.trunk.report.velocity.real, tanh_of(5.0)),
    Entry("vertical speed", "trunk", "m/s", lambda s: s.trunk.report.velocity.imag, tanh_of(2.0)),
    Entry(
        "height",
        "trunk",
        "m",
        lambda s: s.trunk.report.place.imag,
        Scale("tanh((x - hip height) / 0.3)", _height, True),
    ),
    Entry("bearing allowance", "trunk", "s", lambda s: s.episode.allowance, PLAIN),
    Entry("toe contact", "hoof", "-", lambda s: toe_contact(s.leg, s), TRUTH),
    Entry("heel contact", "hoof", "-", lambda s: heel_contact(s.leg, s), TRUTH),
    Entry("toe load", "hoof", "N", lambda s: toe_load(s.leg, s), IN_WEIGHTS),
    Entry("heel load", "hoof", "N", lambda s: heel_load(s.leg, s), IN_WEIGHTS),
    Entry("toe approach speed", "hoof", "m/s", lambda s: _approach_speed(s.leg.state.toe), tanh_of(2.0)),
    Entry("heel approach speed", "hoof", "m/s", lambda s: _approach_speed(s.leg.state.heel), tanh_of(2.0)),
    Entry("running peak force", "hoof", "N", lambda s: s.leg.strides.running_peak, IN_WEIGHTS),
    Entry("steepest rise of the force", "hoof", "N/s", lambda s: s.leg.strides.steepest_rise, RISE),
    Entry("commanded speed", "target", "m/s", lambda s: s.episode.target, tanh_of(5.0)),
    *(Entry(f"height of the ground {x:g} m ahead", "ground", "m", _ahead(x), tanh_of(0.5)) for x in AHEAD),
    Entry("centre of pressure", PRESSURE, "-", lambda s: centre_of_pressure(s.leg, s), PLAIN),
    *CONTEXT_ENTRIES,
    Entry("share of the weight to bear", CONTEXT, "-", _share, PLAIN),
)
"""Entries that can be observed of one leg, in the order of the observation within each group. Heights of the
ground are relative to the ground under O."""


def groups_of(entries: Iterable[Entry]) -> tuple[str, ...]:
    """Return the groups of entries, in order."""
    return tuple(dict.fromkeys(entry.group for entry in entries))


PITCHING = ("pitch", "pitch rate")
"""Names of the entries of a trunk that pitches."""

ABSENT = {
    "fixed": (
        "forward speed",
        "vertical speed",
        "height",
        "bearing allowance",
        "share of the weight to bear",
        *PITCHING,
    ),
    "rail": ("vertical speed", "height", "bearing allowance", "share of the weight to bear", *PITCHING),
    "suspended": PITCHING,
    "boom": ("share of the weight to bear", *PITCHING),
    "floating": ("share of the weight to bear",),
}
"""Names of entries that are constant on a kind of trunk, and are therefore not observed there."""


def observed(
    groups: Iterable[str], trunk: str, drive: str = "prescribed", entries: tuple[Entry, ...] = ENTRIES
) -> list[Entry]:
    """Return the entries of some groups that are observed on a kind of trunk with a kind of drive."""

    def is_observed(entry: Entry) -> bool:
        # A prescribed crank has the commanded rate, which is observed already.
        if entry.name.endswith(TRUE_RATE):
            return drive == "motor"
        return entry.name not in ABSENT.get(trunk, ())

    return [entry for group in groups for entry in entries if entry.group == group and is_observed(entry)]


def check_groups(groups: Any, known: Iterable[str], name: str = "observation") -> tuple[str, ...]:
    """Check a setting of groups, by default `observation`; return it as a tuple.

    Raises:
        ParameterError: not a list of known groups, or a group is named twice.
    """
    names = tuple(known)
    chosen = tuple(groups) if isinstance(groups, (list, tuple)) else ()
    if not chosen or not all(group in names and chosen.count(group) == 1 for group in chosen):
        raise ParameterError(f"{name}: expected a list of some of {', '.join(names)}, got {brief(groups)}")
    return chosen

"""Tasks of all ids, as data: settings, starts, terms of the reward, entries of the observation and body.

One class of environments runs all tasks (`envs.horse_leg`), and one runs many at once (`envs.vector`).
"""

from __future__ import annotations

import difflib
import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from types import MappingProxyType
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np

from hoof_env.errors import ParameterError, UnknownArgumentError, brief, check_choice, one_of
from hoof_env.gait import GaitParameters
from hoof_env.simd.user_functions import check_function, function_name
from hoof_env.tasks.body import Body
from hoof_env.tasks.disturbances import rough_ground
from hoof_env.tasks.hop_terms import BALANCE_ENTRIES, BALANCE_SPEED_TERMS, HOP_ENTRIES, HOP_TERMS
from hoof_env.tasks.horse import HOOF_STIFFNESS, MASS, Horse
from hoof_env.tasks.horse_gaits import checked_size
from hoof_env.tasks.horse_terms import HORSE_ENTRIES, HORSE_TERMS, ROUGH_ENTRIES, ROUGH_WEIGHTS
from hoof_env.tasks.observation import ENTRIES, Entry, check_groups, groups_of
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.reward import TERMS, Term, check_weights
from hoof_env.tasks.schedules import SPEED, check_unscheduled
from hoof_env.tasks.settings import SETTINGS, Settings, as_plain, check_effect, json_value
from hoof_env.tasks.user_parts import ActionMap, check_constants, constants_of

ANY_SPEED = (0.0, 1.0)
"""Placeholder for a scheduled range, where it matters only that speeds are drawn."""


@dataclass(frozen=True)
class Task:
    """Task of an id.

    Attributes:
        name: name of the id, without namespace and version; or a whole id.
        summary: one line for the manual page.
        about: description for the manual page.
        defaults: settings that differ from the defaults of `Settings`.
        start: default reset options.
        reference: name of the scripted gait with a score that simple policies must not reach.
        terms: terms of the reward.
        entries: entries that can be observed.
        body: function that makes the `body.Body` of settings.
        speeds: range of commanded speeds for a `target_speed` of None, of a horse of size 1; proportional to
            the root of the size [m/s].
        contact_law: user's law instead of `normal_law`; see `dynamics.hoof.contact_force`.
        action_map: map from the task's actions to the body's.
        module: module that registers the task; worker processes import it.
        start_for: settings for which `start` was made, if it is another task's; None for the task's own.
    """

    name: str
    summary: str
    about: str
    defaults: Mapping[str, Any]
    start: Mapping[str, Any] = field(default_factory=dict)
    reference: str = "run"
    terms: tuple[Term, ...] = TERMS
    entries: tuple[Entry, ...] = ENTRIES
    body: Callable[[Settings], Body] = OneLeg
    speeds: tuple[float, float] | None = None
    contact_law: Callable[..., Any] | None = None
    action_map: ActionMap | None = None
    module: str = ""
    start_for: Settings | None = None

    @property
    def id(self) -> str:
        """Registered id."""
        return self.name if "/" in self.name else f"hoof_env/{self.name}-v0"

    @property
    def key(self) -> str:
        """Name by which `task_of` finds the task, in another process, too."""
        if "/" in self.name:
            return f"{self.module}:{self.name}" if self.module else self.name
        return next(key for key, task in TASKS.items() if task.name == self.name)

    def names(self) -> tuple[list[str], ...]:
        """Return the names of the task's terms, entries, and contact law and map of actions."""
        others = [function_name(self.contact_law)] if self.contact_law else []
        others += [self.action_map.form] if self.action_map else []
        return [term.name for term in self.terms], [entry.name for entry in self.entries], others

    def __reduce__(self) -> Any:
        """Pickle the task by its name: its functions may be lambdas, which cannot be pickled."""
        return _task_like, (self.key, self.names())

    def __deepcopy__(self, memo: Any) -> Task:
        """Return the task itself, which never changes."""
        return self

    def settings(self, changes: Mapping[str, Any]) -> Settings:
        """Return the task's settings with changes. Reward weights and constants not in `changes`
        have the task's values.

        Raises:
            UnknownArgumentError: an unknown setting.
            ParameterError: a change has no effect under the remaining settings.
        """
        settings = self.chosen(changes)
        if self.speeds is None or settings.target_speed is not None:
            return settings
        speed_scale = math.sqrt(checked_size(settings.size))
        return replace(settings, target_speed=(speed_scale * self.speeds[0], speed_scale * self.speeds[1]))

    def chosen(self, changes: Mapping[str, Any]) -> Settings:
        """Return the settings like `settings`, but leave `target_speed` None if it was not set."""
        for name in changes:
            if name not in SETTINGS:
                near = difflib.get_close_matches(name, SETTINGS, 1)
                hint = f"; did you mean {near[0]}?" if near else f" (known: {', '.join(SETTINGS)})"
                raise UnknownArgumentError(f"{self.id}: unexpected keyword argument {name!r}{hint}")
        for name in ("reward_weights", "constants"):
            given = changes.get(name)
            usual = self.defaults.get(name)
            if usual and (given is None or isinstance(given, Mapping)):
                changes = {**changes, name: {**usual, **(given or {})}}
        # Also a copy: callers may change their lists and mappings later.
        changes = {name: as_plain(name, value) for name, value in changes.items()}
        if unknown := sorted(set(self.defaults) - set(SETTINGS)):
            raise UnknownArgumentError(f"{self.id}: unknown settings {', '.join(unknown)}")
        plain = replace(Settings(), **self.defaults)
        settings = replace(plain, **changes)
        # A `target_speed` of None means the task's range, with which `target_seconds` has an effect.
        is_ranged = self.speeds is not None and settings.target_speed is None
        in_effect = replace(settings, target_speed=self.speeds) if is_ranged else settings
        if isinstance(settings.schedule, Mapping) and SPEED in settings.schedule:
            # Speeds of a schedule may be ranges at any time.
            in_effect = replace(settings, target_speed=ANY_SPEED)
        for name, value in changes.items():
            usual = json_value(getattr(plain, name))
            # An explicit default value is accepted even where the setting has no effect.
            if not np.array_equal(json_value(value), usual):
                check_effect(name, in_effect)
                # A scheduled speed needs a target_speed, which gives the environment a command at all.
                if name != SPEED:
                    check_unscheduled(name, settings)
        if self.contact_law and settings.solver == "paper":
            raise ParameterError(
                f'{self.id}: solver: expected "exact" with a contact law of one\'s own, got "paper"'
            )
        return settings


RACING: Mapping[str, Any] = MappingProxyType(
    {
        "target_speed": None,
        "reward_weights": {
            "progress": 1.0,
            "peak": 0.3,
            "energy": 0.1,
            "slip": 0.0,
            "support": 0.0,
            "loading": 0.0,
        },
    }
)
"""Settings of a task that rewards every metre at any speed, and no bearing of weight."""

_SUSPENDED = (
    "The trunk moves along x and y. The leg must bear `trunk_share` of the weight of trunk and leg. A"
    " constant force carries the rest, and a vertical spring and damper stand for the animal's other legs."
    " They push and pull by more than the weight within a stride: report"
    " [their figures](../task.md#the-trunk) next to any force of the ground."
)

_WHICH_GAIT = (
    " The question is which gait: a crank that follows its command and a held trunk leave little to feel for,"
    " and a gait found by search, which sees no force, returns nearly as much as an agent that sees"
    " everything ([what feedback buys](../agents.md#what-feedback-buys))."
)

_FOUR_LEGS = (
    "Every 3 to 5 s a new speed is commanded, between Froude numbers 0.1 and 1 (v^2 over g times the height"
    " of the hips) and at most 0.5 m/s from the last. With the speed comes its reference gait, from which"
    " actions are offsets."
)

_HORSE: Mapping[str, Any] = MappingProxyType(
    {
        "trunk": "free",
        "trunk_mass": 365.84,
        "trunk_drag": 0.0,
        "stiffness": 2e6,
        "exponent": 1.5,
        "friction": 0.6,
        "hoof_stiffness": HOOF_STIFFNESS,
        "integrator": "semi_implicit_euler",
        "motor_gain": 2000.0,
        "motor_torque": 4000.0,
        "target_speed": None,
        "target_seconds": (3.0, 5.0),
        "observation": ("trunk", "target", "crank", "gait", "hoof", "offset"),
    }
)
"""Settings of a horse."""

_HOPPING: Mapping[str, Any] = MappingProxyType(
    {
        "drive": "motor",
        "stiffness": 2e6,
        "exponent": 1.5,
        "friction": 0.6,
        "hoof_stiffness": 4200.0,
        "hoof_damping": 104.0,
        "hoof_length": 0.25,
        # Enough authority to change the height and the speed of a hop within a stance
        "crank_rate": 20.0,
        "swing_rate": 3.0,
    }
)
"""Settings of one leg that carries itself, except its trunk."""

HOP = GaitParameters(crank_speed=9.66, swing_offset=1.02, swing_sin=0.158, swing_cos=-0.49)
"""Gait in which a hop begins: mean of 133 apexes of a gait that was searched."""

BALANCE = GaitParameters(crank_speed=7.93, swing_offset=0.722, swing_sin=0.226, swing_cos=-0.447)
"""Gait in which a hop begins under a trunk that pitches: of searched gaits one that lasts longest."""

_BALANCED = (
    "The trunk is free to pitch. It has the mass of the other ids' and the radius of gyration of a horse's"
    " trunk at the height of this leg's hip, 0.7 m; the hip is at its centre of mass, and nothing resists its"
    " motion. What turns the leg turns the trunk back: in a stance the swing holds the trunk, in the air the"
    " trunk's spin goes on. An episode fails when the trunk has pitched by 0.5 rad, as a horse's does."
    " Ground, spring, motor and reward are those of HorseLegHop, where a boom takes the torque of the hip,"
    " but a fall costs twice as much. An episode begins near the apex of a hop, at 0.5 to 3 m/s, in a gait"
    " with which the trunk falls over after 0.6 to 4.5 s. What is asked is balance: gaits without feedback"
    " fall over, too."
)

_FLOATING: Mapping[str, Any] = MappingProxyType(
    {
        **_HOPPING,
        "trunk": "floating",
        "trunk_drag": 0.0,
        # With 5, one of two learners went on diving forward until it fell, for the travel on the way
        "reward_weights": {"failure": 10.0},
    }
)
"""Settings of one leg under a trunk that pitches."""

_BALANCE_START: Mapping[str, Any] = MappingProxyType(
    {"gait": BALANCE, "crank_angle": (3.6, 4.2), "height": (2.05, 2.25), "speed": (0.5, 3.0)}
)

TASKS: Mapping[str, Task] = MappingProxyType(
    {
        "leg": Task(
            "HorseLeg", "A horse's leg that must carry and move its trunk.", _SUSPENDED + _WHICH_GAIT, {}
        ),
        "rail": Task(
            "HorseLegRail",
            "A horse's leg that pulls its trunk along a rail.",
            "The trunk slides along x at a fixed height: the leg need not carry it, only move it."
            + _WHICH_GAIT,
            {
                "trunk": "rail",
                **RACING,
                # All five times as large: with a metre worth 1, stock PPO ended below the best constant gait
                # in a third of its trainings.
                "reward_weights": {
                    **RACING["reward_weights"],
                    "progress": 5.0,
                    "peak": 1.5,
                    "energy": 0.5,
                    "failure": 125.0,
                },
            },
        ),
        "speed": Task(
            "HorseLegSpeed",
            "A horse's leg that keeps a commanded speed, which changes.",
            _SUSPENDED
            + " Every 3 to 5 s a new speed is commanded. Travel beyond it is penalised as strongly as travel"
            " up to it is rewarded, and both weigh more than on the other ids." + _WHICH_GAIT,
            {
                "target_speed": (1.0, 3.5),
                "target_seconds": (3.0, 5.0),
                "reward_weights": {"progress": 12.0, "overspeed": 12.0, "failure": 60.0},
                "observation": ("crank", "gait", "trunk", "hoof", "target"),
            },
        ),
        "safe": Task(
            "HorseLegSafe",
            "A horse's leg whose forces must stay below a limit, and which may not lean on its suspension.",
            _SUSPENDED
            + " No term of the reward charges forces. Two costs count steps instead, beside the reward: those"
            " with a force of the ground above 2.2 kN, and those in which the leg owes more than it must bear"
            " of the weight in a second, so that leaning on the suspension is no way out. The limit of the"
            " force is three quarters of the highest force that agents without the constraint use.",
            {
                "reward_weights": {"peak": 0.0, "loading": 0.0},
                "cost": {"indicator": 2200.0, "leaning": 0.8},
            },
        ),
        "terrain": Task(
            "HorseLegTerrain",
            "A horse's leg on slopes and on patches of stiff, soft and slippery ground.",
            _SUSPENDED
            + " The ground rises and falls, and is harder, softer or more slippery in places; an episode"
            " begins anywhere on it. The heights ahead are observed, but not the material: a policy cannot"
            " know a hard patch before the hoof lands, so loading costs less here than elsewhere.",
            {
                "terrain": {"kind": "hills", "seed": 0, "rise": 0.05, "stiffness": [0.25, 2.0]},
                "observation": ("crank", "gait", "trunk", "hoof", "ground"),
                "reward_weights": {"loading": 10.0},
            },
        ),
        "hop": Task(
            "HorseLegHop",
            "A horse's leg that carries itself: it hops.",
            "The trunk is on a boom, free to move forward and up and down, while its pitch is held."
            " There is no suspension and no drag: the ground bears the whole weight through this one"
            " leg. A motor drives the crank, which the ground slows down. The pastern is a spring"
            " between the leg's hoof points and the soles, which sink into the ground by 1 cm. An"
            " episode begins near the apex of a hop, at any speed up to 4 m/s. The boom also takes the"
            " torque of the hip, with which a horse would have to turn its trunk.",
            # Bearings of the boom and the air are left out: the leg brakes as much as it propels
            {**_HOPPING, "trunk": "boom", "trunk_drag": 0.0},
            start={"gait": HOP, "crank_angle": (3.0, 3.7), "height": (1.95, 2.15), "speed": (0.0, 4.0)},
            reference="open-loop",
            terms=HOP_TERMS,
            entries=HOP_ENTRIES,
        ),
        "balance": Task(
            "HorseLegBalance",
            "A horse's leg that carries its trunk and keeps it from falling over: it hops and balances.",
            _BALANCED,
            _FLOATING,
            start=_BALANCE_START,
            reference="open-loop",
            terms=HOP_TERMS,
            entries=BALANCE_ENTRIES,
        ),
        "balance_speed": Task(
            "HorseLegBalanceSpeed",
            "A horse's leg that carries and balances its trunk at a commanded speed, which changes.",
            _BALANCED
            + " Every 3 to 5 s a new speed is commanded, 1 to 3.5 m/s as on HorseLegSpeed. Travel beyond it"
            " is charged as strongly as travel up to it is paid.",
            {
                **_FLOATING,
                "target_speed": (1.0, 3.5),
                "target_seconds": (3.0, 5.0),
                "observation": ("crank", "gait", "trunk", "hoof", "target"),
            },
            start=_BALANCE_START,
            reference="open-loop",
            terms=BALANCE_SPEED_TERMS,
            entries=BALANCE_ENTRIES,
        ),
        "fixed": Task(
            "HorseLegFixed",
            "The paper's set-up: one gait on a fixed trunk, one crank revolution.",
            'The trunk stays where it is. Episodes start in the paper\'s walk, or in its run (`gait="run"`),'
            " and a zero action keeps that gait: this is how `hoof-env reproduce` reproduces the paper."
            ' `solver="exact"` follows the closed form at 0.1 ms; `solver="paper"` integrates'
            " Eq. 8 (42 coordinates, 42 multipliers, Baumgarte) with explicit Euler at 1 ms and samples the"
            " approach speed at the first step inside the ground. Restitution 1 is the paper's elastic"
            " condition, 0 its inelastic one.\n\nBy default nothing is drawn, so all episodes are the same."
            " This is a reproduction and not a benchmark: a return belongs to one deterministic episode, has"
            " no interval, and says nothing about what feedback is worth.",
            {
                "gait": "walk",
                "trunk": "fixed",
                **RACING,
                "restitution": 1.0,
                "approach_floor": 1e-4,
                "friction_fast": 1e-2,
                "integrator": None,
                "sim_dt": None,
                "episode_seconds": 1.0,
            },
            start={"crank_angle": 0.0},
            reference="walk",
        ),
        "horse": Task(
            "Horse",
            "A horse on four legs that keeps a commanded speed.",
            _FOUR_LEGS,
            _HORSE,
            reference="reference",
            terms=HORSE_TERMS,
            entries=HORSE_ENTRIES,
            body=Horse,
            speeds=(1.172, 3.706),
        ),
        "rough": Task(
            "HorseRough",
            "A horse on four legs that stays on its feet: slopes, bumps and pushes.",
            _FOUR_LEGS
            + "\n\nThe ground has slopes of up to 10 % and bumps of up to 5 cm. Every 2 to 4 s the trunk is"
            " pushed forward or back, by up to 1.5 m/s times the horse's mass. Neither the ground ahead nor"
            " the pushes are observed. A policy acts 25 times a second, half as often as on Horse-v0. Scaled"
            " by the root of the height of the hips, 25 Hz are 42 Hz of a robot with hips at 0.5 m. It"
            " sees the motion of the trunk on the scale on which disturbances change it, and the load of each"
            " hoof. All weights of the reward are a fiftieth of Horse-v0's, but relative to the rest"
            " `tracking` weighs four times and a fall nearly seven times as much: compare no returns with"
            " Horse-v0's. The reference gait falls in every fifth episode. `terrain`, `strength` and"
            " `push_impulse` change these disturbances; `size` does not.",
            {
                **_HORSE,
                **rough_ground(1.0, MASS),
                "dt": 0.04,
                "observation": ("trunk", "target", "crank", "load", "offset"),
                "reward_weights": ROUGH_WEIGHTS,
            },
            reference="reference",
            terms=HORSE_TERMS,
            entries=ROUGH_ENTRIES,
            body=Horse,
            speeds=(1.172, 3.706),
        ),
        "horse_safe": Task(
            "HorseSafe",
            "A horse on four legs that keeps a commanded speed, and the force on each hoof below a limit.",
            _FOUR_LEGS
            + "\n\nNo term of the reward charges forces. A cost beside it counts the steps in which the force"
            " on a hoof is above 4.5 kN, three quarters of the highest force that agents without the"
            " constraint use. The legs bear all of the weight: there is nothing to lean on.",
            {**_HORSE, "reward_weights": {"peak": 0.0}, "cost": {"indicator": 4500.0}},
            reference="reference",
            terms=HORSE_TERMS,
            entries=HORSE_ENTRIES,
            body=Horse,
            speeds=(1.172, 3.706),
        ),
    }
)

Part = TypeVar("Part", Term, Entry)

_OWN: dict[str, Task] = {}
"""Tasks of `register`, by id."""


def task_of(name: Any) -> Task:
    """Find a task.

    Args:
        name: name in `TASKS`, id of one of them or of a registered task, or "module:id", which imports the
            module first if the id is not registered yet.

    Raises:
        ParameterError: there is no such task.
    """
    module, _, env_id = name.rpartition(":") if isinstance(name, str) else ("", "", name)
    # A spawned process registers the tasks of a module by importing it.
    if module and env_id not in _OWN:
        try:
            import_module(module)
        except ModuleNotFoundError as error:
            raise ParameterError(f"task: {name!r} is not registered here, and {error}") from None
    tasks = {**TASKS, **_OWN}
    keys = {task.id: key for key, task in TASKS.items()}
    name = env_id if module else name
    return tasks[check_choice("task", keys.get(name, name) if isinstance(name, str) else name, tasks)]


def _task_like(name: str, names: tuple[list[str], ...]) -> Task:
    """Return the task of a pickle: this process's task of that name.

    Raises:
        ParameterError: there is no such task, or its terms, entries or law differ from the pickled task's.
    """
    task = task_of(name)
    if task.names() != names:
        raise ParameterError(
            f"{name}: pickled with other terms, entries or law: {names}; here it has {task.names()}"
        )
    return task


def _several(name: str, values: Any, kind: type[Part]) -> tuple[Part, ...]:
    """Check that `values` is an iterable of terms or of entries; return it as a tuple."""
    parts = tuple(values) if isinstance(values, Iterable) else (values,)
    for part in parts:
        if not isinstance(values, Iterable) or not isinstance(part, kind):
            raise ParameterError(f"{name}: expected a list of hoof_env.{kind.__name__}, got {brief(part)}")
    return parts


def _check_twice(env_id: str, names: list[str]) -> None:
    """Check that no name occurs twice.

    Raises:
        ParameterError: one does.
    """
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(f"{env_id}: expected names that differ, got {', '.join(twice)} twice")


def _check_laws(env_id: str, contact_law: Any, action_map: Any) -> None:
    """Check a user-defined contact law and action map; each may be None."""
    if contact_law is not None:
        check_function(f"{env_id}: contact_law", contact_law, 4)
    if action_map is not None:
        one_of(f"{env_id}: action_map", action_map, ActionMap)


def _checked(task: Task, changes: Mapping[str, Any]) -> Settings:
    """Return the settings of a task with changes, after checking the names of groups, terms and constants."""
    settings = task.chosen(changes)
    check_groups(settings.observation, groups_of(task.entries))
    check_weights(settings.reward_weights, task.terms)
    check_constants(settings.constants, constants_of(task.terms, task.entries))
    return settings


def register(
    env_id: str,
    *,
    base: str = "leg",
    terms: Iterable[Term] = (),
    entries: Iterable[Entry] = (),
    contact_law: Callable[..., Any] | None = None,
    action_map: ActionMap | None = None,
    start: Mapping[str, Any] | None = None,
    body: Callable[[Settings], Body] | None = None,
    **defaults: Any,
) -> None:
    """Register a new id for `gymnasium.make` and `make_vec`: a task of this package with further reward terms
    and observation entries, or with another contact law, action map or settings.

    An id that is already registered is replaced, with Gymnasium's warning. Worker processes import the module
    that calls this function, so the call belongs at the top level of a module; see docs/own_task.md.

    Args:
        env_id: "namespace/Name-v0".
        base: name in `TASKS` or an id, the source of settings, terms and entries.
        terms: reward terms, appended to the base's; a term of the same name replaces the base's.
        entries: observation entries, appended to the base's; their groups are observed by default.
        contact_law: function of penetration [m], its rate [m/s], inverse approach speed [s/m] and the
            ground's constants, which returns the normal force [N]; see `dynamics.hoof.contact_force`.
        action_map: map from user-defined actions to body actions.
        start: reset options of every episode, which the options of a call replace; None for the base's, less
            those that another trunk or leg than the base's cannot have, see docs/own_task.md.
        body: function that makes the `body.Body` of settings, such as a class derived from
            `tasks.horse.Horse`; None for the base's.
        defaults: settings, see the manual pages.

    Raises:
        ParameterError: an unknown base, a name that occurs twice, a malformed id, a term, entry or law of the
            wrong type, or a setting without effect. The id is then not registered.
        UnknownArgumentError: an unknown setting.
    """
    new_terms = _several(f"{env_id}: terms", terms, Term)
    new_entries = _several(f"{env_id}: entries", entries, Entry)
    if not isinstance(env_id, str) or not re.fullmatch(r"(?!hoof_env/)[\w-]+/[\w-]+-v\d+", env_id):
        raise ParameterError(
            f"env_id: expected 'namespace/Name-v0' of a namespace of yours, got {brief(env_id)}"
        )
    try:
        old = task_of(base)
    except ParameterError as error:
        raise ParameterError(f"{env_id}: base: {error}") from None
    _check_laws(env_id, contact_law, action_map)
    if body is not None and not callable(body):
        raise ParameterError(f"{env_id}: body: expected a function of settings, got {brief(body)}")
    if start is not None and not isinstance(start, Mapping):
        raise ParameterError(f"{env_id}: start: expected a mapping of reset options, got {brief(start)}")
    _check_twice(env_id, [term.name for term in new_terms])
    _check_twice(env_id, [entry.name for entry in (*old.entries, *new_entries)])
    added = {term.name: term for term in new_terms}
    kept = [added.pop(term.name, term) for term in old.terms]
    law = f" `{function_name(contact_law)}` gives the normal force." if contact_law else ""
    has_more = bool(new_terms or new_entries or contact_law or action_map)
    foreign = " With terms, entries or laws from outside this package." if has_more else ""
    caller = str(sys._getframe(1).f_globals.get("__name__", ""))
    task = replace(
        old,
        name=env_id,
        module="" if caller in ("__main__", "__mp_main__") else caller,  # worker processes import it
        summary=f"{old.summary}{foreign}",
        about=old.about + law,
        terms=(*kept, *added.values()),
        entries=(*old.entries, *new_entries),
        contact_law=contact_law or old.contact_law,
        action_map=action_map or old.action_map,
        body=body or old.body,
        start=old.start if start is None else dict(start),
        start_for=(old.start_for or old.settings({})) if start is None else None,
    )
    groups = dict.fromkeys((*old.chosen({}).observation, *groups_of(new_entries)))
    settings = _checked(task, {"observation": tuple(groups), **defaults})
    names = "observation", *old.defaults, *defaults
    task = replace(task, defaults={name: getattr(settings, name) for name in names})
    _add_to_gymnasium(task)
    _OWN[env_id] = task


def _add_to_gymnasium(task: Task) -> None:
    """Register the id of a task for `gymnasium.make` and `make_vec`."""
    gym.register(
        task.id,
        entry_point="hoof_env.envs.horse_leg:HorseLegEnv",
        vector_entry_point="hoof_env.envs.vector:HorseLegVectorEnv",
        kwargs={"task": task.key},
        # As for the package's own ids; see `hoof_env/__init__.py`.
        disable_env_checker=True,
    )

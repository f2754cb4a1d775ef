"""The family of tasks, as data: what each id asks of the leg, in `settings` and otherwise.

One environment class serves all (`horse_leg`), alone or many at once (`vector`): a task differs in its
settings, its starts and what is observed, and in nothing else.
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

from hoof_env.errors import ParameterError, UnknownArgumentError, check_choice
from hoof_env.simd.user_functions import check_function, function_name
from hoof_env.tasks.body import Body
from hoof_env.tasks.effects import check_effect
from hoof_env.tasks.horse import HOOF_STIFFNESS, Horse
from hoof_env.tasks.horse_gaits import checked_size
from hoof_env.tasks.horse_terms import HORSE_ENTRIES, HORSE_TERMS
from hoof_env.tasks.observation import ENTRIES, Entry, check_groups, groups_of
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.plain import as_plain, json_value
from hoof_env.tasks.reward import TERMS, Term, check_weights
from hoof_env.tasks.settings import SETTINGS, Settings


@dataclass(frozen=True)
class Task:
    """A task: `defaults` are its settings where they differ from those of `Settings`.

    Attributes:
        name: of the id, without namespace and version; or a whole id.
        summary: one line.
        about: what is asked, for the manual page.
        defaults: settings.
        start: reset options, unless others are given.
        reference: the scripted gait that simple policies must stay below.
        terms: of the reward.
        entries: all that can be observed.
        body: makes the `body.Body` of some settings.
        speeds: of a horse of size 1, between which a `target_speed` of None commands; they go with the root
            of the size [m/s].
        contact_law: instead of `normal_law`, see `dynamics.hoof.law_of`.
        module: that registers it, which other processes import.
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
    module: str = ""

    @property
    def id(self) -> str:
        """The registered id."""
        return self.name if "/" in self.name else f"hoof_env/{self.name}-v0"

    @property
    def key(self) -> str:
        """What `task_of` takes."""
        if "/" in self.name:
            return f"{self.module}:{self.name}" if self.module else self.name
        return next(key for key, task in TASKS.items() if task.name == self.name)

    def names(self) -> tuple[list[str], ...]:
        """Of what it is made of."""
        law = [function_name(self.contact_law)] if self.contact_law else []
        return [term.name for term in self.terms], [entry.name for entry in self.entries], law

    def __reduce__(self) -> Any:
        """Pickles have its name: functions of terms and entries need not have one."""
        return _task_like, (self.key, self.names())

    def __deepcopy__(self, memo: Any) -> Task:
        return self

    def settings(self, changes: Mapping[str, Any]) -> Settings:
        """Its settings with some changed; reward weights that are not named keep the task's values.

        Raises:
            UnknownArgumentError: an unknown setting.
            ParameterError: one is not the task's own and has no effect beside the others.
        """
        settings = self.chosen(changes)
        if self.speeds is None or settings.target_speed is not None:
            return settings
        speed_scale = math.sqrt(checked_size(settings.size))
        return replace(settings, target_speed=(speed_scale * self.speeds[0], speed_scale * self.speeds[1]))

    def chosen(self, changes: Mapping[str, Any]) -> Settings:
        """The same where a target speed that nobody names is None still."""
        for name in changes:
            if name not in SETTINGS:
                near = difflib.get_close_matches(name, SETTINGS, 1)
                hint = f"; did you mean {near[0]}?" if near else f" (known: {', '.join(SETTINGS)})"
                raise UnknownArgumentError(f"{self.id}: unexpected keyword argument {name!r}{hint}")
        weights = changes.get("reward_weights")
        own = self.defaults.get("reward_weights", {})
        if own and (weights is None or isinstance(weights, Mapping)):
            changes = {**changes, "reward_weights": {**own, **(weights or {})}}
        changes = {name: as_plain(name, value) for name, value in changes.items()}  # a copy, too
        if unknown := sorted(set(self.defaults) - set(SETTINGS)):
            raise UnknownArgumentError(f"{self.id}: unknown settings {', '.join(unknown)}")
        plain = replace(Settings(), **self.defaults)
        settings = replace(plain, **changes)
        is_ranged = self.speeds is not None and settings.target_speed is None
        in_effect = replace(settings, target_speed=self.speeds) if is_ranged else settings
        for name, value in changes.items():
            usual = json_value(getattr(plain, name))
            if not np.array_equal(json_value(value), usual):  # else it asks for nothing
                check_effect(name, in_effect)
        if self.contact_law and settings.solver == "paper":
            raise ParameterError(
                f'{self.id}: solver: expected "exact" beside a contact law of one\'s own, got "paper"'
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
"""Settings of a task that pays for every metre, however fast, and not for bearing weight."""

_SUSPENDED = (
    "The trunk moves along x and y. The leg must bear `trunk_share` of the weight of trunk and leg; a"
    " constant force carries the rest, a vertical spring and damper stands for the animal's other legs."
)

TASKS: Mapping[str, Task] = MappingProxyType(
    {
        "leg": Task("HorseLeg", "A horse's leg that must carry and move its trunk.", _SUSPENDED, {}),
        "rail": Task(
            "HorseLegRail",
            "A horse's leg that pulls its trunk along a rail.",
            "The trunk slides along x at fixed height: nothing has to be carried, only moved.",
            {"trunk": "rail", **RACING},
        ),
        "speed": Task(
            "HorseLegSpeed",
            "A horse's leg that keeps a commanded speed, which changes.",
            _SUSPENDED
            + " Every 3 to 5 s a new speed is commanded. Progress is paid up to it, what goes beyond costs as"
            " much, and both weigh more than elsewhere, for here the speed is asked for.",
            {
                "target_speed": (1.0, 3.5),
                "target_seconds": (3.0, 5.0),
                "reward_weights": {"progress": 12.0, "overspeed": 12.0, "failure": 60.0},
                "observation": ("crank", "gait", "trunk", "hoof", "target"),
            },
        ),
        "terrain": Task(
            "HorseLegTerrain",
            "A horse's leg on slopes and on patches of stiff, soft and slippery ground.",
            _SUSPENDED
            + " The ground rises and falls, and is harder, softer or more slippery in places; an episode"
            " begins anywhere on it. The heights ahead are observed, its material is not: a hoof"
            " cannot know a hard patch before it lands, so that loading costs less here than elsewhere.",
            {
                "terrain": {"kind": "hills", "seed": 0, "rise": 0.05, "stiffness": [0.25, 2.0]},
                "observation": ("crank", "gait", "trunk", "hoof", "ground"),
                "reward_weights": {"loading": 10.0},
            },
        ),
        "fixed": Task(
            "HorseLegFixed",
            "The paper's set-up: one gait on a fixed trunk, one crank revolution.",
            "The trunk stays where it is. Episodes start in the paper's walk, or in its run (`gait`),"
            " and the zero action keeps that gait, which reproduces the paper: `hoof-env reproduce` runs this"
            ' environment. `solver="exact"` follows the closed form at 0.1 ms, `solver="paper"` integrates'
            " Eq. 8 (42 coordinates, 42 multipliers, Baumgarte) with explicit Euler at 1 ms and samples the"
            " approach speed at the first step inside the ground. Restitution 1 is the paper's elastic"
            " condition, 0 its inelastic one.",
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
            "Four legs carry a trunk that moves along x and y and pitches, in the plane. Every 3 to 5 s a new"
            " speed is commanded, between the Froude numbers 0.1 and 1 (v^2 over g times the height of the"
            " hips) and at most 0.5 m/s from the last, and with it the gait"
            " from which actions make offsets: its reference gait.",
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
            },
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


def task_of(name: Any) -> Task:
    """A task of `TASKS` by its name, or one of `register` by its id; "module:id" imports the module first
    where the id is not registered yet, as in a process that was spawned.

    Raises:
        ParameterError: there is none.
    """
    module, _, own = name.rpartition(":") if isinstance(name, str) else ("", "", name)
    if module and own not in _OWN:
        try:
            import_module(module)
        except ModuleNotFoundError as error:
            raise ParameterError(f"task: {name!r} is not registered here, and {error}") from None
    tasks = {**TASKS, **_OWN}
    return tasks[check_choice("task", own if module else name, tasks)]


def _task_like(name: str, names: tuple[list[str], ...]) -> Task:
    """The task of a pickle: that of this process, if it is the same one."""
    task = task_of(name)
    if task.names() != names:
        raise ParameterError(
            f"{name}: pickled with other terms, entries or law: {names}, here {task.names()}"
        )
    return task


def _several(name: str, values: Any, kind: type[Part]) -> tuple[Part, ...]:
    parts = tuple(values) if isinstance(values, Iterable) else (values,)
    for part in parts:
        if not isinstance(values, Iterable) or not isinstance(part, kind):
            raise ParameterError(f"{name}: expected a list of hoof_env.{kind.__name__}, got {part!r}")
    return parts


def _check_twice(env_id: str, names: list[str]) -> None:
    """Raise `ParameterError` if a name is there twice."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(f"{env_id}: expected names that differ, got {', '.join(twice)} twice")


def register(
    env_id: str,
    *,
    base: str = "leg",
    terms: Iterable[Term] = (),
    entries: Iterable[Entry] = (),
    contact_law: Callable[..., Any] | None = None,
    **defaults: Any,
) -> None:
    """Register an id of one's own: a task of this package with more terms of the reward, more entries of the
    observation, another law of contact and other settings. It serves `gymnasium.make` and `make_vec`.

    An id that is registered already is replaced, with Gymnasium's warning. Other processes import the module
    that calls this, so it stands at the top level of one; see docs/own_task.md.

    Args:
        env_id: "namespace/Name-v0".
        base: a name in `TASKS` or an id of one's own, whose settings, terms and entries it begins with.
        terms: of the reward, behind those of the base; one with a name that the base has takes its place.
        entries: that can be observed, behind those of the base; their groups are observed by default.
        contact_law: function of penetration [m], its rate [m/s], inverse approach speed [s/m] and the
            ground's constants, which returns the normal force [N]; see `dynamics.hoof.law_of`.
        defaults: settings, see the manual pages.

    Raises:
        ParameterError: an unknown base, a name twice, an id that does not read so, a term, entry or law of
            another type, or a setting without effect. Nothing is registered then.
        UnknownArgumentError: an unknown setting.
    """
    own = _several(f"{env_id}: terms", terms, Term)
    more = _several(f"{env_id}: entries", entries, Entry)
    if not isinstance(env_id, str) or not re.fullmatch(r"(?!hoof_env/)[\w-]+/[\w-]+-v\d+", env_id):
        raise ParameterError(f"env_id: expected 'namespace/Name-v0' of a namespace of yours, got {env_id!r}")
    old = task_of(base)
    if contact_law is not None:
        check_function(f"{env_id}: contact_law", contact_law, 4)
    _check_twice(env_id, [term.name for term in own])
    _check_twice(env_id, [entry.name for entry in (*old.entries, *more)])
    mine = {term.name: term for term in own}
    kept = [mine.pop(term.name, term) for term in old.terms]
    of_law = f" The normal force is that of `{function_name(contact_law)}`." if contact_law else ""
    caller = str(sys._getframe(1).f_globals.get("__name__", ""))
    task = replace(
        old,
        name=env_id,
        module="" if caller in ("__main__", "__mp_main__") else caller,
        summary=f"{old.summary} With terms, entries or laws from outside this package.",
        about=old.about + of_law,
        terms=(*kept, *mine.values()),
        entries=(*old.entries, *more),
        contact_law=contact_law or old.contact_law,
    )
    groups = dict.fromkeys((*old.chosen({}).observation, *groups_of(more)))
    settings = task.chosen({"observation": tuple(groups), **defaults})
    check_groups(settings.observation, groups_of(task.entries))
    check_weights(settings.reward_weights, task.terms)
    changed = {name: getattr(settings, name) for name in ("observation", *old.defaults, *defaults)}
    task = replace(task, defaults=changed)
    _add_to_gymnasium(task)
    _OWN[env_id] = task


def _add_to_gymnasium(task: Task) -> None:
    """Register the id of a task for `gymnasium.make` and `make_vec`."""
    gym.register(
        task.id,
        entry_point="hoof_env.envs.horse_leg:HorseLegEnv",
        vector_entry_point="hoof_env.envs.vector:HorseLegVectorEnv",
        kwargs={"task": task.key},
        disable_env_checker=True,  # as for the package's own ids
    )

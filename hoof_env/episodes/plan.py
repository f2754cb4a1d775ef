"""Plan of a batch of episodes: all that follows from settings, in the order in which they are checked."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import MAX_COEFFICIENT, Mechanics
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.episodes.commands import Commands
from hoof_env.episodes.contexts import Contexts
from hoof_env.episodes.costs import Costs
from hoof_env.episodes.delays import Delays
from hoof_env.episodes.noise import Noise
from hoof_env.episodes.observed import Observed
from hoof_env.episodes.pushes import Pushes
from hoof_env.episodes.randomization import Randomization
from hoof_env.episodes.rows import Rows
from hoof_env.episodes.scene import Slots
from hoof_env.episodes.strength import Strength
from hoof_env.errors import ParameterError, brief, check_choice, check_number, flag
from hoof_env.ground.terrain import Terrain
from hoof_env.simd.user_functions import function_name
from hoof_env.tasks.body import Body
from hoof_env.tasks.episode import ACTIONS, Episode, episode_layout, task_type
from hoof_env.tasks.observation import CONTEXT, check_groups, groups_of
from hoof_env.tasks.parameters import check_parameters, resolved, substeps_of
from hoof_env.tasks.registry import Task
from hoof_env.tasks.reward import check_weights
from hoof_env.tasks.schedules import check_schedule
from hoof_env.tasks.settings import ResolvedSettings, Settings
from hoof_env.tasks.terrains import check_drift, make_terrain
from hoof_env.tasks.user_parts import check_constants, constants_of, declared_by

MAX_EPISODE_SECONDS = 1e6
"""Largest `episode_seconds` [s]."""

MAX_BAUMGARTE = 1e6
"""Largest of Baumgarte's parameters [1/s]; larger ones are unstable even with a substep of 1 us."""


class Feature(Protocol):
    """Feature of episodes, which each episode draws or sets at its start. Its constructor `of` checks its
    settings; its other methods are called where they act."""

    def begin(
        self,
        rows: Rows,
        which: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Draw or set the feature's values in episodes that start in the rows `which`, with a generator for
        each and the options of the reset."""


@dataclass(frozen=True, eq=False)
class Plan:
    """All that follows from settings. Rows of a batch may be under several plans; see `RowPlans`.

    Attributes:
        task: task of the episodes.
        asked: settings as asked for; `settings` has values in place of None.
        body: one leg, or a horse.
        terrain: ground.
        weights: weights of the reward's terms by name.
        constants: constants of terms and entries.
        substeps: substeps of `sim_dt` of a control step; the engine may divide them.
        dt: control step [s].
        episode_seconds: time limit of an episode [s], which the charge for a failure counts to.
        steps_per_episode: control steps of an episode.
        observed, delays, commands, strength, noise, pushes, costs, randomization: features.
        mechanics: engine's parts.
        record: constants of the task that the kernels read, shape (1,); see `episode.task_type`.
    """

    task: Task
    asked: Settings
    settings: ResolvedSettings
    body: Body
    terrain: Terrain
    weights: dict[str, float]
    constants: Any
    substeps: int
    dt: float
    episode_seconds: float
    steps_per_episode: int
    observed: Observed
    delays: Delays
    commands: Commands
    strength: Strength
    noise: Noise
    pushes: Pushes
    costs: Costs
    randomization: Randomization
    mechanics: Mechanics
    record: NDArray[Any]

    @property
    def features(self) -> tuple[Feature, ...]:
        """Features with a start of their own, in the order in which they draw. A seed's meaning includes this
        order: parameters and the body's start come before."""
        return self.commands, self.strength, self.noise, self.delays, self.pushes, self.costs

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions."""
        own = self.task.action_map
        return own.names if own else self.body.action_names

    @property
    def action_form(self) -> str:
        """Tag of the meaning of actions."""
        own = self.task.action_map
        return own.form if own else self.body.action_form

    @cached_property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the observation's columns."""
        return self.observed.names(
            self.delays.history, self.delays.last_actions, self.action_names, self.body.renamed
        )

    @property
    def observation_scales(self) -> dict[str, str]:
        """Formulas of the scales of what is observed, by entry."""
        return self.observed.scales(self.body.renamed)

    @property
    def legs(self) -> int:
        """Number of legs."""
        return self.body.kernels.legs

    @property
    def layout(self) -> type[Episode]:
        """Layout of an episode's memory."""
        terms, own = self.task.terms, declared_by(self.task.terms, self.task.entries)
        return episode_layout(self.body.kernels.episode, len(terms), self.mechanics.features, self.legs, own)

    @property
    def start_names(self) -> tuple[str, ...]:
        """Names of the start values of an episode, without those drawn by `randomize`."""
        return (*self.body.start_names, *self.body.gait_names)

    def rows(self, num_envs: int, columns: int) -> Rows:
        """Make the arrays of episodes.

        Args:
            num_envs: number of environments.
            columns: number of columns of the engine's memory.
        """
        actions, frame = len(self.action_names), len(self.observed.entries)
        single = np.float32
        drawn = len(self.start_names) + len(self.randomization.ranges)
        pushes = np.empty(num_envs, object)
        pushes[:] = [()] * num_envs
        return Rows(
            layout=self.layout,
            num_envs=num_envs,
            episode=np.zeros((self.layout.size, columns)),
            actions=np.zeros((columns, actions), single),
            observations=np.zeros((columns, len(self.observation_names)), single),
            rewards=np.zeros(columns),
            unweighted=np.zeros((len(self.task.terms), columns)),
            acted=np.zeros((columns, actions), single) if self.delays.has_actions else None,
            mapped=np.zeros((columns, len(self.body.action_names)), single) if self.task.action_map else None,
            past_actions=np.zeros((columns, self.delays.past_actions, actions), single),
            frames=np.zeros((columns, self.delays.frames, frame), single),
            start_values=np.full((drawn, num_envs), np.nan),
            steps_before=np.zeros(num_envs),
            has_overrides=np.zeros(num_envs, bool),
            pushes=pushes,
            costs=np.zeros((len(self.costs.names), num_envs)),
            cost_sums=np.zeros((len(self.costs.names), num_envs)),
            stance_rises=np.zeros((self.legs if "loading" in self.costs.limits else 0, num_envs)),
            debts=np.zeros((int("leaning" in self.costs.limits), num_envs)),
        )

    def __deepcopy__(self, memo: dict[int, Any]) -> Plan:
        """Return the plan itself, which never changes: planners copy at every node of their tree."""
        return self


def make_plan(
    task: Task,
    asked: Settings,
    num_envs: int = 1,
    num_threads: int = 1,
    max_episode_steps: int | None = None,
) -> tuple[Plan, TrunkEngine]:
    """Check settings; return the plan that follows from them, and its engine.

    Args:
        task: task of the episodes.
        asked: settings of the task; see `Task.settings`.
        num_envs, num_threads: arguments of the engine.
        max_episode_steps: control steps after which episodes are truncated if `episode_seconds` is longer.

    Raises:
        ParameterError: a setting is out of range or of the wrong type.
    """
    s = resolved(asked)
    _check_choices(s)
    given = {} if s.randomize is None else check_parameters("randomize", s.randomize, s)
    terrain = make_terrain(s.terrain)
    if s.solver == "paper":
        from hoof_env.paper_solver.episodes import check_settings

        check_settings(s)
    body = task.body(s)
    if not hasattr(body, "kernels"):
        raise ParameterError(
            f"{task.id}: body: expected a function of settings that returns a Body, got {brief(body)} from"
            f" {function_name(task.body)}"
        )
    check_drift(terrain, s.terrain, s.trunk, body.height)
    weights = check_weights(s.reward_weights, task.terms)
    constants = check_constants(s.constants, constants_of(task.terms, task.entries))
    substeps = substeps_of(s.dt, s.sim_dt)
    dt = s.sim_dt * substeps
    # An episode of one step is allowed, whatever the rounding of dt.
    shortest = dt * (1 - 1e-9)
    seconds = check_number("episode_seconds", s.episode_seconds, low=shortest, high=MAX_EPISODE_SECONDS)
    steps = round(seconds / dt)
    groups = check_groups(s.observation, groups_of(task.entries))
    speeds = body.commanded_speeds(s)
    schedule = check_schedule(s.schedule, s, body)
    commands = Commands.of(s, speeds, schedule, body.command_step, dt)
    noise = Noise.of(s, groups)
    strength = Strength.of(s, schedule)
    pushes = Pushes.of(s, dt, steps)
    delays = Delays.of(s, substeps, steps)
    costs = Costs.of(s, task, dt)
    contexts = Contexts.of(s, {**given, **schedule})
    if flag("context_visible", s.context_visible) and CONTEXT not in groups:
        groups = (*groups, CONTEXT)
    observed = Observed.of(s, task, groups)
    randomization = Randomization(s, body, terrain, given, schedule, contexts)
    engine = _make_engine(task, s, body, terrain, randomization.substeps(), num_envs, num_threads)
    plan = Plan(
        task=task,
        asked=asked,
        settings=s,
        body=body,
        terrain=terrain,
        weights=weights,
        constants=constants,
        substeps=substeps,
        dt=dt,
        episode_seconds=seconds,
        steps_per_episode=steps if max_episode_steps is None else min(steps, max_episode_steps),
        observed=observed,
        delays=delays,
        commands=commands,
        strength=strength,
        noise=noise,
        pushes=pushes,
        costs=costs,
        randomization=randomization,
        mechanics=engine.mechanics,
        record=np.zeros(1, _record_type(task, body, engine)),
    )
    _fill(plan, engine)
    return plan, engine


def _check_choices(s: ResolvedSettings) -> None:
    """Check the settings of solver, drive and motor.

    Raises:
        ParameterError: a value is unknown or out of range.
    """
    schemes: Collection[str] = SCHEMES
    if s.solver == "paper":
        from hoof_env.paper_solver.integrators import INTEGRATORS

        schemes = INTEGRATORS
    check_choice("integrator", s.integrator, schemes)
    check_choice("drive", s.drive, ("prescribed", "motor"))
    for name in ("baumgarte_alpha", "baumgarte_beta"):
        check_number(name, getattr(s, name), low=0.0, high=MAX_BAUMGARTE)
    for name in ("motor_gain", "motor_torque", "motor_inertia"):
        check_number(name, getattr(s, name), low=0.0, high=MAX_COEFFICIENT)


def _make_engine(
    task: Task,
    s: ResolvedSettings,
    body: Body,
    terrain: Terrain,
    substeps: int | None,
    num_envs: int,
    num_threads: int,
) -> TrunkEngine:
    """Make the engine of settings, with as many substeps as all drawn parameters need."""
    trunk, ground, limbs = body.parts(s)
    make: Callable[..., TrunkEngine] = TrunkEngine
    integrator = s.integrator
    if s.solver == "paper":
        from hoof_env.paper_solver.episodes import PaperEngine, Scheme

        scheme = Scheme(s.sim_dt, s.baumgarte_alpha, s.baumgarte_beta, s.integrator)
        make = partial(PaperEngine, scheme)
        integrator = "midpoint"  # of `TrunkEngine`, which takes no step then
    return make(
        limbs,
        trunk,
        ground,
        terrain,
        substeps=substeps,
        sim_dt=s.sim_dt,
        integrator=integrator,
        num_envs=num_envs,
        num_threads=num_threads,
        strides=True,
        contact_law=task.contact_law,
        step_error=body.step_error,
        harmonics=body.harmonics,
        filters=body.filters,
        limits=body.limits,
    )


def _record_type(task: Task, body: Body, engine: TrunkEngine) -> np.dtype[Any]:
    """Return the type of the record of a task's constants."""
    fields = (*body.kernels.task_fields, *declared_by(task.terms, task.entries).fields)
    slots = Slots.of(task.entries)
    return task_type(len(task.terms), slots.count, engine.features.gait_size, fields)


def _fill(plan: Plan, engine: TrunkEngine) -> None:
    """Fill in the record of a new plan."""
    record, task = plan.record[0], plan.task
    for name, value in plan.body.constants(engine, plan.dt).items():
        record[name] = value
    record["rate_bound"][:ACTIONS] = engine.filters.to_array()[:, 1]
    record["weights"] = [plan.weights[term.name] for term in task.terms]
    if declared_by(task.terms, task.entries).constants:
        record["constants"] = plan.constants
    record["episode_seconds"] = plan.episode_seconds
    record["h"] = engine.substep
    record["substeps"] = plan.substeps * engine.substeps
    record["dt"] = plan.dt
    record["episode_steps"] = plan.steps_per_episode
    record["is_fixed"] = plan.settings.trunk == "fixed"
    record["usual_weight"] = GRAVITY * (engine.trunk.mass + sum(limb.geometry.mass for limb in engine.limbs))
    record["usual_stiffness"] = plan.settings.stiffness
    record["usual_friction"] = plan.settings.friction
    slots = Slots.of(task.entries).places
    groups = plan.observed.fill(record, slots, len(plan.observation_names))
    plan.noise.fill(record, groups)
    plan.delays.fill(record, len(plan.observed.entries), len(plan.action_names), engine.substeps)

"""Episodes of a task, one or many at once, for the single and the vector environment.

`EpisodeBatch` works with arrays and generators and does not depend on Gymnasium. A row has the same bits for
any number of neighbours: its starts are drawn from its own generator, and the kernels are `step`'s,
compiled for one environment or for several side by side.

A `plan.Plan` holds all that follows from settings, `rows.Rows` the arrays that change from step to step, and
`row_plans.RowPlans` the plan of each row.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.advance import LANES, EngineKind
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.memory import only
from hoof_env.dynamics.model import static_of
from hoof_env.dynamics.parts import Mechanics, broken
from hoof_env.episodes.infos import InfoLayout
from hoof_env.episodes.plan import Plan, make_plan
from hoof_env.episodes.row_plans import RowPlans
from hoof_env.episodes.scene import ALL_ARRAYS, TaskKind, known_of
from hoof_env.episodes.step import (
    NOT_A_NUMBER,
    SOME_ENDED,
    SOME_PUSHED,
    SOME_SWITCHED,
    StepKernels,
    step_kernels,
)
from hoof_env.errors import ParameterError, brief
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Held
from hoof_env.simd.threads import run_together
from hoof_env.simd.user_functions import UserFunctionError, user_error
from hoof_env.tasks.leg_starts import RISING, UsualRange
from hoof_env.tasks.registry import Task
from hoof_env.tasks.reward import BEARING, MAX_STRIDE
from hoof_env.tasks.settings import ResolvedSettings, Settings

Floats = NDArray[np.float64]
Index = NDArray[np.int64]
Generators = Sequence[np.random.Generator]


@dataclass(frozen=True)
class Calls:
    """Kernels of a plan, with the arrays of a batch in this process.

    Attributes:
        kernels: all kernels of the task.
        step: control step of all rows: a kernel, or a method that calls an engine between kernels.
        held: its argument.
        blocks: its arguments for each thread.
    """

    kernels: StepKernels
    step: Callable[..., Any]
    held: Held
    blocks: list[tuple[Held]]


OF_LEG = ("preset", "hip_height", "hoof_length")
"""Settings of the leg's shape, with which a task's own reset options may not fit."""

OF_POSTURE = ("gait", "crank_angle", "height")
"""Reset options that depend on the leg's shape."""


class EpisodeBatch:
    """`num_envs` episodes of a task.

    Attributes:
        task: task of all episodes.
        plan: plan under which the batch works at present.
        row_plans: plans of all rows.
        rows: arrays that change from step to step.
        engine: engine of all episodes. Memory and arrays have `engine.columns` columns; the last may be idle.
        calls: kernels of the present plan with their arguments; `calls.step(calls.held)` is one control step
            of all episodes, which `finish_step` follows.
        drawn_names: names of the parameters that any row draws, in the order of `rows.start_values`.
        measurements: places of the values in the engine's memory that infos contain.
        is_push_unseen: True if a trunk was pushed since the last step, which no observation shows yet.
        unpushed: measurements at the end of the last step, by row, of rows that were due to be pushed.
        usual_start: reset options of every episode, checked, which those of a call replace.

    Args:
        task: task of all episodes.
        settings: settings of the task; see `Task.settings`.
        num_envs: number of episodes.
        num_threads: number of threads that share the episodes in a step.
        max_episode_steps: control steps after which episodes are truncated, if they are not shorter already.

    Raises:
        ParameterError: a setting is out of range or of the wrong type, or a function cannot be compiled.
    """

    def __init__(
        self,
        task: Task,
        settings: Settings,
        num_envs: int,
        num_threads: int = 1,
        max_episode_steps: int | None = None,
    ) -> None:
        self.task = task
        self.num_envs = num_envs
        self._max_episode_steps = max_episode_steps
        self.plan, self.engine = make_plan(task, settings, num_envs, num_threads, max_episode_steps)
        self.row_plans = RowPlans([self.plan], num_envs)
        self.rows = self.plan.rows(num_envs, self.engine.columns)
        self.rows.named.weight[:] = self.engine.weight
        # Columns without an environment never switch, so that they cause no draw.
        self.rows.named.switch[:] = np.inf
        self.rows.named.push_at[:] = np.inf
        self.drawn_names = [*self.plan.randomization.ranges]
        self.measurements = InfoLayout(self.engine.features, tuple(self.plan.body.hips))
        self.is_push_unseen = False
        self.unpushed: dict[int, Floats] = {}
        self.usual_start: dict[str, Any] = {}
        self.usual_start = self._checked_start()
        self._kernels: dict[TaskKind, StepKernels] = {}
        self._calls: dict[Plan, Calls] = {}
        self._open()
        self._compile(self.calls.kernels)

    # What follows from the present plan

    @property
    def settings(self) -> ResolvedSettings:
        """Settings, with values in place of None."""
        return self.plan.settings

    @property
    def terms(self) -> tuple[str, ...]:
        """Keys of the terms in infos, costs included."""
        return tuple(term.key for term in self.task.terms)

    @property
    def term_names(self) -> tuple[str, ...]:
        """Names of the terms, costs included."""
        return tuple(term.name for term in self.task.terms)

    @property
    def ended_row(self) -> int:
        """Row of `Episode.ended` in the memory of the episodes."""
        row: int = self.rows.layout.rows("ended").start
        return row

    # Plans of rows

    def change(self, asked: Sequence[Settings], groups: Sequence[Sequence[int]]) -> None:
        """Start episodes from now on with other values of some settings in `row_plans.CHANGEABLE`.

        Args:
            asked: all settings, for each group of rows.
            groups: these groups.

        Raises:
            ParameterError: a setting is out of range, or a function from outside cannot be part of kernels
                for other ground; nothing has changed then.
        """
        plans = [self.plan_of(settings) for settings in asked]
        for plan in plans:
            self._compile(self._kernels_of(plan))
        # A copy, which takes effect as a whole or, after Ctrl-C, not at all.
        row_plans = self.row_plans.copy()
        for plan, group in zip(plans, groups, strict=True):
            row_plans.add(plan, np.array(group))
        self.row_plans = row_plans

    def plan_of(self, settings: Settings) -> Plan:
        """Return the plan of some settings, one that rows have already if there is one."""
        known = self.row_plans.find(settings)
        return known or make_plan(self.task, settings, max_episode_steps=self._max_episode_steps)[0]

    def enter(self, plan: Plan) -> None:
        """Work under a plan."""
        calls = self._calls_of(plan)
        self.plan, self.engine.mechanics, self.calls = plan, plan.mechanics, calls

    def put_under(self, row_plans: RowPlans) -> None:
        """Work under plans of the rows."""
        plan = row_plans.newest
        calls = self._calls_of(plan)
        names, values = self._drawn_under(row_plans)
        # No call in between: Ctrl-C comes before all of these assignments or after them.
        self.row_plans = row_plans
        self.plan, self.engine.mechanics, self.calls = plan, plan.mechanics, calls
        self.drawn_names, self.rows.start_values = names, values
        self._calls = {plan: calls for plan, calls in self._calls.items() if plan in row_plans.plans}

    def _adopt(self, which: Index) -> None:
        """Put rows under their pending plans."""
        plans = self.row_plans.copy()
        # The engine's constants of these rows follow from their old settings.
        self.rows.has_overrides[which[plans.present[which] != plans.pending[which]]] = True
        plans.start(which)
        self.put_under(plans)

    def _drawn_under(self, row_plans: RowPlans) -> tuple[list[str], Floats]:
        """Return `drawn_names` under plans, and `start_values` with a row for each of these names, NaN where
        a row does not draw it."""
        old, old_values = self.drawn_names, self.rows.start_values
        ranges = [plan.randomization.ranges for plan in row_plans.in_use()]
        names = [*dict.fromkeys(name for each in ranges for name in each)]
        if names == old:
            return old, old_values
        first = len(self.plan.start_names)
        values = np.full((first + len(names), self.num_envs), np.nan)
        values[:first] = old_values[:first]
        for k, name in enumerate(names):
            if name in old:
                values[first + k] = old_values[first + old.index(name)]
        return names, values

    def under_each(
        self, which: Index, act: Callable[[Index], Any], *, for_kernels: bool = False
    ) -> list[Any]:
        """Call a function once under each plan that some rows are under; return its results.

        Args:
            which: rows that are to be changed.
            act: function of the rows that are under the present plan; changes of other rows are undone.
            for_kernels: True for a function that only runs kernels: once where they do not distinguish.
        """
        results = []
        try:
            for plan, group in self.row_plans.groups(which, for_kernels=for_kernels):
                self.enter(plan)
                with self.only(group):
                    results.append(act(group))
        finally:
            self.enter(self.row_plans.newest)
        return results

    @contextmanager
    def only(self, which: Index) -> Iterator[None]:
        """Restore all rows but some after a block."""
        with self.engine.only(which), only(which, self.num_envs, self.rows.written()):
            yield

    def restart_schedules(self, which: Sequence[int] | Index) -> None:
        """Begin the schedules of rows anew with the next start, which counts the steps of the present
        episode."""
        self.rows.steps_before[which] = -self.rows.named.steps[which]

    # Starts

    def check_options(self, options: Any, which: Index | None = None) -> dict[str, Any]:
        """Check reset options completely, so that a refused reset changes nothing; return them in the form
        that `reset` takes.

        Args:
            options: the options.
            which: rows that start, each under its pending plan; None for all.

        Raises:
            ParameterError: an unknown option, or one that some of the episodes cannot have.
        """
        plans = self.row_plans
        if len(plans.plans) == 1:
            return self._check_options(options)
        which = np.arange(self.num_envs) if which is None else which
        if not plans.are_due(which) and not plans.are_mixed:
            return self._check_options(options)
        checked: dict[str, Any] = {}
        try:
            for k in np.unique(plans.pending[which]).tolist():
                self.enter(plans.plans[k])
                checked = self._check_options(options)
        finally:
            self.enter(plans.newest)
        return checked

    def _check_options(self, options: Any) -> dict[str, Any]:
        """Check reset options under the present plan."""
        plan = self.plan
        checked = plan.body.check_options(options, self.engine.trunk, plan.settings)
        gaits = checked.get("gait")
        if isinstance(gaits, np.ndarray) and gaits.ndim == 2 and len(gaits) != self.num_envs:
            raise ParameterError(
                f"options['gait']: expected one gait or {self.num_envs}, one for each environment, got"
                f" {len(gaits)}"
            )
        if "pushes" in checked:
            checked["pushes"] = plan.pushes.check_option(checked["pushes"])
        plan.randomization.check(checked.get("parameters", {}), self.engine.substeps)
        if "gait" in checked or "crank_angle" in checked:
            self._check_raised({**self.usual_start, **checked})
        return checked

    def reset(
        self, envs: Sequence[int] | Index, generators: Generators, options: Mapping[str, Any]
    ) -> dict[str, Floats]:
        """Start episodes in `envs`, with a generator for each and options of `check_options`. Return the
        "parameters" that were drawn or set, by name, shape (len(envs),)."""
        which = np.asarray(envs, np.int64)
        if self.row_plans.are_due(which):
            self._adopt(which)
        if self.row_plans.are_mixed:
            each = dict(zip(which.tolist(), generators, strict=True))
            drawn: dict[str, Floats] = {}

            def begin(group: Index) -> None:
                values = self._start(group, [each[row] for row in group.tolist()], options)
                at = np.isin(which, group)
                for name, of_rows in values.items():
                    drawn.setdefault(name, np.full(len(which), np.nan))[at] = of_rows

            self.under_each(which, begin)
            return drawn
        # A start evaluates its neighbours again, too, and with pushes that are unseen.
        if self.is_push_unseen:
            with self.only(which):
                return self._start(which, generators, options)
        return self._start(which, generators, options)

    def _checked_start(self) -> dict[str, Any]:
        """Return the task's own reset options, in the form that `_start` takes, but for those that a setting
        replaces: a gait; a kind of trunk that keeps its height or stands still; or a leg that cannot have
        them, which starts as on an id without such options.

        Raises:
            ParameterError: an option that this body, trunk or leg cannot have.
        """
        settings, start = self.plan.asked, dict(self.task.start)
        meant = self.task.start_for or self.task.settings({})
        if settings.gait is not None:
            start.pop("gait", None)
        if settings.trunk != meant.trunk:
            held = {"fixed": ("height", "speed"), "rail": ("height",)}
            for name in held.get(settings.trunk, ()):
                start.pop(name, None)
        has_other_leg = any(getattr(settings, name) != getattr(meant, name) for name in OF_LEG)
        try:
            # A trunk that is held is not raised for a gait that reaches below it
            is_held = self.engine.trunk.kind not in RISING
            if has_other_leg and ((is_held and "gait" in start) or not self._can_start(start)):
                for name in OF_POSTURE:
                    start.pop(name, None)
            checked = self._check_usual(start)
            self._check_raised(checked)
            return checked
        except ParameterError as error:
            raise ParameterError(f"{self.task.id}: start: {error}") from None

    def _check_usual(self, start: Mapping[str, Any]) -> dict[str, Any]:
        """Check reset options of a task's own; return them in the form that `_start` takes."""
        checked = self._check_options(start)
        if isinstance(checked.get("height"), tuple):
            checked["height"] = UsualRange(checked["height"])
        return checked

    def _can_start(self, start: Mapping[str, Any]) -> bool:
        """Return True if this leg can start with a task's own reset options at all of their crank angles."""
        try:
            checked = self._check_usual(start)
        except ParameterError:
            return False
        return self.plan.body.startable_share(checked, self.engine.trunk) == 1.0

    def _check_raised(self, options: Mapping[str, Any]) -> None:
        """Check that episodes can start with options, their trunk raised until no hoof is in level ground.

        Raises:
            ParameterError: the trunk would be too high at all of the crank angles.
        """
        if self.plan.body.startable_share(options, self.engine.trunk) == 0.0:
            given = {name: options[name] for name in ("gait", "crank_angle") if name in options}
            raise ParameterError(
                "options: expected a gait and a crank_angle in which the hoof is so little below O that an"
                " episode starts above the ground and below a height of"
                f" {float(self.plan.record['highest'][0]):.4g} m, where it fails, got {brief(given)}"
            )

    def _start(self, which: Index, generators: Generators, options: Mapping[str, Any]) -> dict[str, Floats]:
        """Start episodes under the present plan; see `reset`. A seed's meaning includes the order of the
        draws from its generator."""
        plan, rows, engine = self.plan, self.rows, self.engine
        options = {**self.usual_start, **options}
        self.unpushed = {env: values for env, values in self.unpushed.items() if env not in which}
        rows.steps_before[which] += rows.named.steps[which]
        drawn = self._draw_parameters(which, generators, options.get("parameters", {}))
        gaits: Any = options.get("gait")
        # Gaits of all environments, of which only some start.
        if np.ndim(gaits) == 2:
            options = {**options, "gait": gaits[which]}
        start = plan.body.draw(options, generators, engine)
        self._clear(which)
        for feature in plan.features:
            feature.begin(rows, which, generators, options)
        plan.body.complete_start(start, rows.named.target[which], options, engine)
        engine.reset(start.commands, start.theta, envs=which, **start.trunk)
        # Other rows may draw parameters that these do not.
        missing = np.full(len(which), np.nan)
        own = [drawn[name] if name in plan.randomization.ranges else missing for name in self.drawn_names]
        values = [start.values[name] for name in plan.body.start_names]
        rows.start_values[:, which] = [*values, *start.gaits.T, *own]
        rows.named.x_before[which] = start.trunk["x"]
        plan.body.begin_episodes(rows.named, which, start)
        # Whole groups of lanes, from the first environment's to the last one's: kernels take no parts.
        begin, end = (int(row) // LANES * LANES for row in (which.min(), which.max() + LANES))
        groups = range(begin, min(engine.columns, end))
        self.observe(groups)
        if plan.delays.fill_past(rows, which):
            # Again, with the first observation as the whole past.
            self.observe(groups)
        return drawn

    def _draw_parameters(
        self, which: Index, generators: Generators, of_options: Mapping[str, Any]
    ) -> dict[str, Floats]:
        """Draw the physical parameters of some rows; return them by name."""
        randomization = self.plan.randomization
        names = {**randomization.ranges, **of_options}
        drawn = {name: np.zeros(len(which)) for name in names}
        # Also without parameters if the last episode had some: they were for that one only.
        if names or self.rows.has_overrides[which].any():
            for k, (env, generator) in enumerate(zip(which.tolist(), generators, strict=True)):
                values = randomization.draw(self.rows, env, generator, of_options, self.engine)
                for name, value in values.items():
                    drawn[name][k] = value
            self.rows.has_overrides[which] = bool(names)
        return drawn

    def _clear(self, which: Index) -> None:
        """Set the counters and memories of rows to their values at the start of an episode."""
        episode = self.rows.named
        for row in (episode.steps, episode.time, episode.distance, episode.commanded, episode.ended):
            row[which] = 0.0
        self.rows.rewards[which] = 0.0
        # The full allowance: a leg can bear its weight from the first step on.
        episode.allowance[which] = BEARING * MAX_STRIDE
        episode.terms[:, which] = 0.0
        self.rows.unweighted[:, which] = 0.0
        episode.sums[:, which] = 0.0
        begins = [row.initial for term in self.task.terms for row in term.state]
        if begins:
            episode.own[:, which] = np.array(begins)[:, None]

    # Steps

    def step(self, generators: Generators, idle: NDArray[np.bool_] | None = None) -> bool:
        """Take one control step under `rows.actions`; return True if any episode ended. Nothing is drawn for
        `idle` environments, shape (num_envs,), which are between two episodes.

        Raises:
            ParameterError: an action is not finite; no environment was advanced then.
        """
        return self.end_step(self.run_kernels(), generators, idle)

    def end_step(self, happened: int, generators: Generators, idle: NDArray[np.bool_] | None = None) -> bool:
        """Do the rest of a `step` after `run_kernels`."""
        if self.plan.costs.names:
            self.plan.costs.add(self.rows, self.engine)
        # A step between two episodes does not count.
        if idle is not None:
            self.rows.named.steps[: self.num_envs][idle] -= 1.0
        return self.finish_step(happened, generators, idle)

    def run_kernels(self) -> int:
        """Run the kernels of a `step` under `rows.actions`; return the code; see `step.NOT_A_NUMBER`."""
        if self.row_plans.differ:
            everywhere = np.arange(self.num_envs)
            codes = self.under_each(everywhere, lambda group: self._step(), for_kernels=True)
            return int(np.bitwise_or.reduce(codes))
        return self._step()

    @property
    def is_plain(self) -> bool:
        """True if a step under the present plans is one call of `direct_step`, and nothing follows it while
        the code is 0 and nothing `has_pushed`."""
        checks = self.plan.observed.has_user_entries or self.rows.mapped is not None
        is_alone = self.engine.in_kernels and self.engine.num_threads == 1
        return is_alone and not (self.row_plans.differ or self.plan.costs.limits or checks)

    @property
    def has_pushed(self) -> bool:
        """True if a trunk was pushed since the last step."""
        return self.is_push_unseen or bool(self.unpushed)

    def _step(self) -> int:
        """Run the kernel on all rows, shared among threads; return its code; see `step.NOT_A_NUMBER`."""
        # Every thread checks all actions: all return NOT_A_NUMBER, which is -1, or none does.
        calls = self.calls
        return int(np.bitwise_or.reduce(run_together(calls.step, calls.blocks, self.engine.num_threads)))

    def finish_step(
        self, happened: int, generators: Generators, idle: NDArray[np.bool_] | None = None
    ) -> bool:
        """Finish a `step` after its kernels, which returned the code `happened`, and after its costs."""
        if happened == NOT_A_NUMBER:
            raise ParameterError("action: expected finite numbers, got NaN or infinity")
        self._check_mapped()
        # The engine put failed environments back to their last good state; the kernel observed the failure.
        if happened & SOME_ENDED:
            put_back = np.flatnonzero(broken(self.engine.results))
            if put_back.size and self.row_plans.differ:
                self.under_each(put_back, self._observe_broken, for_kernels=True)
            elif put_back.size:
                self._observe_broken(put_back)
        self.is_push_unseen = False
        self.unpushed = {}
        named = self.rows.named
        each = (
            (SOME_SWITCHED, named.switch, self._switch_due),
            (SOME_PUSHED, named.push_at, self._push_due),
        )
        for code, at, act in each:
            if happened & code:
                is_due = (named.steps >= at)[: self.num_envs]
                due = np.flatnonzero(is_due if idle is None else is_due & ~idle)
                act(due, {env: generators[env] for env in due.tolist()})
        return bool(happened & SOME_ENDED)

    def _switch_due(self, due: Index, generators: Mapping[int, np.random.Generator]) -> None:
        """Draw the next commanded speeds of rows in which another one is commanded now."""
        for plan, group in self.row_plans.groups(due):
            plan.commands.draw_next(self.rows, group, [generators[env] for env in group.tolist()])

    def _push_due(self, due: Index, generators: Mapping[int, np.random.Generator]) -> None:
        """Push the trunks of some rows as planned, and plan their next pushes."""
        episode = self.rows.named
        measured = self.measurements.read(self.engine.arrays[0][:, due])
        self.unpushed = dict(zip(due.tolist(), measured.T, strict=True))
        forward, upward = episode.strength[due] * episode.next_push[:, due]
        self.engine.push(forward, upward, due)
        self.is_push_unseen = True
        for plan, group in self.row_plans.groups(due):
            plan.pushes.plan_next(self.rows, group, [generators[env] for env in group.tolist()])

    def push(self, forward: ArrayLike, upward: ArrayLike, envs: ArrayLike | None) -> None:
        """Push the trunks of some rows now; see `LegBase.push`.

        Raises:
            ParameterError: an impulse is not finite or of the wrong shape, or the trunk cannot be pushed.
        """
        self.plan.pushes.check_trunk("push", upward=bool(np.any(upward)))
        self.engine.push(forward, upward, envs)
        self.is_push_unseen = True

    def _step_between(self, held: Held) -> int:
        """Take a control step with an engine between the kernels; return the code of a step."""
        if not self.calls.kernels.apply(held):
            return NOT_A_NUMBER
        self.engine.take_step(self.plan.substeps)
        happened: int = self.calls.kernels.finish(held)
        return happened

    def _observe_broken(self, envs: Index) -> None:
        """Observe environments that could not be simulated again: their state is the last good one, but their
        report is still of the point of failure."""
        self.engine.observe_again(envs)
        # NaN at the point of failure, with which a state would be refused
        self.rows.named.x_before[envs] = self.engine.report["x"][envs]
        self.observe()

    # Observations

    def observe(self, columns: range | None = None) -> None:
        """Observe all rows, or the rows of some columns, without a step."""
        self.calls.kernels.observe(self.calls.held if columns is None else self.calls.held.on(columns))

    def observe_all(self) -> None:
        """Observe the state of all rows, each under its plan; where plans differ with forces on the present
        ground."""
        if not self.row_plans.differ:
            self.observe()
            return

        def look(group: Index) -> None:
            self.engine.observe()
            self.observe()

        self.under_each(np.arange(self.num_envs), look, for_kernels=True)

    def measured(self) -> dict[str, Floats]:
        """Return the observation, true and before scaling: entries by name, shape (num_envs,) each."""
        # The present frame has the first columns
        names = self.plan.observation_names[: len(self.plan.observed.entries)]
        out = np.zeros((len(names), self.num_envs))
        if self.row_plans.differ:
            # The kernel measures all rows; only rows under the present plan are right.
            def measure(group: Index) -> None:
                measured = np.zeros_like(out)
                self._measure(measured)
                out[:, group] = measured[:, group]

            self.under_each(np.arange(self.num_envs), measure, for_kernels=True)
        else:
            self._measure(out)
        return dict(zip(names, out, strict=True))

    def _measure(self, out: Floats) -> None:
        kernel = self.calls.kernels.measure
        kernel(self._hold(kernel, self.plan, range(out.shape[1]), measured=out))

    def check_observed(self) -> None:
        """Check that entries from outside gave numbers; the package's own entries do.

        Raises:
            ParameterError: one gave NaN.
        """
        seen = self.rows.observations[: self.num_envs]
        if not self.plan.observed.has_user_entries or not np.isnan(seen).any():
            return
        env, column = np.argwhere(np.isnan(seen))[0].tolist()
        raise ParameterError(
            f"entry {self.plan.observation_names[column]!r}: expected a number, got NaN in environment {env},"
            f" after {self.rows.named.steps[env]:g} steps"
        )

    def _check_mapped(self) -> None:
        """Check that a map of actions from outside gave numbers.

        Raises:
            ParameterError: it gave NaN.
        """
        mapped, action_map = self.rows.mapped, self.task.action_map
        if mapped is None or not action_map or not np.isnan(mapped[: self.num_envs]).any():
            return
        env, k = np.argwhere(np.isnan(mapped[: self.num_envs]))[0].tolist()
        raise ParameterError(
            f"{action_map.title}: expected numbers, got NaN for action {k} of the body in environment {env}"
        )

    def alone(self, env: int) -> TrunkEngine:
        """Make an engine of one environment, under the plan of the environment `env`."""
        if not self.row_plans.are_mixed:
            return self.engine.alone()
        (engine,) = self.under_each(np.array([env]), lambda group: self.engine.alone())
        alone: TrunkEngine = engine
        return alone

    # Kernels

    def _open(self) -> None:
        """Find kernels and the addresses of arrays in this process."""
        self._calls = {}
        self.calls = self._calls_of(self.plan)

    def _calls_of(self, plan: Plan) -> Calls:
        """Return the kernels of a plan with their arguments."""
        if plan not in self._calls:
            self._calls[plan] = self._new_calls(plan)
        return self._calls[plan]

    def _new_calls(self, plan: Plan) -> Calls:
        kernels = self._kernels_of(plan)
        held = self._hold(kernels.observe, plan, range(self.engine.columns))
        step = kernels.step if self.engine.in_kernels else self._step_between
        return Calls(kernels, step, held, [(held.on(block),) for block in self.engine.blocks])

    def _hold(self, kernel: Kernel, plan: Plan, columns: range, **more: NDArray[Any]) -> Held:
        """Return the arrays as the argument of a kernel that works on some columns."""
        rows = self.rows
        acted = rows.actions if rows.acted is None else rows.acted
        arrays = (
            *self.engine.arrays_of(plan.mechanics),
            rows.episode,
            plan.record,
            rows.actions,
            rows.observations,
            rows.rewards,
            acted,
            rows.past_actions,
            rows.frames,
            acted if rows.mapped is None else rows.mapped,
            rows.unweighted,
        )
        held: Held = kernel.parameters[0].hold(dict(zip(ALL_ARRAYS, arrays, strict=True)) | more, columns)
        return held

    def _kernels_of(self, plan: Plan) -> StepKernels:
        """Return the kernels of a plan. Copies of the batch share them, too: kernels with a function from
        outside are traced again, which takes time."""
        kind = self._kind_of(plan)
        if kind not in self._kernels:
            self._kernels[kind] = step_kernels(kind, self.engine.runs_scalar)
        return self._kernels[kind]

    def _kind_of(self, plan: Plan) -> TaskKind:
        return TaskKind(
            self.task.terms,
            self.task.entries,
            plan.body.kernels,
            self.task.action_map,
            _engine_kind(plan.mechanics, self.task),
            known_of(plan.record),
        )

    @property
    def task_kind(self) -> TaskKind:
        """Kind of the task under the present plan."""
        return self._kind_of(self.plan)

    def _compile(self, kernels: StepKernels) -> None:
        """Compile or load every kernel of a step, and of entries from outside the one that measures them:
        compiled later, it might follow from constants that have changed since.

        Raises:
            ParameterError: a function from outside cannot be part of them.
        """
        try:
            around = kernels.apply, kernels.finish
            for kernel in (kernels.step,) if self.engine.in_kernels else around:
                kernel.compile()
            kernels.observe.compile()
            if self.plan.observed.has_user_entries:
                kernels.measure.compile()
            self.engine.compile()
        except UserFunctionError as error:
            raise user_error(self.task.id, error) from None

    def direct_step(self) -> Any:
        """Return `calls.step` as machine code, without the cost of a call in Python. It must be called with
        `calls.held` only, as it checks no types."""
        if not self.engine.in_kernels:
            return self.calls.step
        kernel = self.calls.kernels.step
        if kernel.call is None:  # in a process that unpickled the batch
            kernel.compile()
        return kernel.call

    # Copies

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a pickle: without kernels and addresses, which belong to one process."""
        return {**vars(self), "row_plans": self.row_plans.copy(), "_kernels": {}, "_calls": {}, "calls": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.rows.open(self.plan.layout)
        self._open()

    def __deepcopy__(self, memo: dict[int, Any]) -> EpisodeBatch:
        """Return a copy, which shares what never changes: planners copy at every node of their tree."""
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        twin.engine = copy.deepcopy(self.engine, memo)
        twin.rows = self.rows.copy()
        twin.row_plans = self.row_plans.copy()
        twin._open()
        return twin


def _engine_kind(mechanics: Mechanics, task: Task) -> EngineKind:
    """Return the kind of an engine with some mechanics."""
    return EngineKind(mechanics.features, task.contact_law, static_of(mechanics.model[0]))

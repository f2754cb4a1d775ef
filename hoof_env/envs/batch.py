"""Episodes of a task, one or many at once, for the single and the vector environment.

`EpisodeBatch` works with arrays and generators and does not depend on Gymnasium. A row has the same bits for
any number of neighbours: its starts are drawn from its own generator, and the kernels are those of `step`,
compiled for one environment or for several side by side. Functions on batches are in `batch_build`,
`batch_reports`, `batch_starts` and `batch_states`.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import broken
from hoof_env.envs.batch_build import (
    check_choices,
    check_delays,
    check_paper,
    check_vary,
    make_engine,
    make_memory,
    make_paper,
    task_record,
)
from hoof_env.envs.batch_changes import BatchChanges
from hoof_env.envs.batch_kernels import BatchKernels
from hoof_env.envs.batch_pushes import check_disturbances, push_due
from hoof_env.envs.batch_starts import draw_targets, start
from hoof_env.envs.conditions import (
    RowConditions,
    keep_others,
    under_each,
)
from hoof_env.envs.step import NOT_A_NUMBER, SOME_ENDED, SOME_PUSHED, SOME_SWITCHED
from hoof_env.errors import ParameterError, check_number
from hoof_env.simd.threads import run_together
from hoof_env.tasks.delays import Delay
from hoof_env.tasks.disturbances import Push
from hoof_env.tasks.episode import episode_layout
from hoof_env.tasks.observation import check_groups, groups_of
from hoof_env.tasks.own_parts import check_constants, constants_of, own_of
from hoof_env.tasks.parameters import (
    check_drift,
    check_parameters,
    check_range,
    make_terrain,
    resolved,
    substeps_of,
)
from hoof_env.tasks.registry import Task
from hoof_env.tasks.reward import check_weights
from hoof_env.tasks.schedules import SPEED, STRENGTH, check_schedule
from hoof_env.tasks.settings import Settings

Floats = NDArray[np.float64]

LONGEST_EPISODE = 1e6  # largest `episode_seconds` [s]

COPIED = (
    "engine",
    "has_overrides",
    "push_plans",
    "steps_before",
    "start_values",
    "episode",
    "actions",
    "observations",
    "rewards",
    "frames",
    "past_actions",
    "task_record",
)
"""Attributes of an `EpisodeBatch` that change in place, which a copy must have for itself."""

FOUND_AGAIN = (
    "held",
    "_blocks",
    "_chosen",
    "entries",
    "true_entries",
    "kernel",
    "measurements",
    "episode_rows",
    "kernels",
)
"""Attributes of an `EpisodeBatch` that belong to one process: addresses, kernels and views."""


class EpisodeBatch(BatchKernels, BatchChanges):
    """`num_envs` episodes of a task.

    Attributes:
        asked: settings as asked for; `settings` has values in place of None.
        body: one leg, or a horse.
        engine: engine of all episodes. Memory and arrays have `engine.columns` columns; the last may be idle.
        names: names of the observation's entries.
        terms: keys of the reward's terms in infos.
        episode: memory of the episodes, rows as in `episode.Episode`, shape (rows, columns).
        actions, observations, rewards: input and output of a step, of shapes (columns, actions), (columns,
            numbers) and (columns,).
        frames, past_actions, acted: see `batch_build.make_memory`.
        task_record: constants of the task that the kernels read, shape (1,), see `episode.task_type`.
        start_values: the body's `start_names`, the gait, and the values drawn by `randomize`, shape (numbers,
            num_envs); NaN where a state does not contain them.
        push_plans: pushes that were given for the present episode of each row, in the order of their times.
        steps_before: control steps of each row in earlier episodes, from which schedules follow, shape
            (num_envs,).
        is_push_unseen: True if a trunk was pushed since the last step, which no observation shows yet.
        unpushed: what was measured at the end of the last step, by row, of those that were due to be pushed.
        kept_begins: values of the rows that terms keep at the start of an episode.
        schedule: courses of scheduled settings by name; `randomize` has their ranges, too.
        drawn_names: names of the parameters that any row draws, in the order of `start_values`.
        conditions: conditions of the rows.
        paper: solver of the paper, None with the engine's kernels.

    Kernels and their attributes are those of `BatchKernels`.

    Args:
        task: task of all episodes.
        settings: settings of the task, see `Task.settings`.
        num_envs: number of episodes.
        num_threads: number of threads that share the episodes in a step.
        runs: False for a batch that is never stepped, for which no kernel is compiled.

    Raises:
        ParameterError: a setting is out of range or of the wrong type, or a function cannot be compiled.
    """

    def __init__(
        self, task: Task, settings: Settings, num_envs: int, num_threads: int = 1, *, runs: bool = True
    ) -> None:
        self.task = task
        self.num_envs = num_envs
        self.asked = settings
        self.conditions = RowConditions(num_envs)
        self.settings = resolved(settings)
        self._check_settings()
        self.engine = make_engine(self, num_threads)
        self.paper = make_paper(self.settings, self.engine, self.substeps)
        self._allocate()
        self._open()
        self.episode_rows.weight[:] = self.engine.weight
        # Columns without an environment never switch, so that they cause no draw.
        self.episode_rows.switch[:] = np.inf
        self.episode_rows.push_at[:] = np.inf
        if runs:
            self._compile(self.kernels)

    def _check_settings(self) -> None:
        """Check the settings, and set the attributes that follow from them."""
        s = self.settings
        task = self.task
        self.action_delay: Delay
        check_choices(s)
        self.randomize = {} if s.randomize is None else check_parameters("randomize", s.randomize, s)
        self.terrain = make_terrain(s.terrain)
        # The last parameters that `batch_starts.check_extremes` found good, as text.
        self.validated = ""
        if s.solver == "paper":
            check_paper(s)
        self.body = task.body(s)
        self.legs = self.body.kernels.legs
        check_drift(self.terrain, s.terrain, s.trunk, self.body.height)
        self.terms = tuple(term.key for term in task.terms)
        self.weights = check_weights(s.reward_weights, task.terms)
        self.constants = check_constants(s.constants, constants_of(task.terms, task.entries))
        self.substeps = substeps_of(s.dt, s.sim_dt)
        self.dt = s.sim_dt * self.substeps
        # An episode of one step is allowed, whatever the rounding of dt.
        shortest = self.dt * (1 - 1e-9)
        self.episode_seconds = check_number(
            "episode_seconds", s.episode_seconds, low=shortest, high=LONGEST_EPISODE
        )
        self.steps_per_episode = round(s.episode_seconds / self.dt)
        self.groups = check_groups(s.observation, groups_of(task.entries))
        self.target_speed = self.body.commanded_speeds(s)
        self.schedule = check_schedule(s.schedule, s, self.body)
        for name, course in self.schedule.items():
            if name == SPEED:
                self.target_speed = course.hull
            elif name != STRENGTH:
                self.randomize[name] = course.hull
        self.speed_changes = self.target_speed is not None and self.target_speed[0] < self.target_speed[1]
        shortest = self.dt if self.speed_changes else 0.0
        self.target_seconds = check_range("target_seconds", s.target_seconds, shortest)
        check_disturbances(self)
        check_delays(self)
        check_vary(self)

    def _allocate(self) -> None:
        """Make the arrays of all episodes."""
        self.has_overrides = np.zeros(self.num_envs, bool)
        self.push_plans: list[tuple[Push, ...]] = [()] * self.num_envs
        self.steps_before = np.zeros(self.num_envs)
        self.kept_begins = np.array([row.begin for term in self.task.terms for row in term.keeps])
        self.is_push_unseen = False
        self.unpushed: dict[int, Floats] = {}
        self.drawn_names = [*self.randomize]
        self.start_values = np.full((self.start_row_count + len(self.randomize), self.num_envs), np.nan)
        self.episode = np.zeros((self.layout.size, self.engine.columns))
        self.rewards = np.zeros(self.engine.columns)
        make_memory(self)
        self.task_record = task_record(self)

    start_row_count = property(lambda self: len(self.body.start_names) + len(self.body.gait_names))
    """Number of the start values of an episode, without those drawn by `randomize`."""

    @property
    def layout(self) -> Any:
        """Layout of an episode's memory."""
        terms = len(self.task.terms)
        own = own_of(self.task.terms, self.task.entries)
        return episode_layout(self.body.kernels.episode, terms, self.engine.features, self.legs, own)

    # Episodes

    def limit(self, steps: int) -> None:
        """Truncate episodes after `steps` control steps, if they are not shorter already."""
        self.steps_per_episode = min(steps, self.steps_per_episode)
        self.task_record["episode_steps"] = self.steps_per_episode

    def reset(
        self,
        envs: Sequence[int] | NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> dict[str, Floats]:
        """Start episodes in `envs`, with a generator for each and options of `batch_starts.check_options`.
        Return the "parameters" that were drawn or set, by name, shape (len(envs),)."""
        which = np.asarray(envs, np.int64)
        if self.conditions.are_due(which):
            self._adopt(which)
        if self.conditions.are_mixed:
            each = dict(zip(which.tolist(), generators, strict=True))
            drawn: dict[str, Floats] = {}

            def begin(rows: NDArray[np.int64]) -> None:
                values = start(self, rows, [each[row] for row in rows.tolist()], options)
                at = np.isin(which, rows)
                for name, of_rows in values.items():
                    drawn.setdefault(name, np.full(len(which), np.nan))[at] = of_rows

            under_each(self, which, begin)
            return drawn
        # A start evaluates its neighbours again, too, and with pushes that are unseen.
        if self.is_push_unseen:
            return keep_others(self, which, lambda: start(self, which, generators, options))
        return start(self, which, generators, options)

    def step(self, generators: Sequence[np.random.Generator], idle: NDArray[np.bool_] | None = None) -> bool:
        """Take one control step under `actions`; return True if any episode ended. Nothing is drawn for
        `idle` environments, shape (num_envs,), which are between two episodes.

        Raises:
            ParameterError: an action is not finite; no environment was advanced then.
        """
        if self.conditions.differ:
            all_rows = np.arange(self.num_envs)
            codes = under_each(self, all_rows, lambda rows: self._step(), for_kernels=True)
            happened = np.bitwise_or.reduce(codes)
        else:
            happened = self._step()
        # A step between two episodes is none.
        if idle is not None:
            self.episode_rows.steps[: self.num_envs][idle] -= 1.0
        return self.finish_step(int(happened), generators, idle)

    def _step(self) -> int:
        """Run the kernel on all rows, shared among threads; return its code, see `step.NOT_A_NUMBER`."""
        # Every thread checks all actions: all return NOT_A_NUMBER, which is -1, or none does.
        code: int = np.bitwise_or.reduce(run_together(self.kernel, self._blocks, self.engine.num_threads))
        return code

    def finish_step(
        self, happened: int, generators: Sequence[np.random.Generator], idle: NDArray[np.bool_] | None = None
    ) -> bool:
        """Finish a `step` after its kernel, which returned the code `happened`."""
        if happened == NOT_A_NUMBER:
            raise ParameterError("action: expected finite numbers, got some that are not")
        self.check_mapped()
        # The engine put failed environments back to their last good state; the kernel observed what failed.
        if happened & SOME_ENDED and not self.paper:
            put_back = np.flatnonzero(broken(self.engine.results))
            if put_back.size and self.conditions.differ:
                under_each(self, put_back, self._observe_broken, for_kernels=True)
            elif put_back.size:
                self._observe_broken(put_back)
        self.is_push_unseen = False
        self.unpushed = {}
        rows = self.episode_rows
        each = (SOME_SWITCHED, rows.switch, draw_targets), (SOME_PUSHED, rows.push_at, push_due)
        for code, at, act in each:
            if happened & code:
                due = (rows.steps >= at)[: self.num_envs]
                due = np.flatnonzero(due if idle is None else due & ~idle)
                act(self, due, [generators[env] for env in due.tolist()])
        return bool(happened & SOME_ENDED)

    # State

    @property
    def ended_row(self) -> int:
        """Row of `Episode.ended` in the memory of the episodes."""
        row: int = self.layout.rows("ended").start
        return row

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes that can be pickled; `__setstate__` finds the others again."""
        return {key: value for key, value in vars(self).items() if key not in FOUND_AGAIN}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Set the attributes, and find kernels and arrays of this process."""
        vars(self).update(state)
        # A pickle keeps no identity of arrays that are equal.
        self.acted = self.acted if self.past_actions.size else self.actions
        self.mapped = self.mapped if self.task.action_map else self.acted
        self.conditions = self.conditions.copied()
        self._open()

    def __deepcopy__(self, memo: dict[int, Any]) -> EpisodeBatch:
        """Copy the batch. The copy shares what never changes: planners copy at every node of their tree."""
        made = object.__new__(type(self))
        vars(made).update(vars(self))
        for name in COPIED:
            setattr(made, name, copy.deepcopy(getattr(self, name), memo))
        made.acted = made.actions if self.acted is self.actions else self.acted.copy()
        made.mapped = made.acted if self.mapped is self.acted else self.mapped.copy()
        # The solver refers to the engine, and the kernel is a method of the batch: both to those of the copy.
        if self.paper:
            made.paper = copy.deepcopy(self.paper, memo | {id(self.engine): made.engine})
            made.kernel = made._step_paper
        made.conditions = self.conditions.copied()
        made.find()
        return made

"""Kernels of a batch of episodes: choice, compilation, and calls other than a step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.advance import EngineKind
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.layout import engine_layout
from hoof_env.dynamics.model import static_of
from hoof_env.envs.batch_build import find_entries
from hoof_env.envs.conditions import Conditions, under_each
from hoof_env.envs.infos import InfoLayout
from hoof_env.envs.scene import ALL_ARRAYS, TaskKind, functions_of, is_from_outside, known_of
from hoof_env.envs.step import NOT_A_NUMBER, StepKernels, step_kernels
from hoof_env.errors import ParameterError
from hoof_env.simd.compile import Kernel
from hoof_env.simd.layout import views
from hoof_env.simd.memory import Held
from hoof_env.simd.user_functions import UserFunctionError, user_error

Floats = NDArray[np.float64]


class BatchKernels:
    """Kernels of an `EpisodeBatch`, and the arrays that they work on.

    Attributes:
        kernel, held: `kernel(held)` is one control step of all episodes; `finish_step` follows.
        kernels: all kernels of the task, `step.StepKernels`.
        episode_rows: views of the episodes' memory by name.
        entries: entries that are observed.
        has_own_entries: True if an entry that is observed is from outside the package.
        measurements: places of the values in the engine's memory that infos contain.
    """

    # Attributes of the subclass that the methods here read.

    task: Any
    settings: Any
    engine: Any
    body: Any
    paper: Any
    legs: int
    groups: Any
    names: list[str]
    num_envs: int
    conditions: Any
    layout: Any
    episode: Any
    task_record: Any
    entries: Any
    true_entries: Any
    actions: Any
    acted: Any
    mapped: Any
    past_actions: Any
    frames: Any
    observations: Any
    rewards: Any

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions."""
        own = self.task.action_map
        names: tuple[str, ...] = own.names if own else self.body.action_names
        return names

    @property
    def action_form(self) -> str:
        """Tag of the meaning of actions."""
        own = self.task.action_map
        form: str = own.form if own else self.body.action_form
        return form

    def _open(self) -> None:
        """Find the kernels, and the addresses of the arrays in this process."""
        find_entries(self)
        functions = [part for entry in (*self.entries, *self.true_entries) for part in functions_of(entry)]
        self.has_own_entries = any(map(is_from_outside, functions))
        self.measurements = InfoLayout(self.engine.features, tuple(self.body.hips))
        # copies share them, too: kernels with a function from outside are made anew, which takes time
        self._chosen: dict[TaskKind, StepKernels] = {}
        self.find()

    def _kernels_for(self, record: NDArray[Any], model: NDArray[Any]) -> StepKernels:
        """Return the kernels for what is known of records of the task and of the engine's model."""
        # few environments, or the paper's solver, which works on the engine's memory between two kernels
        is_scalar = bool(self.engine.runs_scalar or self.paper)
        kind = TaskKind(
            self.task.terms,
            self.task.entries,
            self.body.kernels,
            self.task.action_map,
            EngineKind(self.engine.features, self.task.contact_law, static_of(model)),
            known_of(record),
        )
        if kind not in self._chosen:
            self._chosen[kind] = step_kernels(kind, is_scalar)
        return self._chosen[kind]

    def prepare(self, conditions: Conditions) -> None:
        """Compile or load the kernels of conditions that rows will be under.

        Raises:
            ParameterError: a function from outside cannot be part of them.
        """
        self._compile(self._kernels_for(conditions["task_record"], conditions["mechanics"].model[0]))

    def find(self) -> None:
        """Find kernels and arrays for calls, after any of them was replaced."""
        self.episode_rows = views(self.layout, self.episode)
        self.kernels = self._kernels_for(self.task_record, self.engine.arrays[1])
        self.kernel = self._step_paper if self.paper else self.kernels.step
        # a block of columns for each thread; the paper's solver runs on one, with all of them
        blocks = [range(self.engine.columns)] if self.paper else self.engine.blocks
        self.held = self._hold(range(self.engine.columns))
        self._blocks = [(self.held.on(block),) for block in blocks]

    def _hold(self, columns: range, kernel: Kernel | None = None, **more: NDArray[Any]) -> Held:
        """Return the arrays as the argument of a kernel that works on some columns."""
        arrays = (
            *self.engine.arrays,
            self.episode,
            self.task_record,
            self.actions,
            self.observations,
            self.rewards,
            self.acted,
            self.past_actions,
            self.frames,
            self.mapped,
        )
        named = dict(zip(ALL_ARRAYS, arrays, strict=True)) | more
        held: Held = (kernel or self.kernels.observe).parameters[0].hold(named, columns)
        return held

    def observe(self, columns: range | None = None) -> None:
        """Observe all rows, or those of some columns, without a step."""
        self.kernels.observe(self.held if columns is None else self.held.on(columns))

    def check_mapped(self) -> None:
        """Check that a map of actions from outside gave numbers.

        Raises:
            ParameterError: it gave NaN.
        """
        if not self.task.action_map or not np.isnan(self.mapped[: self.num_envs]).any():
            return
        env, k = np.argwhere(np.isnan(self.mapped[: self.num_envs]))[0].tolist()
        raise ParameterError(
            f"{self.task.action_map.title}: expected numbers, got NaN for action {k} of the body in"
            f" environment {env}"
        )

    def check_observed(self) -> None:
        """Check that entries from outside gave numbers; those of this package do.

        Raises:
            ParameterError: one gave NaN.
        """
        if not self.has_own_entries or not np.isnan(self.observations[: self.num_envs]).any():
            return
        env, column = np.argwhere(np.isnan(self.observations[: self.num_envs]))[0].tolist()
        raise ParameterError(
            f"entry {self.names[column]!r}: expected a number, got NaN in environment {env}, after"
            f" {self.episode_rows.steps[env]:g} steps"
        )

    def _compile(self, kernels: StepKernels) -> None:
        """Compile or load every kernel of a step, and of entries from outside the one that measures them:
        made later, it might follow from constants that have changed since.

        Raises:
            ParameterError: a function from outside cannot be part of them.
        """
        try:
            for kernel in (kernels.apply, kernels.finish) if self.paper else (kernels.step,):
                kernel.compile()
            kernels.observe.compile()
            if self.has_own_entries:
                kernels.measure.compile()
            self.engine.compile()
        except UserFunctionError as error:
            raise user_error(self.task.id, error) from None

    def _measure(self, out: Floats) -> None:
        self.kernels.measure(self._hold(range(out.shape[1]), self.kernels.measure, measured=out))

    def direct_kernel(self) -> Any:
        """Return `kernel` as machine code, without what a call of it costs in Python. It must be called with
        `held` only, as it checks no types."""
        if self.paper:
            return self.kernel
        if self.kernels.step.call is None:  # in a process that unpickled the batch
            self.kernels.step.compile()
        return self.kernels.step.call

    def _step_paper(self, held: Held) -> int:
        """Take a control step with the paper's solver between the kernels; return the code of a step."""
        assert self.paper
        if not self.kernels.apply(held):
            return NOT_A_NUMBER
        self.paper.advance()
        happened: int = self.kernels.finish(held)
        return happened

    def measured(self) -> dict[str, Floats]:
        """Return what is observed, true and before scaling: entries by name, shape (num_envs,) each."""
        names = [entry.name for entry in self.entries]
        out = np.zeros((len(names), self.num_envs))
        if self.conditions.differ:
            # The kernel measures all rows; only those under the present conditions are right.
            def measure(rows: NDArray[np.int64]) -> None:
                measured = np.zeros_like(out)
                self._measure(measured)
                out[:, rows] = measured[:, rows]

            under_each(self, np.arange(self.num_envs), measure, for_kernels=True)
        else:
            self._measure(out)
        return dict(zip(names, out, strict=True))

    def alone(self, env: int) -> TrunkEngine:
        """Make an engine of one environment, under the conditions of the environment `env`."""
        if not self.conditions.are_mixed:
            return self.engine.alone()
        (engine,) = under_each(self, np.array([env]), lambda rows: self.engine.alone())
        made: TrunkEngine = engine
        return made

    def _observe_broken(self, envs: NDArray[np.int64]) -> None:
        """Observe environments that could not be simulated again: their state is the last good one, but their
        report is still of the point of failure."""
        data = self.engine.arrays[0]
        form = engine_layout(self.engine.features)
        # No step, but new reports of all environments; only those of `envs` are kept.
        kept = data.copy()
        leg = form.leg_memory.rows("report")
        self.engine.advance(None, 0)
        reports = [form.trunk_memory.rows("report")]
        for k in range(self.legs):
            first = form.trunk_rows + k * form.leg_rows
            reports.append(slice(first + leg.start, first + leg.stop))
        for rows in reports:
            kept[rows, envs] = data[rows, envs]
        data[:] = kept
        # NaN at the point of failure, with which a state would be refused
        self.episode_rows.x_before[envs] = self.engine.report["x"][envs]
        self.observe()

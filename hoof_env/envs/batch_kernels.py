"""Kernels of a batch of episodes: choice, compilation, and calls other than a step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.advance import static_of
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.form import engine_layout
from hoof_env.envs.addresses import ADDRESSES, END
from hoof_env.envs.batch_build import find_entries
from hoof_env.envs.conditions import (
    under_each,
)
from hoof_env.envs.infos import InfoLayout
from hoof_env.envs.observation_kernel import from_outside, functions_of
from hoof_env.envs.step import NOT_A_NUMBER, step_kernels
from hoof_env.errors import ParameterError
from hoof_env.simd.layout import views

Floats = NDArray[np.float64]


CHANGING = ("episode_steps", "substeps", "part_substeps")
"""Whole numbers of a task's record that kernels read when they run."""


def known_of(record: Any) -> tuple[tuple[str, Any], ...]:
    """Return the fields of a task's record that kernels are made for: truths and whole numbers."""
    kinds = record.dtype.fields
    names = [name for name in kinds if kinds[name][0].base.kind in "ib" and name not in CHANGING]
    values = [record[0][name] for name in names]
    return tuple(
        (name, tuple(value.tolist()) if value.shape else value.item())
        for name, value in zip(names, values, strict=True)
    )


class Held(int):
    """Address of an array, which it keeps alive."""

    array: NDArray[Any]

    @classmethod
    def of(cls, array: NDArray[Any]) -> Held:
        made = cls(array.ctypes.data)
        made.array = array
        return made


class BatchKernels:
    """Kernels of an `EpisodeBatch`, and the arrays that they work on.

    Attributes:
        kernel, addresses: `kernel(addresses)` is one control step of all episodes; `finish_step` follows.
        observe_kernel: kernel that observes without a step; `observe_kernel(addresses)`.
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
        self.has_own_entries = bool(from_outside(functions))
        self.measurements = InfoLayout(self.engine.features, tuple(self.body.hips))
        self.find()

    def _choose(self) -> None:
        """Find the kernels for what is known of the present records of engine and task."""
        self.kernels = k = step_kernels(
            self.task.terms,
            self.task.entries,
            self.task.contact_law,
            self.engine.features,
            self.body.kernels,
            self.task.action_map,
            known_of(self.task_record),
            static_of(self.engine.arrays[1]),
        )
        # Few environments, or the paper's solver, which works on the engine's memory between two kernels.
        runs_scalar = self.engine.runs_scalar or self.paper
        self.kernel, self.observe_kernel = (
            (k.step_one, k.observers.observe_one)
            if runs_scalar
            else (k.step_batch, k.observers.observe_batch)
        )
        if self.paper:
            self.kernel = self._step_paper

    def find(self) -> None:
        """Find the addresses of the arrays, after any of them was replaced."""
        self.episode_rows = views(self.layout, self.episode)
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
        self.addresses = ADDRESSES.of(*arrays, columns=range(self.engine.columns))
        # A block of columns for each thread; the paper's solver runs on one, with all of them.
        blocks = [range(self.engine.columns)] if self.paper else self.engine.blocks
        self._blocks = [(Held.of(ADDRESSES.of(*arrays, columns=block)),) for block in blocks]
        self._choose()

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

    def _compile(self) -> None:
        """Compile or load every kernel of a step, by running it on no environment."""
        if self.paper:
            self._run_idle(self.kernels.apply_one, self.kernels.finish_one)
        else:
            self._run_idle(self.kernel)
        self._run_idle(self.observe_kernel)
        self.engine.reset(np.empty((self.legs, self.engine.features.gait_size, 0)), envs=[])

    def compile_measured(self) -> None:
        """Compile or load the kernel of `measured`, which few use: making a batch leaves it out."""
        self._measure(np.zeros((len(self.names), 0)))

    def _measure(self, out: Floats) -> None:
        self.kernels.observers.measure_one(self.addresses.ctypes.data, out.ctypes.data, out.shape[1])

    def _run_idle(self, *kernels: Any) -> None:
        """Run kernels on no environment."""
        idle = self.addresses.copy()
        idle[END] = 0
        for run in kernels:
            run(idle.ctypes.data)

    def direct_kernel(self) -> Any:
        """Return `kernel` without numba's dispatch by types, which takes a hundredth of a single step. It
        must be called with `addresses` only, as it checks no types."""
        if self.paper:
            return self.kernel
        # Not compiled yet in a process that unpickled the batch.
        if self.kernel.call is None:
            self._run_idle(self.kernel)
        return self.kernel.call

    def _step_paper(self, addresses: NDArray[np.int64]) -> int:
        """Take a control step with the paper's solver between the kernels; return the code of a step."""
        assert self.paper
        if not self.kernels.apply_one(addresses):
            return NOT_A_NUMBER
        self.paper.advance()
        happened: int = self.kernels.finish_one(addresses)
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
        self.observe_kernel(self.addresses.ctypes.data)

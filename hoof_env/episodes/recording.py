"""Recording of the substeps between two control steps, by running them again on another engine.

The kernels keep the sums of a control step, not its substeps. A recording copies the memory at the end of
each step and runs the substeps again from there when they are needed; they have the same bits.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.layout import engine_layout
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.parts import broken
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.record.columns import Columns, columns_of
from hoof_env.record.surroundings import Surroundings

KEPT_SECONDS = 4.0
"""Time back to which substeps can be run again [s]."""

Record = dict[str, NDArray[np.float64]]


def surroundings_of(batch: EpisodeBatch, env: int = 0) -> Surroundings:
    """Return the surroundings of an environment of a batch."""
    weight = float(batch.rows.named.weight[env])
    return Surroundings(
        batch.plan.body.geometry,
        batch.row_plans.of(env).terrain,
        batch.plan.settings.trunk,
        weight,
        LIFT_OFF * weight / batch.plan.legs,
        batch.plan.body.hips,
        batch.plan.body.picture,
        batch.plan.settings.hoof_length,
    )


def commands_of_step(
    batch: EpisodeBatch, before: NDArray[np.float64], after: NDArray[np.float64]
) -> list[tuple[NDArray[np.float64], int]]:
    """Return the commands of a control step, shape (legs, gait parameters), each with the number of substeps
    in which it acts, from the memory of the engine before and after the step."""
    late = batch.plan.delays.action.substeps
    earlier, own = (batch.engine.command_in(column) for column in (before, after))
    # Until the step's action acts, the command before it stands.
    return [(earlier, late), (own, batch.plan.substeps - late)] if late else [(own, batch.plan.substeps)]


class Recording:
    """Substeps of one environment of a batch.

    Attributes:
        batch: batch of episodes.
        env: index of the environment.
    """

    def __init__(self, batch: EpisodeBatch, env: int = 0) -> None:
        self.batch = batch
        self.env = env
        # Memory at the end of control steps; the first one is a start, or precedes the oldest step.
        self._ends: deque[Any] = deque(maxlen=round(KEPT_SECONDS / batch.plan.dt) + 2)
        self._engine: TrunkEngine | None = None
        self._plan = batch.row_plans.of(env)
        self._find()

    def _find(self) -> None:
        """Set the function that returns the end of a control step: the engine's memory of this environment,
        or a record of the step by an engine that cannot run substeps again."""
        self._end = self.batch.engine.end_reader(self.env)

    def begin(self) -> None:
        """Begin anew after a reset or another state, to which earlier steps did not lead."""
        plan = self.batch.row_plans.of(self.env)
        # With other settings the engine may have another ground.
        if plan is not self._plan:
            self.close()
            self._plan = plan
        self._ends.clear()
        self.add()

    def add(self) -> None:
        """Save the memory at the end of a control step."""
        self._ends.append(self._end())

    def replace(self) -> None:
        """Keep the present memory in place of the last end: a push changed it between two steps."""
        if self._ends:
            self._ends[-1] = self._end()

    def last(self) -> Record:
        """Return the state and report by name at each substep of the last control step; after a reset, or a
        step that could not be simulated, of the present instant only."""
        return self._record(-1)

    def _record(self, k: int) -> Record:
        """Return the substeps that led to the k-th end, counted from the last one, -1."""
        if not self._ends:
            self.begin()
        end = self._ends[k]
        if isinstance(end, dict):
            return end
        if not self._has_substeps(k):
            return self._run(end, None, 0)
        (command, steps), *rest = commands_of_step(self.batch, self._ends[k - 1], end)
        records = [self._run(self._ends[k - 1], command, steps)]
        records += [self._go_on(*part) for part in rest]
        # Without the first instant, which is the end of the step or the part before.
        joined = {name: np.concatenate([record[name][1:] for record in records]) for name in records[0]}
        return joined

    def _has_substeps(self, k: int) -> bool:
        """Return False for the first end, which has no predecessor, and after a step that failed, which did
        not lead to its end."""
        form = engine_layout(self.batch.engine.features)
        is_first = k == -len(self._ends)
        return not is_first and not broken(self._ends[k][form.trunk_memory.rows("result")])[0]

    def commands(self, k: int = -1) -> NDArray[np.float64]:
        """Return the commands at the instants of a record, shape (n, legs, gait parameters) or (1, legs, gait
        parameters), for the k-th end."""
        engine = self.batch.engine
        if not self._ends:
            self.begin()
        if isinstance(self._ends[k], dict):
            return engine.command_in(engine.column(self.env))[None]
        if not self._has_substeps(k):
            return engine.command_in(self._ends[k])[None]
        parts = commands_of_step(self.batch, self._ends[k - 1], self._ends[k])
        return np.concatenate([np.repeat(command[None], steps, axis=0) for command, steps in parts])

    def _run(self, column: NDArray[np.float64], command: Any, steps: int) -> Record:
        """Run substeps from a column of the engine's memory, under a command."""
        if self._engine is None:
            self._engine = self.batch.alone(self.env)
        self._engine.set_column(0, column)
        return self._go_on(command, steps)

    def _go_on(self, command: Any, steps: int) -> Record:
        """Run substeps from where `_run` ended, under a command."""
        assert self._engine is not None
        record = self._engine.run(command, steps, continue_past_limits=True)
        record.pop("result")
        return record

    def columns(self, k: int = -1, record: Record | None = None) -> Columns:
        """Return the columns of the substeps that led to the k-th end, commands included. A known `record` of
        them saves the time to run them again."""
        here = surroundings_of(self.batch, self.env)
        known = self._record(k) if record is None else record
        return columns_of(
            known, here.hips, here.terrain, commands=self.commands(k), hoof_length=here.hoof_length
        )

    def close(self) -> None:
        """Release the engine; the next record makes another one."""
        self._engine = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes without the engine, which belongs to this process and environment."""
        return {name: value for name, value in vars(self).items() if name != "_end"} | {"_engine": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Set the attributes, and find the memory of this process."""
        vars(self).update(state)
        self._find()

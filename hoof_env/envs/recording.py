"""What happened between two control steps: the substeps are run again, on an engine of their own.

The kernels keep sums of a control step, not its substeps; who wants to see those pays for them. Of a step
that nobody asks about there is a copy of where it ended, and no more: the substeps have the same bits
whenever they are run again from there.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.parts import broken
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.render.instant import columns_of, instants_of
from hoof_env.render.renderer import USUAL_SIZE, Renderer

SHOWN = 4.0  # seconds before a picture that it can show

Record = dict[str, NDArray[np.float64]]


class Recording:
    """Substeps of one environment of a batch, and pictures of them, `size` wide and high [pixels]."""

    def __init__(self, batch: EpisodeBatch, env: int = 0, size: tuple[int, int] = USUAL_SIZE) -> None:
        self.batch = batch
        self.env = env
        self.size = size
        self._ends: deque[Any] = deque(maxlen=round(SHOWN / batch.dt) + 2)  # of control steps; first a start
        self._unseen = 0  # of them, which no picture shows yet
        self.renderer: Any = None
        self._engine: TrunkEngine | None = None
        self._conditions = batch.conditions.of(env)
        self._find()

    def _find(self) -> None:
        """What is copied at the end of a control step: the engine's memory of this environment, or the record
        of the paper's solver."""
        paper = self.batch.paper
        env = self.env
        column = self.batch.engine.arrays[0][:, env]
        self._end = (lambda: paper.record(env)) if paper else column.copy

    def begin(self) -> None:
        """After a reset or a jump to another state: what was before did not lead to it."""
        conditions = self.batch.conditions.of(self.env)
        if conditions is not self._conditions and (conditions or self._conditions):
            self.close()  # it may have drawn another ground
            self._conditions = conditions
            self._engine = None
        self._ends.clear()
        self._unseen = 0
        self.add()

    def add(self) -> None:
        """After a control step: remember where it ended."""
        self._ends.append(self._end())
        self._unseen += 1

    def last(self) -> Record:
        """State and report by name at each substep of the last control step; of where it is, after a reset or
        a step that could not be simulated."""
        if not self._ends:
            self.begin()
        return self._record(-1)

    def _record(self, k: int) -> Record:
        """What led to the k-th end, which is counted from the last one, -1."""
        end = self._ends[k]
        if self.batch.paper:
            found: Record = end
            return found
        form = engine_layout(self.batch.engine.features)
        if k == -len(self._ends) or broken(end[form.trunk_memory.rows("result")])[0]:
            return self._run(end, None, 0)
        command = self.batch.engine.command_in(end)
        record = self._run(self._ends[k - 1], command, self.batch.substeps)
        return {name: values[1:] for name, values in record.items()}

    def _run(self, column: NDArray[np.float64], command: Any, steps: int) -> Record:
        if self._engine is None:
            self._engine = self.batch.alone(self.env)
        self._engine.set_column(0, column)
        record = self._engine.run(command, steps, continue_past_limits=True)
        record.pop("result")
        return record

    def frame(self, mode: str, fps: float) -> Any:
        """A picture of what happened since the last one, at most `SHOWN` seconds; None of a window."""
        hips = self.batch.body.hips
        terrain = self.batch.conditions.of(self.env).get("terrain", self.batch.engine.terrain)
        if self.renderer is None:
            weight = float(self.batch.episode_rows.weight[self.env])
            self.renderer = Renderer(
                self.batch.body.geometry,
                mode,
                fps,
                self.size,
                self.batch.settings.trunk,
                weight,
                LIFT_OFF * weight / self.batch.legs,
                terrain,
                hips,
            )
        if not self._ends:
            self.begin()
        if self._unseen >= len(self._ends):  # also the start of what is remembered
            self.renderer.reset()
        unseen = min(self._unseen, len(self._ends))
        if self.renderer.is_empty:
            unseen = max(unseen, 1)
        for k in range(-unseen, 0):
            record = self._record(k)
            command = self._commanded(k)
            columns = columns_of(record, hips, terrain, command)
            self.renderer.add(instants_of(columns, hips))
        self._unseen = 0
        return self.renderer.frame()

    def _commanded(self, k: int) -> NDArray[np.float64]:
        """What was commanded in the control step of the k-th end, shape (legs, gait parameters)."""
        engine = self.batch.engine
        return engine.command_in(engine.column(self.env) if self.batch.paper else self._ends[k])

    def close(self) -> None:
        """Close the window, if any."""
        if self.renderer is not None:
            self.renderer.close()
            self.renderer = None

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles leave the window behind; it belongs to this process and this environment."""
        return {name: value for name, value in vars(self).items() if name != "_end"} | {
            "renderer": None,
            "_engine": None,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._find()

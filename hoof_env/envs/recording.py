"""What happened between two control steps: the substeps are run again, on an engine of their own.

The kernels keep sums of a control step, not its substeps; who wants to see those pays for them. Running them
again from the same state gives the same bits.
"""

from __future__ import annotations

import copy
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.parts import broken
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.render.instant import columns_of_engine, columns_of_horse, horse_instants, instants

SHOWN = 4.0  # seconds before a picture that it can show


class Recording:
    """Substeps of one environment of a batch, and pictures of them."""

    def __init__(self, batch: EpisodeBatch, env: int = 0) -> None:
        self.batch, self.env = batch, env
        self._engine = copy.copy(batch.engine) if batch.num_envs == 1 else batch.engine.alone()
        self._before: NDArray[np.float64] | None = None
        self._waiting: deque[Any] = deque(maxlen=round(SHOWN / batch.dt) + 1)
        self._restarted = False
        self.renderer: Any = None

    def start(self) -> None:
        """Before a step or a reset: remember where it begins."""
        self._before = self.batch.engine.column(self.env)

    def forget(self) -> None:
        """After a jump to another state: what was before did not lead to it."""
        self._before = None
        self.keep(True)

    def last(self) -> dict[str, NDArray[np.float64]]:
        """State and report by name at each substep of the last control step; of where it is, after a reset or
        a step that could not be simulated."""
        engine = self.batch.engine
        if self.batch.paper:
            return self.batch.paper.record(self.env)
        now, starts = engine.column(self.env), engine.state["time"][self.env] == 0.0
        if self._before is None or starts or broken(engine.results)[self.env]:
            return self._run(now, 0)
        return {
            name: values[1:] for name, values in self._run(self._before, self.batch.substeps, now).items()
        }

    def _run(
        self, column: NDArray[np.float64], steps: int, after: NDArray[np.float64] | None = None
    ) -> dict[str, NDArray[np.float64]]:
        self._engine.set_column(0, column)
        command = None if after is None else self._engine.command_in(after)
        record = self._engine.run(command, steps, beyond=True)
        record.pop("result")
        return record

    def keep(self, restart: bool) -> None:
        """Keep the last control step for a picture; on a `restart` it shows nothing of before."""
        if restart:
            self._waiting.clear()
            self._restarted = True
        self._waiting.append(self.last())

    def frame(self, mode: str, fps: float) -> Any:
        """A picture of what was kept, or of where it is if nothing was; None of a window."""
        engine, weight = self.batch.engine, float(self.batch.now.weight[self.env])
        if self.renderer is None:
            from hoof_env.render.renderer import Renderer

            self.renderer = Renderer(
                self.batch.body.geometry, mode, fps, trunk=self.batch.settings.trunk, weight_n=weight,
                lift_off_n=LIFT_OFF * weight / self.batch.body.legs, terrain=engine.terrain,
                hips=self.batch.body.hips,
            )  # fmt: skip
        if self._restarted:
            self.renderer.reset()
            self._restarted = False
        if self.renderer.is_empty and not self._waiting:
            self._waiting.append(self.last())
        while self._waiting:
            command, hips = engine.command_in(engine.column(self.env)), self.batch.body.hips
            record = self._waiting.popleft()
            if hips:
                columns = columns_of_horse(record, hips, engine.terrain, command=command)
                self.renderer.add(horse_instants(columns, hips))
            else:
                columns = columns_of_engine(record, engine.terrain, command=command[0])
                self.renderer.add(instants(columns))
        return self.renderer.frame()

    def close(self) -> None:
        """Close the window, if any."""
        if self.renderer is not None:
            self.renderer.close()
            self.renderer = None

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles leave the window behind; it belongs to this process and this environment."""
        return {**vars(self), "renderer": None}

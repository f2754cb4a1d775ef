"""States of a vector environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.base import LegBase, array_of, generator_of
from hoof_env.envs.batch_states import set_state, spread_state
from hoof_env.envs.rows import UNKNOWN_SEED
from hoof_env.errors import ParameterError


class RowStates(LegBase):
    """States of all rows, of which `HorseLegVectorEnv` is made."""

    num_envs: int
    _ended: NDArray[np.bool_]
    _started: NDArray[np.bool_]
    _generators: list[np.random.Generator]
    _seeds: list[int]

    def _observed(self) -> NDArray[np.float32]:
        """Return the observations, a copy that later steps do not change."""
        self.batch.check_observed()
        return self.batch.observations[: self.num_envs].copy()

    def get_state(self) -> dict[str, Any]:
        """Return everything that changes, generators included: episodes that continue from it have the same
        bits.

        Raises:
            ResetNeeded: there are no episodes yet.
        """
        generators = [generator.bit_generator.state for generator in self._generators]
        return {**self._state_of_batch(), "ended": self._ended.copy(), "generator": generators}

    def set_state(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Restore a state of `get_state`; return the observations. With a state of a single environment every
        row continues from it, so that many actions can be tried from one state.

        Raises:
            ParameterError: a state of another id, geometry, setting or number of environments.
        """
        if isinstance(state, Mapping) and isinstance(state.get("generator"), Mapping):
            self._check_state(state)
            state = spread_state(self.batch, state)
        self._check_state(state, "ended")
        n = self.num_envs
        states = state["generator"]
        ended = array_of(state["ended"]).copy()
        if ended.dtype != bool or ended.ndim != 1:
            raise ParameterError(
                f"state['ended']: expected a bool array of shape ({n},), got {state['ended']!r}"
            )
        if ended.size != n:
            raise ParameterError(f"state: expected one of {n} environments, got one of {ended.size}")
        if not isinstance(states, (list, tuple)) or len(states) != n:
            raise ParameterError(f"state['generator']: expected a list of {n}, got {states!r:.60}")
        # The last checks: nothing has changed until here.
        generators = [generator_of(values) for values in states]
        set_state(self.batch, state)
        if "rows" in state:
            self._take_given()
        self._ended = ended
        self._started = np.ones(n, bool)
        self._generators = generators
        self._seeds = [UNKNOWN_SEED] * n
        self._phase = "running"
        for recording in self._watched.values():
            recording.begin()
        return self._observed()

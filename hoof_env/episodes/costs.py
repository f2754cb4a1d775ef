"""Costs of an episode: forces beyond limits, for learners that keep a constraint instead of a price."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.layout import Features, engine_layout, stride_sums
from hoof_env.dynamics.parts import broken
from hoof_env.episodes.rows import Rows
from hoof_env.errors import ParameterError, brief, check_number
from hoof_env.tasks.registry import Task
from hoof_env.tasks.reward import MAX_STRIDE
from hoof_env.tasks.settings import ResolvedSettings

Floats = NDArray[np.float64]

COSTS = {
    "peak": (
        "N",
        "increase of the episode's highest resultant force above the limit [N]; sums to the highest excess",
    ),
    "excess": ("N", "highest resultant force of the step's substeps above the limit [N]"),
    "indicator": ("-", "1 in a step with a resultant force above the limit [N]"),
    "loading": (
        "N/s",
        "increase of the stances' steepest rises of the normal force above the limit [N/s]",
    ),
    "leaning": (
        "-",
        "1 in a step in which the leg owes more than it must bear in a second: each step adds the share of"
        " the weight that is the limit [-], what the leg bears repays it, and more than a second is forgiven",
    ),
}
"""Costs by name: unit and meaning. The resultant force is the highest of all hooves."""

LEANING = ("suspended", "rail")
"""Kinds of trunk of which something else than the legs can bear a part of the weight."""


@cache
def memory_rows(features: Features, legs: int, name: str) -> NDArray[np.int64]:
    """Return the rows of a stride sum of each leg in the engine's memory, shape (legs,)."""
    layout = engine_layout(features)
    first = layout.trunk_rows + layout.leg_memory.rows("sums").start + stride_sums(features).index(name)
    return first + layout.leg_rows * np.arange(legs)


@dataclass(frozen=True)
class Costs:
    """Costs of a task: costs with limits, then costs of its own terms.

    Attributes:
        limits: limit of each cost, by names of `COSTS`.
        own: place of each of the task's own costs among its terms, by name.
        dt: control step [s].
    """

    limits: Mapping[str, float]
    own: Mapping[str, int]
    dt: float

    @classmethod
    def of(cls, s: ResolvedSettings, task: Task, dt: float) -> Costs:
        """Return the costs of settings.

        Raises:
            ParameterError: not a mapping, an unknown cost, one that the task has under this name, one that
                means nothing for its trunk, or a limit out of range.
        """
        given = {} if s.cost is None else s.cost
        own = {term.name: k for k, term in enumerate(task.terms) if term.is_cost}
        if not isinstance(given, Mapping) or not set(given) <= set(COSTS):
            raise ParameterError(
                f"cost: expected a mapping with limits of some of {', '.join(COSTS)}, got {brief(s.cost)}"
            )
        if twice := sorted(set(given) & set(own)):
            raise ParameterError(
                f"cost: expected none of the names of the task's own costs, got {', '.join(twice)}"
            )
        if "leaning" in given and s.trunk not in LEANING:
            raise ParameterError(
                f"cost['leaning']: expected a trunk that is {' or '.join(LEANING)}, got a {s.trunk} one, of"
                f" which {'no weight is borne' if s.trunk == 'fixed' else 'the legs bear all weight'}; pass"
                f" cost={ {name: limit for name, limit in given.items() if name != 'leaning'} }"
            )
        highest = {"leaning": 1.0}
        limits = {
            name: check_number(f"cost[{name!r}]", limit, low=0.0, high=highest.get(name, np.inf))
            for name, limit in given.items()
        }
        return cls(limits, own, dt)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all costs, in the order of their rows."""
        return (*self.limits, *self.own)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys in infos and summaries: of each cost."""
        return tuple(f"cost_{name}" for name in self.names)

    def begin(
        self,
        rows: Rows,
        which: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Begin the costs of episodes that start in some rows."""
        rows.costs[:, which] = 0.0
        rows.cost_sums[:, which] = 0.0
        rows.stance_rises[:, which] = 0.0
        rows.debts[:, which] = 0.0

    def add(self, rows: Rows, engine: TrunkEngine) -> None:
        """Compute the costs of a control step, after its kernel, and add them up. A row between two episodes
        starts after it, without costs.

        Args:
            rows: rows of the batch.
            engine: engine of the batch.
        """
        n, legs = rows.num_envs, len(engine.limbs)
        memory = engine.arrays[0]

        def sums(name: str) -> Floats:
            found: Floats = memory[memory_rows(engine.features, legs, name), :n]
            return found

        highest = sums("highest_grf").max(axis=0)
        counts = ~broken(engine.results)  # a step that failed was taken back
        for k, (name, limit) in enumerate(self.limits.items()):
            if name == "peak":
                excess = np.maximum(highest - limit, rows.cost_sums[k])
                cost = excess - rows.cost_sums[k]
                rows.cost_sums[k] = np.where(counts, excess, rows.cost_sums[k])
            elif name == "loading":
                cost = self._add_rises(rows, sums("loading_rate_increase"), sums("stances"), limit, counts)
            elif name == "leaning":
                borne = sums("normal_impulse").sum(axis=0) / rows.named.weight[:n]
                most = limit * MAX_STRIDE
                debts = np.maximum(rows.debts[0] + limit * self.dt - borne, 0.0)
                rows.debts[0] = np.where(counts, np.minimum(debts, most), rows.debts[0])
                cost = np.where(debts > most, 1.0, 0.0)
            else:
                over = highest - limit
                cost = np.maximum(over, 0.0) if name == "excess" else np.where(over > 0.0, 1.0, 0.0)
            rows.costs[k] = np.where(counts, cost, 0.0)
            if name != "peak":
                rows.cost_sums[k] += rows.costs[k]
        first = len(self.limits)
        rows.costs[first:] = rows.named.terms[[*self.own.values()], :n]  # 0 where a step failed
        rows.cost_sums[first:] += rows.costs[first:]

    def _add_rises(
        self, rows: Rows, increases: Floats, stances: Floats, limit: float, counts: NDArray[np.bool_]
    ) -> Floats:
        """Add the step to the steepest rises of the stances, shape (legs, num_envs); return the cost."""
        before = np.where(stances > 0.0, 0.0, rows.stance_rises)
        after = before + increases
        rows.stance_rises[:] = np.where(counts, after, rows.stance_rises)
        cost: Floats = (np.maximum(after - limit, 0.0) - np.maximum(before - limit, 0.0)).sum(axis=0)
        return cost

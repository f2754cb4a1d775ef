"""CMA-ES over open-loop gaits: families of gaits, what a search makes small, and one search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.score import make_rows, play_rows
from hoof_env.envs.policies import open_loop
from hoof_env.errors import ParameterError

Floats = NDArray[np.float64]
Episodes = list[dict[str, float]]

SIZES = {"constant": 4, "clocked": 13}
"""Numbers of a gait, by family."""

SLOWEST, FASTEST = 0.2, 4.0
"""Of the clock [Hz]; the crank turns at 2 Hz at most."""

POPULATION, STARTS = 16, 16
"""Candidates of a generation and random starts that each meets."""

ROWS = POPULATION * STARTS

FINALISTS = 4
"""Candidates of a search that meet more starts at its end."""

STEP, HARMONIC = 0.3, 0.3
"""First standard deviation and largest first harmonic; the box of every number is 2 wide."""

TEST_SEED, SEARCH_SEED = 1000, 10_000_000
"""First seeds of the final score, `agents.evaluate`'s, and of the searches."""

OPTIONS = {
    "bounds": [-1, 1], "tolx": 1e-3, "tolfun": 0, "tolfunhist": 0, "tolstagnation": 10**9,
    "verbose": -9, "verb_log": 0,
}  # fmt: skip
"""Of CMA-ES: it ends when the steps are small."""

SHORTFALL = 10.0
"""What 1 m/s or a whole weight too little costs, and failing always: more than it can save."""


AVERAGED = (
    "return", "speed_m_s", "stance_peak_n", "drive_work_j", "distance_m", "weight_share", "failed",
)  # fmt: skip
"""Figures of an episode that a cost is made of."""


def decode(family: str, x: Floats) -> dict[str, Floats]:
    """Parameters of `open_loop` for points of the box [-1, 1], shape (..., SIZES[family])."""
    if family == "constant":
        return {"constant": x}
    frequency = SLOWEST * (FASTEST / SLOWEST) ** ((x[..., 12] + 1) / 2)
    return {"constant": x[..., :4], "sin": x[..., 4:8], "cos": x[..., 8:12], "frequency_hz": frequency}


def cost(episodes: Episodes, objective: str, weight: float, speed: float = 0.0, share: float = 0.0) -> float:
    """What a search makes small.

    Args:
        episodes: of one candidate.
        objective: "return"; or, under conditions, "peak" or "transport": mean peak force of a stance
            [weights], and work per weight and distance of all episodes together.
        weight: of trunk and leg [N].
        speed, share: conditions: mean speed [m/s] and part of the weight that the leg bears, or more.
    """
    mean = {key: float(np.mean([one[key] for one in episodes])) for key in AVERAGED}
    if objective == "return":
        return -mean["return"]
    missing = max(0.0, speed - mean["speed_m_s"]) + max(0.0, share - mean["weight_share"])
    penalty = SHORTFALL * (missing + mean["failed"])
    if objective == "peak":
        return mean["stance_peak_n"] / weight + penalty
    transport = mean["drive_work_j"] / (weight * max(mean["distance_m"], 0.1))  # who stands is only too slow
    return min(transport, SHORTFALL) + penalty


class Objective:
    """Scores candidates by episodes in the rows of one vector environment.

    Args:
        env_id, env_kwargs: the environment.
        family: of the candidates.
        objective, speed, share: as of `cost`.

    Attributes:
        leg: a single environment like the rows.
        spent: episodes so far.

    Raises:
        ParameterError: no such environment, or one without many at once.
    """

    def __init__(
        self,
        env_id: str,
        env_kwargs: dict[str, Any],
        family: str,
        objective: str = "return",
        speed: float | None = None,
        share: float | None = None,
    ) -> None:
        leg: Any = runs.make_env(env_id, **env_kwargs).unwrapped
        envs = make_rows(env_id, ROWS, **env_kwargs)
        if envs is None:
            raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
        self.leg, self.envs, self.spent = leg, envs, 0
        self.family = family
        conditions = {"speed": speed or 0.0, "share": share or 0.0}
        self._cost: dict[str, Any] = {"objective": objective, "weight": leg.weight, **conditions}

    def costs(self, x: Floats, seeds: Sequence[int]) -> list[float]:
        """`cost` of candidates, shape (n, size), that meet the same starts; n * len(seeds) is `ROWS`."""
        episodes = self._play(decode(self.family, np.repeat(x, len(seeds), axis=0)), [*seeds] * len(x))
        each = [episodes[k : k + len(seeds)] for k in range(0, len(episodes), len(seeds))]
        return [cost(some, **self._cost) for some in each]

    def test(self, parameters: dict[str, Any], count: int) -> Episodes:
        """Episodes of the final score of one candidate."""
        episodes: Episodes = []
        while len(episodes) < count:
            first = TEST_SEED + len(episodes)
            episodes += self._play(parameters, range(first, first + ROWS))
        return episodes[:count]

    def _play(self, parameters: dict[str, Any], seeds: Sequence[int]) -> Episodes:
        self.spent += len(seeds)
        return play_rows(self.envs, open_loop(parameters, self.leg.dt), seeds)


def search(
    objective: Objective,
    seed: int,
    episodes: int,
    tick: Callable[[int, float], Any],
    start: Sequence[float] | None = None,
) -> tuple[Floats, float, bool]:
    """One CMA-ES from the best point of a random screening, or from a constant action.

    All candidates of a generation meet the same starts, those of the next meet others. At the end the mean
    of the distribution, the luckiest candidate and the best of the last generation meet more.

    Args:
        objective: what scores candidates.
        seed: of the search; searches of different seeds share no start.
        episodes: to spend, about.
        tick: called with the number of episodes that were added and the lowest cost in them.
        start: the constant action to begin with, shape (4,); harmonics are none there.

    Returns:
        The best point, its cost over starts that the search had not met, and whether Ctrl-C ended it.

    Raises:
        KeyboardInterrupt: Ctrl-C before anything was found.
    """
    import cma

    size, generator, fresh = (
        SIZES[objective.family],
        np.random.default_rng([seed, 6]),
        SEARCH_SEED * (seed + 1),
    )

    def costs(x: Any, starts: int) -> list[float]:
        nonlocal fresh
        values = objective.costs(np.array(x), range(fresh, fresh + starts))
        fresh += starts
        tick(ROWS, min(values))
        return values

    if start is None:
        screened = generator.uniform(-1, 1, (ROWS // 4, size))
        screened[:, 4:12] *= HARMONIC
        first, step = screened[np.argmin(costs(screened, 4))], STEP
    else:
        first, step = np.array([*start, *[0.0] * (size - 4)]), STEP / 3
    options = OPTIONS | {"popsize": POPULATION, "seed": int(generator.integers(1, 2**31))}
    strategy, best, interrupted = cma.CMAEvolutionStrategy(first, step, options), [first], False
    try:
        for _ in range(episodes // ROWS - 2):
            if strategy.stop():
                break
            candidates = strategy.ask()
            values = costs(candidates, STARTS)
            strategy.tell(candidates, values)
            lowest = [candidates[k] for k in np.argsort(values)[: FINALISTS - 2]]
            best = [strategy.result.xfavorite, strategy.result.xbest, *lowest]
    except KeyboardInterrupt:
        interrupted = True
    finalists = np.clip(np.round((best * FINALISTS)[:FINALISTS], 5), -1.0, 1.0)
    final = costs(finalists, ROWS // FINALISTS)
    return finalists[np.argmin(final)], min(final), interrupted

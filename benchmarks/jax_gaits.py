"""Gaits improved by the derivative of the return (`examples/jax_gait.py`) beside CMA-ES at equal simulated
time."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import numpy as np

from agents.evolution import generations, make_strategy, mean_costs
from benchmarks.jax_learners import ID, LOOKS, Curve, Judge, curve_of
from examples.jax_gait import Gait, random_gait
from hoof_env.envs.open_loop import open_loop
from hoof_env.evaluation.episodes import make_rows

STEPS = 60_000
SEEDS = range(5)
POPULATION, EPISODES = 12, 1
"""Candidates of a generation, cma's number for 20 numbers, and starts that each meets."""

SPREAD = 0.3
"""First standard deviation, as in `agents.open_loop`."""


class Search:
    """Search by CMA-ES over the numbers of a gait, in episodes of some control steps from drawn starts."""

    def __init__(self, judge: Judge, length: int) -> None:
        self._judge = judge
        self._length = length
        self._rows: Any = make_rows(ID, POPULATION * EPISODES)

    def run(self, gait: Any, steps: int, seed: int) -> Curve:
        """Return the curve from a gait: steps, processor seconds and mean return."""
        count = steps // (POPULATION * EPISODES * self._length)
        fresh = iter(range(10_000 * (seed + 1), 10_000 * (seed + 2)))

        def costs(points: list[Any]) -> list[float]:
            starts = [next(fresh) for _ in range(EPISODES)] * len(points)
            policy = policy_of(np.repeat(np.array(points), EPISODES, axis=0), self._rows)
            observation, _ = self._rows.reset(seed=starts)
            total = np.zeros(len(starts))
            for k in range(self._length):
                action, _ = policy.predict(observation, episode_start=np.full(len(starts), k == 0))
                observation, rewards, *_ = self._rows.step(action)
                total += rewards
            return mean_costs(total, EPISODES)

        strategy = make_strategy(gait.ravel(), SPREAD, POPULATION, seed + 1)
        curve: Curve = []
        spent, since = 0.0, time.process_time()
        for k, _ in enumerate(generations(strategy, costs, count)):
            if (k + 1) * LOOKS // count > len(curve):
                spent += time.process_time() - since
                taken = (k + 1) * POPULATION * EPISODES * self._length
                mean = strategy.result.xfavorite
                value = self._judge.score(policy_of(mean, self._judge.envs))
                curve.append({"steps": taken, "seconds": spent, "return": value})
                since = time.process_time()
        return curve


def policy_of(points: Any, envs: Any) -> Any:
    """Return the policy of gaits, shape (..., 20), in halves of the ranges of their parameters."""
    body = envs.unwrapped.body
    coefficients = np.clip(points, -1.0, 1.0).reshape(*np.shape(points)[:-1], 1, -1, 4) * body.half
    coefficients[..., 0, 0, :] += body.middle
    return open_loop({"coefficients": coefficients}, envs)


def measure(steps: int = STEPS, seeds: Iterable[int] = SEEDS) -> dict[str, Any]:
    """Return the curves of both, from the same random gaits, and the seconds that compiling took."""
    judge = Judge()
    since = time.process_time()
    gait = Gait(ID)
    next(gait.improve(random_gait(0), 1, 0))
    compiled = time.process_time() - since
    curves: dict[str, list[Curve]] = {}

    def note(name: str, seed: int, curve: Curve) -> None:
        curves.setdefault(name, []).append(curve)
        print(f"{name}, seed {seed}: {curve[-1]}", flush=True)

    def score(numbers: Any) -> float:
        return judge.score(policy_of(np.asarray(numbers, float).ravel(), judge.envs))

    first = []
    for seed in seeds:
        first.append(score(random_gait(seed)))
        progress = gait.improve(random_gait(seed), steps, seed)
        note("derivative, windows of 0.5 s", seed, curve_of(progress, steps, score))
    for length, name in ((500, "CMA-ES, episodes of 10 s"), (100, "CMA-ES, episodes of 2 s")):
        search = Search(judge, length)
        for seed in seeds:
            note(name, seed, search.run(random_gait(seed), steps, seed))
    return {"id": ID, "steps": steps, "compiled": compiled, "first": first, "curves": curves}

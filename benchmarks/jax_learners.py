"""Learners inside JAX beside `agents/ppo_flat.py`: curves of the mean return over equal steps and seconds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import jax
import numpy as np

from agents import results, runs
from agents.settings import FOLDER, algorithm_class, load_settings, model_arguments
from examples.jax_ppo import Ppo
from examples.jax_shac import Shac
from hoof_env.envs.policies import Scripted
from hoof_env.evaluation.episodes import make_rows, play_rows
from hoof_env.policies.find import find_policy

ID = "hoof_env/HorseLeg-v0"
STEPS = 102_400  # a multiple of the windows and rollouts of all learners
SEEDS = {"shac": range(5, 10), "ppo": range(5)}
"""Seeds of the trainings of each part. SHAC's settings were chosen by trainings with seeds 0 and 1."""

BLIND = "zero", "constant", "open-loop"
"""Rows of `results/` whose policies see nothing."""

APART, ATTEMPTS = 0.05, 4
"""Share by which equal seconds may differ, and how often the number of steps is chosen anew for that."""

LOOKS = 10
"""Scores of a curve."""

STARTS = range(2_000_000, 2_000_064)
"""Episodes of a score, which no training meets."""

Curve = list[dict[str, float]]
"""Steps, processor seconds and mean return of each score."""


class Judge:
    """Scores of policies: the mean return of the same episodes of the compiled environment."""

    def __init__(self, id: str = ID) -> None:
        envs = make_rows(id, len(STARTS))
        assert envs is not None
        self.envs: Any = envs
        self.dt = envs.dt

    def score(self, policy: Any) -> float:
        """Return the mean return of a policy with `predict`."""
        return float(np.mean([episode["return"] for episode in play_rows(self.envs, policy, STARTS)]))

    def score_network(self, network: Any, bound: Callable[[Any], Any]) -> float:
        """Return the mean return of the bounded output of a network."""
        layers = [tuple(np.asarray(x) for x in layer) for layer in network]

        def act(observation: Any, _: Any) -> Any:
            x = np.asarray(observation, np.float32)
            for weights, biases in layers[:-1]:
                x = np.tanh(x @ weights + biases)
            weights, biases = layers[-1]
            return bound(x @ weights + biases)

        return self.score(Scripted(act, self.dt))


def curve_of(progress: Iterable[Any], steps: int, score: Callable[[Any], float]) -> Curve:
    """Return the curve of a training, which yields steps, what is learned and a mean. Scores take no time."""
    curve: Curve = []
    spent, since = 0.0, time.process_time()
    for taken, learned, _ in progress:
        jax.block_until_ready(learned)
        if taken * LOOKS // steps > len(curve):
            spent += time.process_time() - since
            curve.append({"steps": taken, "seconds": spent, "return": score(learned)})
            since = time.process_time()
    return curve


def learn_flat(steps: int, seed: int, judge: Judge) -> Curve:
    """Return the curve of `ppo_flat` with its settings, whose learning rate falls over these steps."""
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecMonitor

    settings = load_settings(FOLDER / "ppo_flat.yml", ID)
    many = VecMonitor(runs.make_vec_env(ID, settings["n_envs"], 1))
    settings["n_timesteps"] = steps
    model = algorithm_class("ppo_flat")(env=many, seed=seed, num_threads=1, **model_arguments(settings))
    curve: Curve = []
    spent, since = 0.0, time.process_time()

    class Looks(BaseCallback):
        """Callback that scores the policy after updates."""

        def _on_rollout_start(self) -> None:
            self.look()

        def look(self) -> None:
            nonlocal spent, since
            if self.num_timesteps * LOOKS // steps > len(curve):
                spent += time.process_time() - since
                value = judge.score(self.model)
                curve.append({"steps": self.num_timesteps, "seconds": spent, "return": value})
                since = time.process_time()

        def _on_step(self) -> bool:
            return True

    looks = Looks()
    model.learn(steps, callback=looks)
    looks.look()
    return curve


def learn_flat_for(seconds: float, curves: list[Curve], seeds: Iterable[int], judge: Judge) -> list[Curve]:
    """Return the curves of `ppo_flat` over as many steps as take the given time.

    Args:
        seconds: processor seconds that the median training is to take, within `APART` of them.
        curves: curves of trainings of which the rate of steps is known.
        seeds: seeds of the trainings.
        judge: judge of policies.

    Raises:
        RuntimeError: the median of the last attempt took another time, as on a machine whose load changes.
    """
    taken = 0.0
    for _ in range(ATTEMPTS):
        rate = np.median([curve[-1]["steps"] / curve[-1]["seconds"] for curve in curves])
        curves = [learn_flat(int(rate * seconds), seed, judge) for seed in seeds]
        taken = float(np.median([curve[-1]["seconds"] for curve in curves]))
        if abs(taken / seconds - 1.0) <= APART:
            return curves
    raise RuntimeError(f"ppo_flat took {taken:.2f} s: expected {seconds:.2f} s within {APART:.0%}")


def measure_blind() -> dict[str, Any]:
    """Return the mean returns of policies that see nothing in the judge's episodes, and what their rows of
    `results/` have: returns of the published episodes, and the episodes that a search took."""
    judge = Judge()
    rows = {
        kind: results.read_row(results.RESULTS / f"{ID.rpartition('/')[2]}-{kind}.json") for kind in BLIND
    }
    return {
        results.KINDS[kind]: {
            "return": judge.score(find_policy(row.policy, judge.envs, ID)),
            "published": row.mean["return"],
            "episodes": row.effort.get("episodes", 0),
        }
        for kind, row in rows.items()
    }


def measure_shac(steps: int = STEPS, seeds: Iterable[int] = SEEDS["shac"]) -> dict[str, Any]:
    """Return the curves of SHAC and of `ppo_flat`; see `_beside_flat`."""
    return _beside_flat("SHAC", lambda: Shac(ID).train, lambda actor: (actor["mean"], np.tanh), steps, seeds)


def measure_ppo(steps: int = STEPS, seeds: Iterable[int] = SEEDS["ppo"]) -> dict[str, Any]:
    """Return the curves of PPO in one program and of `ppo_flat`; see `_beside_flat`."""

    def trainer() -> Any:
        ppo = Ppo(ID)
        return lambda steps, seed: ppo.train(steps, seed, LOOKS)

    def network(agent: Any) -> Any:
        return agent["actor"], lambda x: np.clip(x, -1.0, 1.0)

    return _beside_flat("PPO in one program", trainer, network, steps, seeds)


def _beside_flat(
    name: str, trainer: Callable[[], Any], network: Callable[[Any], Any], steps: int, seeds: Iterable[int]
) -> dict[str, Any]:
    """Return the curves of a learner, of `ppo_flat` over equal steps and over equal seconds, and the seconds
    that compiling took.

    Args:
        name: the learner's name.
        trainer: function that makes its training, a function of steps and seed.
        network: function of what it learned, which returns its network and the bounds of its actions.
        steps: steps of a training.
        seeds: seeds of the trainings.
    """
    judge = Judge()
    curves: dict[str, list[Curve]] = {}

    def note(learner: str, seed: int, curve: Curve) -> None:
        curves.setdefault(learner, []).append(curve)
        print(f"{learner}, seed {seed}: {curve[-1]}", flush=True)

    since = time.process_time()
    train = trainer()
    next(train(steps, 0))  # the shapes of a whole training
    compiled = time.process_time() - since
    learn_flat(2048, 0, judge)  # loads the trainer's kernels
    for seed in seeds:
        score = lambda learned: judge.score_network(*network(learned))  # noqa: E731
        note(name, seed, curve_of(train(steps, seed), steps, score))
        note("ppo_flat, equal steps", seed, learn_flat(steps, seed, judge))
    seconds = float(np.median([curve[-1]["seconds"] for curve in curves[name]]))
    of_equal_steps = curves["ppo_flat, equal steps"]
    for seed, curve in zip(seeds, learn_flat_for(seconds, of_equal_steps, seeds, judge), strict=True):
        note("ppo_flat, equal seconds", seed, curve)
    return {"id": ID, "steps": steps, "compiled": compiled, "curves": curves}

"""Seconds of learning until `ppo_flat`, and stock learners, are better than the best constant gait.

    python -m benchmarks.learn_seconds                writes learn_seconds.json and .md
    python -m benchmarks.learn_seconds --seeds 3      fewer trainings

The clock runs from the first reset to the end of the update whose policy passes; scores, on 64 starts that
no training meets, stop it. Imports, and loading the kernels, are timed apart. Stock learners have their
library's defaults and one environment; SBX's are tried where `pip install sbx-rl` was run.
"""

from __future__ import annotations

import time

# Before everything else: imports are timed, too
BEGAN = time.perf_counter()

import argparse  # noqa: E402
import importlib  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

from agents.settings import FOLDER, algorithm_class, load_settings, model_arguments  # noqa: E402

FlatPPO = algorithm_class("ppo_flat")  # imports torch as a training does

from stable_baselines3.common.callbacks import BaseCallback  # noqa: E402
from stable_baselines3.common.vec_env import VecMonitor  # noqa: E402

from agents import runs  # noqa: E402
from benchmarks.history import RESULTS, write  # noqa: E402
from benchmarks.machine import machine, vector_bits  # noqa: E402
from hoof_env._output import markdown_table  # noqa: E402
from hoof_env.evaluation.episodes import make_rows, play_rows  # noqa: E402
from hoof_env.policies.find import find_policy  # noqa: E402

IMPORTED = time.perf_counter()

ENV_ID = "hoof_env/HorseLeg-v0"
STARTS = range(2_000_000, 2_000_064)
STEPS = 1_300_000  # steps of a training of `ppo_flat`
NEAR = 0.05  # largest distance from the final return, as a share of it
STOCK_SECONDS = 60.0  # most seconds of a stock learner

Curve = list[tuple[float, int, float]]
"""Seconds, steps and return of each score."""

INTRO = """\
# Seconds to learn

Written by `python -m benchmarks.learn_seconds`: from the first reset of `{env_id}` to the end of the update
whose policy returns more than the best constant gait, {gait:.1f}, and to within 5 % of the final return, in
the mean of 64 starts; scores are not counted. Imports took {imports:.1f} s, loading the stored kernels
{loading:.1f} s. Stock learners stop after {limit:g} s."""


class Timed(BaseCallback):
    """Callback that scores the policy after updates, with the clock stopped.

    Attributes:
        curve: seconds, steps and return of each score.
    """

    def __init__(self, envs: Any, steps_between: int, limit: float = np.inf, enough: float = np.inf) -> None:
        super().__init__()
        self.envs = envs
        self.steps_between = steps_between
        self.limit = limit
        self.enough = enough
        self.curve: list[tuple[float, int, float]] = []
        self._stopped = 0.0  # seconds for which the clock was stopped
        self._due = 0

    def _on_training_start(self) -> None:
        self._began = time.perf_counter()

    def _on_rollout_start(self) -> None:  # behind the update of the rollout before
        self.score()

    def score(self) -> None:
        """Score the policy if a score is due."""
        if self.num_timesteps < self._due:
            return
        paused = time.perf_counter()
        episodes = play_rows(self.envs, self.model, STARTS)
        value = float(np.mean([episode["return"] for episode in episodes]))
        self.curve.append((paused - self._began - self._stopped, self.num_timesteps, value))
        self._due = self.num_timesteps + self.steps_between
        self._stopped += time.perf_counter() - paused

    def _on_step(self) -> bool:
        seconds = time.perf_counter() - self._began - self._stopped
        return seconds < self.limit and not (self.curve and self.curve[-1][2] > self.enough)


def first(curve: Curve, level: float) -> float:
    """Return the seconds until a curve is above a level; infinite if it never is."""
    return next((seconds for seconds, _, value in curve if value > level), np.inf)


def learn_flat(seed: int, envs: Any, threads: int, steps: int = STEPS) -> Curve:
    """Train `ppo_flat` and return its curve, scored after every update at first, then after every eighth."""
    settings = load_settings(FOLDER / "ppo_flat.yml", ENV_ID)
    many = VecMonitor(runs.make_vec_env(ENV_ID, settings["n_envs"], 1))
    settings["n_timesteps"] = steps
    model = FlatPPO(env=many, seed=seed, num_threads=threads, **model_arguments(settings))
    timed = Timed(envs, 0)

    class Sparser(BaseCallback):
        """Callback that scores less often later on."""

        def _on_step(self) -> bool:
            if self.num_timesteps > 200_000:
                timed.steps_between = 8 * 2048
            return True

    model.learn(steps, callback=[timed, Sparser()])
    # The last policy is scored, due or not
    timed._due = 0
    timed.score()
    return timed.curve


def learn_stock(library: str, algo: str, seed: int, envs: Any, level: float) -> Curve:
    """Train a stock learner until it is above a level or its time is over, and return its curve."""
    algorithm = getattr(importlib.import_module(library), algo)
    with runs.make_env(ENV_ID) as env:
        model = algorithm("MlpPolicy", env, seed=seed)
        timed = Timed(envs, 2048, STOCK_SECONDS, level)
        model.learn(10_000_000, callback=timed)
    return timed.curve


def spread(values: list[float]) -> str:
    """Format median, lowest and highest."""
    shown = [f"{value:.1f}" if np.isfinite(value) else "never" for value in sorted(values)]
    return f"{np.median(values):.1f} ({shown[0]} to {shown[-1]})" if len(values) > 1 else shown[0]


def main() -> None:
    """Time all learners and write the page."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--seeds", type=int, default=10, help="trainings of ppo_flat")
    parser.add_argument("--stock-seeds", type=int, default=3, help="trainings of each stock learner")
    parser.add_argument("--threads", type=int, default=2, help="of ppo_flat's gradient")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    begin = time.perf_counter()
    envs = make_rows(ENV_ID, len(STARTS))
    assert envs is not None
    with runs.make_env(ENV_ID) as env:
        runs.warm_up(env)
        gait = find_policy("constant", env, ENV_ID)
        level = float(np.mean([episode["return"] for episode in play_rows(envs, gait, STARTS)]))
    # Outside of the clock of all trainings
    learn_flat(0, envs, args.threads, 4096)  # loads the trainer's kernels
    loading = time.perf_counter() - begin
    results: dict[str, list[Curve]] = {"ppo_flat": []}
    for seed in range(args.seeds):
        results["ppo_flat"].append(learn_flat(seed, envs, args.threads))
        print(f"ppo_flat, seed {seed}: above after {first(results['ppo_flat'][-1], level):.1f} s", flush=True)
    for library, name in (("stable_baselines3", "SB3"), ("sbx", "SBX")):
        if importlib.util.find_spec(library) is None:
            continue
        for algo in ("PPO", "SAC"):
            results[f"{name} {algo}"] = [
                learn_stock(library, algo, seed, envs, level) for seed in range(args.stock_seeds)
            ]
            print(f"{name} {algo} done", flush=True)
    rows = []
    for name, curves in results.items():
        near = ""
        final = ""
        if name == "ppo_flat":
            near = spread([first(curve, (1 - NEAR) * curve[-1][2]) for curve in curves])
            final = spread([curve[-1][2] for curve in curves])
        rows.append([name, str(len(curves)), spread([first(curve, level) for curve in curves]), near, final])
    about = machine()
    intro = INTRO.format(
        env_id=ENV_ID, gait=level, imports=IMPORTED - BEGAN, loading=loading, limit=STOCK_SECONDS
    )
    head = ("learner", "seeds", "seconds to the best constant gait", "seconds to within 5 %", "final return")
    text = "\n\n".join([intro, markdown_table(head, rows), markdown_table(("what", ""), [*about.items()])])
    bits = vector_bits()
    result = {"machine": about, "bits": bits, "open_loop": level, "curves": results}
    write(args.out, "learn_seconds", result, text + "\n", [])
    print(text)


if __name__ == "__main__":
    main()

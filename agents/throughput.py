"""How fast PPO trains through the native vector environment, beside one that does nothing.

    python -m agents.throughput          writes benchmarks/results/throughput.json and .md

The idle environment has the same spaces and the same number of rows and returns constant arrays; what PPO
does with it is all that Stable-Baselines3 can do on this machine. Both learn by turns in one process, with
the settings and wrappers of `agents.train`; a ratio is taken within a round.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.baselines_plan import LEG
from agents.command import check_threads, run
from agents.settings import FOLDER, load_settings, model_arguments
from hoof_env.errors import check_number

RESULT = Path("benchmarks/results/throughput.json")
RATE_BAR, SHARE_BAR = 25_000.0, 0.6
"""Environment steps a second, and their share of the idle environment's rate, at least."""


@dataclass(frozen=True)
class Args:
    env_id: str = LEG
    """registered environment with a native vector environment"""
    rounds: int = 10
    """of both environments"""
    rollouts: int = 5
    """of PPO in a round, each with its update"""
    torch_threads: int = 1
    """threads of torch"""
    out: Path = RESULT
    """the JSON file; the table lies beside it"""


def make_idle(num_envs: int, observation_space: Any, action_space: Any) -> Any:
    """A `VecEnv` that does nothing."""
    from stable_baselines3.common.vec_env import VecEnv

    class Idle(VecEnv):
        def __init__(self) -> None:
            super().__init__(num_envs, observation_space, action_space)
            self.seen = np.zeros((num_envs, *observation_space.shape), observation_space.dtype)
            self.said = np.zeros(num_envs, np.float32), np.zeros(num_envs, bool)
            self.infos: list[dict[str, Any]] = [{} for _ in range(num_envs)]

        def reset(self) -> Any:
            return self.seen

        def step_async(self, actions: Any) -> None:
            pass

        def step_wait(self) -> Any:
            return self.seen, *self.said, self.infos

        def close(self) -> None:
            pass

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
            return [getattr(self, attr_name, None)] * num_envs

        def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
            setattr(self, attr_name, value)

        def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
            return [None] * num_envs

        def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
            return [False] * num_envs

    return Idle()


def learner(envs: Any, settings: dict[str, Any], rollouts: int) -> tuple[Callable[[], Any], int]:
    """A function that trains PPO for so many rollouts more, and how many steps these are."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    envs = VecMonitor(envs)
    if normalize := settings.get("normalize"):
        envs = VecNormalize(
            envs, gamma=settings["gamma"], **(normalize if isinstance(normalize, dict) else {})
        )
    model = PPO(env=envs, seed=0, device="cpu", **model_arguments(settings))
    steps = rollouts * model.n_steps * envs.num_envs
    return lambda: model.learn(steps, reset_num_timesteps=False), steps


def measure(args: Args) -> dict[str, Any]:
    """Rates of all rounds [steps/s], by wall and by processor time, and the bars.

    Raises:
        ParameterError, DataFileError: an unknown environment or bad settings.
    """
    import torch
    from tqdm import tqdm

    check_number("rounds", args.rounds, low=1)
    check_number("rollouts", args.rollouts, low=1)
    check_threads(args.torch_threads)
    torch.set_num_threads(args.torch_threads)
    settings = load_settings(FOLDER / "ppo.yml", args.env_id)
    native = runs.make_vec_env(args.env_id, settings["n_envs"])
    idle = make_idle(settings["n_envs"], native.observation_space, native.action_space)
    learners = {
        "native": learner(native, settings, args.rollouts),
        "idle": learner(idle, settings, args.rollouts),
    }
    for learn, _ in learners.values():
        learn()  # what is compiled or allocated once
    wall: dict[str, list[float]] = {name: [] for name in learners}
    processor: dict[str, list[float]] = {name: [] for name in learners}
    for _ in tqdm(range(args.rounds), unit=" rounds", disable=None):
        for name, (learn, steps) in learners.items():
            began = time.perf_counter(), time.process_time()
            learn()
            wall[name].append(steps / (time.perf_counter() - began[0]))
            processor[name].append(steps / (time.process_time() - began[1]))
    native.close()
    shares = (np.array(wall["native"]) / np.array(wall["idle"])).tolist()
    rate, share = float(np.median(wall["native"])), float(np.median(shares))
    bars = {
        f"PPO trains with {RATE_BAR:,.0f} environment steps a second or more": (
            f"{'met' if rate >= RATE_BAR else 'not met'}: {spread(wall['native'])}"
        ),
        f"that is {SHARE_BAR:.0%} or more of the rate with an environment that does nothing": (
            f"{'met' if share >= SHARE_BAR else 'not met'}: {spread(shares, '.2f')}"
        ),
    }
    return {
        "env_id": args.env_id, "settings": settings, "rounds": args.rounds,
        "torch_threads": args.torch_threads,
        "steps_per_round": learners["native"][1], "wall": wall, "processor": processor, "shares": shares,
        "bars": bars, "command": runs.command(), "versions": runs.versions(),
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M UTC}",
    }  # fmt: skip


def spread(values: list[float], form: str = ",.0f") -> str:
    """Median, quartiles and extremes."""
    low, first, middle, third, high = (format(x, form) for x in np.percentile(values, (0, 25, 50, 75, 100)))
    return f"{middle} ({first} to {third}; {low} to {high})"


def table(found: dict[str, Any]) -> str:
    """The page of a measurement."""
    versions = ", ".join(f"{name} {value}" for name, value in found["versions"].items())
    lines = [
        "# How fast PPO trains", "",
        f"Written by `python -m agents.throughput`. PPO of agents/hyperparams/ppo.yml on {found['env_id']}, "
        f"{found['settings']['n_envs']} environments, torch on {found['torch_threads']} thread; "
        f"{found['rounds']} rounds by turns, each of {found['steps_per_round']:,} environment steps with "
        "their updates: median (quartiles; extremes).", "",
        "| environment | steps/s of wall time | of the processor's time |", "|---|---|---|",
        *(
            f"| {title} | {spread(found['wall'][name])} | {spread(found['processor'][name])} |"
            for name, title in (("native", "the leg, native"), ("idle", "one that does nothing"))
        ),
        "", "| bar | |", "|---|---|", *(f"| {bar} | {said} |" for bar, said in found["bars"].items()), "",
        f"{found['date']}; {versions}.", "",
    ]  # fmt: skip
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.throughput", description=__doc__)
    found = measure(args)
    runs.write_text(args.out, json.dumps(found, indent=1) + "\n")
    runs.write_text(args.out.with_suffix(".md"), table(found))
    for bar, said in found["bars"].items():
        print(f"{bar}: {said}")


if __name__ == "__main__":
    run(main)

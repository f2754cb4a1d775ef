"""Cost of disturbances: the time of a step with each of them, and with all, over the time without any.

    python -m benchmarks.disturbances                    about two minutes
    python -m benchmarks.disturbances --env-id hoof_env/Horse-v0
    python -m benchmarks.disturbances --num-envs 1 --steps 300 --rounds 30

Environments of all cases take turns, each for a few steps, in processor time; ratios are of the least
times. Kernels are the same in all cases: what is off costs a comparison.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import time
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from hoof_env._output import markdown_table

CASES: dict[str, dict[str, Any]] = {
    "none": {},
    "noise": {"noise": {"trunk": 0.02, "crank": 0.02, "gait": 0.02, "hoof": 0.02}},
    "bias": {"bias": {"trunk": 0.02, "crank": 0.02, "gait": 0.02, "hoof": 0.02}},
    "pushes": {"push_impulse": (-10.0, 10.0), "push_seconds": (2.0, 4.0)},
    "observation_delay": {"observation_delay": 2},
    "action_delay": {"action_delay": 2, "last_actions": 2},
    "delays by half a step": {"observation_delay": 0.5, "action_delay": 0.5},
    "history": {"observation_history": 3},
    "privileged": {"privileged": ("trunk", "gait", "hoof")},
}
"""Settings by the name of what they switch on."""

TOGETHER = ("noise", "bias", "pushes", "observation_delay", "action_delay")


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_id: str = "hoof_env/HorseLeg-v0"
    num_envs: int = 1024
    steps: int = 10
    """of a turn"""
    rounds: int = 15


def times(args: Args) -> dict[str, float]:
    """Return the least time of a step of one environment by case [us]."""
    cases = CASES | {"the first five": {k: v for name in TOGETHER for k, v in CASES[name].items()}}
    envs = {name: gym.make_vec(args.env_id, num_envs=args.num_envs, **given) for name, given in cases.items()}
    shape = envs["none"].action_space.shape or ()
    actions = np.random.default_rng(0).uniform(-1, 1, (args.steps, *shape)).astype(np.float32)
    for each in envs.values():
        each.reset(seed=0)
        each.step(actions[0])
    least = dict.fromkeys(envs, np.inf)
    for _ in range(args.rounds):
        for name, each in envs.items():
            began = time.process_time()
            for taken in actions:
                each.step(taken)
            spent = time.process_time() - began
            least[name] = min(least[name], 1e6 * spent / args.steps / args.num_envs)
    return least


def main(argv: list[str] | None = None) -> None:
    """Time all cases and print the table."""
    import tyro

    found = times(tyro.cli(Args, args=argv, prog="python -m benchmarks.disturbances", description=__doc__))
    rows = [(name, f"{spent:.2f}", f"{spent / found['none']:.2f}") for name, spent in found.items()]
    print(markdown_table(("on", "us a step", "over none"), rows))


if __name__ == "__main__":
    main()

"""How fast pictures are drawn off-screen: `python -m benchmarks.render_speed`.

The run of `hoof_env/HorseLeg-v0` at the default size. "render alone" is Gymnasium's `benchmark_render`, which
draws one instant again and again; "step and render" is what a film does, a control step and a picture.
"""

from __future__ import annotations

import platform
import statistics
import time
from typing import Any

import gymnasium as gym
from gymnasium.utils.performance import benchmark_render

import hoof_env
from hoof_env.envs.policies import make_policy

SECONDS, ROUNDS = 2.0, 5
"""Length of one measurement [s], and how many of them: the middle one and the spread are printed."""

ENV_ID = "hoof_env/HorseLeg-v0"


def step_and_render(env: gym.Env, seconds: float) -> float:
    """Pictures per second of wall time, a control step before each."""
    policy = make_policy("run", env)
    observation, _ = env.reset(seed=0, options={"gait": "run"})
    count, start = 0, time.perf_counter()
    while (taken := time.perf_counter() - start) < seconds:
        observation, _, failed, truncated, _ = env.step(policy.predict(observation)[0])
        env.render()
        count += 1
        if failed or truncated:
            observation, _ = env.reset(seed=0, options={"gait": "run"})
    return count / taken


def main() -> None:
    with gym.make(ENV_ID, render_mode="rgb_array") as env:
        env.reset(seed=0)
        picture: Any = env.render()
        size = "x".join(map(str, picture.shape[1::-1]))
        step_and_render(env, 0.5)  # compiles, and moves the leg
        life = env.metadata["render_fps"]
        print(f"hoof-env {hoof_env.__version__}, {ENV_ID}, {size}, Python {platform.python_version()}")
        print("| what | frames/s | lowest to highest | times real time |\n|---|---|---|---|")
        for name, measure in (
            ("render alone", lambda: benchmark_render(env, target_duration=int(SECONDS))),
            ("step and render", lambda: step_and_render(env, SECONDS)),
        ):
            rates = sorted(measure() for _ in range(ROUNDS))
            middle = statistics.median(rates)
            print(f"| {name} | {middle:.0f} | {rates[0]:.0f} to {rates[-1]:.0f} | {middle / life:.1f} |")


if __name__ == "__main__":
    main()

"""How fast the environments are, beside Gymnasium's HalfCheetah-v5 and EnvPool's, on one thread.

    python -m benchmarks.env_speed          writes env_speed.json and .md, where `benchmarks.speed` does

An environment step is 20 substeps of 1 ms here and 5 of 10 ms there; `HorseLegFixed` takes 200 of 0.1 ms and
has no bars. One process, random actions, observations, rewards and resets included, rounds interleaved; a
ratio is taken within a round. EnvPool is measured where it is installed, with one thread and as many
environments as serve it best; else HalfCheetah-v5 stands for it.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import importlib.util
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import hoof_env  # noqa: F401  registers the ids
from benchmarks.history import RESULTS, keep
from benchmarks.machine import machine, vector_bits
from benchmarks.rounds import describe, interleave, is_met, spread, table
from hoof_env._output import staged

BARRED = ("HorseLeg", "HorseLegRail", "HorseLegSpeed", "HorseLegTerrain")
IDS = (*BARRED, "HorseLegFixed")
BATCH = 1024
SINGLE_BAR, VECTOR_BARS = 5.0, (20.0, 35.0)
POOLS = (64, 256, 1024)

INTRO = """\
# How fast the environments are

Written by `python -m benchmarks.env_speed`, part of `make bench`. One process, one thread, {rounds}
interleaved rounds of wall time: median (quartiles; extremes). A step is 20 substeps; HorseLegFixed takes
200, so it has no bars. Bits: of the widest vectors in the code that numba compiles; the others are as they
come."""


def single(env_id: str, steps: int) -> Callable[[], float]:
    """Seconds of `steps` single steps with random actions."""
    env = gym.make(env_id)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(steps)]
    env.reset(seed=0)

    def run() -> float:
        begin = time.perf_counter()
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return time.perf_counter() - begin

    run()
    return run


def vector(envs: Any, num_envs: int, steps: int) -> Callable[[], float]:
    """Seconds of `steps` steps of all environments with random actions."""
    space, generator = envs.action_space, np.random.default_rng(0)
    shape = (num_envs, space.shape[-1])
    actions = [generator.uniform(-1, 1, shape).astype(space.dtype) for _ in range(8)]
    envs.reset()

    def run() -> float:
        begin = time.perf_counter()
        for k in range(steps):
            envs.step(actions[k % 8])
        return time.perf_counter() - begin

    run()
    return run


def measure(rounds: int, steps: int) -> dict[str, Any]:
    """Rates and ratios."""
    cheetah = "HalfCheetah-v5, single"
    runs, units = {cheetah: single("HalfCheetah-v5", steps)}, {cheetah: steps}
    for name in IDS:
        env_id = f"hoof_env/{name}-v0"
        runs[f"{name}, single"], units[f"{name}, single"] = single(env_id, steps), steps
        title, many = f"{name}, {BATCH} at once", max(steps // 20, 5)
        runs[title], units[title] = vector(gym.make_vec(env_id, num_envs=BATCH), BATCH, many), many * BATCH
    if importlib.util.find_spec("envpool"):
        import envpool

        for size in POOLS:
            envs = envpool.make("HalfCheetah-v4", env_type="gymnasium", num_envs=size, num_threads=1)
            title, few = f"EnvPool HalfCheetah-v4, {size} at once", max(4 * steps // size, 2)
            runs[title], units[title] = vector(envs, size, few), few * size
    seconds = interleave(runs, rounds)
    rate = {name: units[name] / seconds[name] for name in runs}
    pools = [name for name in rate if name.startswith("EnvPool")]
    pool = max(pools, key=lambda name: float(np.median(rate[name])), default=cheetah)
    rows = []
    for name in rate:
        beside, bars = (cheetah, [SINGLE_BAR]) if name.endswith("single") else (pool, list(VECTOR_BARS))
        rows.append(
            {"case": name, "bits": vector_bits() if name.startswith(IDS) else None,
             "rate": spread(rate[name]), "beside": beside, "ratio": spread(rate[name] / rate[beside]),
             "bars": bars if name.split(",")[0] in BARRED else None}
        )  # fmt: skip
    return {"machine": machine(), "bits": vector_bits(), "rounds": rounds, "rows": rows}


def page(result: dict[str, Any]) -> str:
    """The table as Markdown."""
    lines = [
        [
            row["case"],
            str(row["bits"] or ""),
            f"{row['rate']['median']:,.0f}",
            row["beside"],
            describe(row["ratio"]),
            " ".join(is_met(bar, row["ratio"]) for bar in row["bars"] or ()),
        ]
        for row in result["rows"]
    ]
    head = ["case", "bits", "environment steps/s", "beside", "ratio", "bars"]
    about = table(["", ""], [[key, value] for key, value in result["machine"].items()])
    return "\n\n".join((INTRO.format(**result), about, table(head, lines))) + "\n"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--steps", type=int, default=2000, help="of a single environment in a round")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for those of all vector widths")
    given = parser.parse_args()
    result = measure(given.rounds, given.steps)
    print(page(result))
    with staged(given.out / f"{result['bits']}-bits") as folder:
        (folder / "env_speed.json").write_text(json.dumps(result, indent=1) + "\n")
        (folder / "env_speed.md").write_text(page(result))
    rows = [(row["case"], row["beside"], row["ratio"], (row["bars"] or [None])[0]) for row in result["rows"]]
    keep(given.out, result["machine"], result["bits"], rows)


if __name__ == "__main__":
    main()

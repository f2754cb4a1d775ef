"""Speed of the environments compared with Gymnasium's HalfCheetah-v5 and EnvPool's, on one thread.

    python -m benchmarks.env_speed          writes env_speed.json and .md, where `benchmarks.speed` does

An environment step is 20 substeps of 1 ms here and 5 of 10 ms there; `HorseLegFixed` takes 200 of 0.1 ms and
has no bars. One process, random actions, observations, rewards and resets included, rounds interleaved; a
ratio is taken within a round. EnvPool is measured if it is installed, with one thread and the number of
environments that serves it best; else HalfCheetah-v5 stands for it.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import importlib.util
import time
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import hoof_env  # noqa: F401  registers the ids
from benchmarks.compare_cases import step, step_many
from benchmarks.history import RESULTS, write
from benchmarks.machine import machine, vector_bits
from benchmarks.rounds import bar_text, describe, interleave, spread, timed
from hoof_env._output import markdown_table

OF_A_LEG = ((5.0,), (20.0, 35.0))
BARS = {
    "HorseLeg": OF_A_LEG,
    "HorseLegRail": OF_A_LEG,
    "HorseLegSpeed": OF_A_LEG,
    "HorseLegTerrain": OF_A_LEG,
    "Horse": ((3.0,), (10.0,)),
    "HorseLegFixed": ((), ()),
}
"""Least ratios of each id, single and many at once."""
SMALL = 0.1  # part of random actions that a horse takes, which falls within half a second under whole ones
BATCH = 1024
POOLS = (64, 256, 1024)

INTRO = """\
# How fast the environments are

Written by `python -m benchmarks.env_speed`, part of `make bench`. One process, one thread, {rounds}
interleaved rounds of wall time: median (quartiles; extremes). A step is 20 substeps; HorseLegFixed takes
200, so it has no bars. A horse takes random actions of a tenth of the size, so that it does not fall. Bits:
of the widest vectors in the code of kernels; the others are as they come."""


def measure(rounds: int, steps: int) -> dict[str, Any]:
    """Return rates and ratios."""
    cheetah = "HalfCheetah-v5, single"
    runs = {cheetah: step(gym.make("HalfCheetah-v5"), steps)}
    units = {cheetah: steps}
    # Many at once take fewer steps, so that rounds are about as long
    for name in BARS:
        single = f"{name}, single"
        all_at_once = f"{name}, {BATCH} at once"
        batch_steps = max(steps // 20, 5)
        env = gym.make(f"hoof_env/{name}-v0")
        envs = gym.make_vec(f"hoof_env/{name}-v0", num_envs=BATCH)
        envs.reset(seed=0)
        size = SMALL if name == "Horse" else 1.0
        runs |= {single: step(env, steps, size), all_at_once: step_many(envs, BATCH, batch_steps, size)}
        units |= {single: steps, all_at_once: batch_steps * BATCH}
    if importlib.util.find_spec("envpool"):
        import envpool

        for size in POOLS:
            pool = envpool.make("HalfCheetah-v4", env_type="gymnasium", num_envs=size, num_threads=1)
            pool.reset()
            title = f"EnvPool HalfCheetah-v4, {size} at once"
            few = max(4 * steps // size, 2)
            runs[title] = step_many(pool, size, few)
            units[title] = few * size
    clocked = {name: partial(timed, time.perf_counter, lambda: None, run) for name, run in runs.items()}
    seconds = interleave(clocked, rounds)
    rate = {name: units[name] / seconds[name] for name in runs}
    pools = [name for name in rate if name.startswith("EnvPool")]
    best = max(pools, key=lambda name: float(np.median(rate[name])), default=cheetah)
    rows = []
    for name in rate:
        # One is compared with one, many with the best pool
        is_single = name.endswith("single")
        bars = BARS.get(name.split(",")[0], ((), ()))
        reference = cheetah if is_single else best
        rows.append(
            {
                "case": name,
                "bits": vector_bits() if name.startswith("Horse") else None,
                "rate": spread(rate[name]),
                "beside": reference,
                "ratio": spread(rate[name] / rate[reference]),
                "bars": list(bars[0] if is_single else bars[1]) or None,
            }
        )
    return {"machine": machine(), "bits": vector_bits(), "rounds": rounds, "rows": rows}


def page(result: dict[str, Any]) -> str:
    """Return the table as Markdown."""
    lines = [
        [
            row["case"],
            str(row["bits"] or ""),
            f"{row['rate']['median']:,.0f}",
            row["beside"],
            describe(row["ratio"]),
            " ".join(bar_text(bar, row["ratio"]) for bar in row["bars"] or ()),
        ]
        for row in result["rows"]
    ]
    head = ["case", "bits", "environment steps/s", "beside", "ratio", "bars"]
    about = markdown_table(["", ""], [[key, value] for key, value in result["machine"].items()])
    return "\n\n".join((INTRO.format(**result), about, markdown_table(head, lines))) + "\n"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--steps", type=int, default=2000, help="of a single environment in a round")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of results of all vector widths")
    args = parser.parse_args()
    result = measure(args.rounds, args.steps)
    print(page(result))
    rows = [(row["case"], row["beside"], row["ratio"], (row["bars"] or [None])[0]) for row in result["rows"]]
    write(args.out, "env_speed", result, page(result), rows)


if __name__ == "__main__":
    main()

"""Speed of vector steps inside `jax.jit`, by `envs.xla()` and by `io_callback`, beside a Python loop.

    python -m benchmarks.jax_speed

A linear policy acts; the processor time and the wall-clock time of a vector step, each the least of many
short measurements that alternate, in one process. The column of the kernel is what no caller can save: the
kernel of the step, without the policy. Needs the extra `jax`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import io_callback

import hoof_env  # noqa: F401 - registers the environments
from hoof_env._output import markdown_table

ID = "hoof_env/HorseLeg-v0"
NAMES = LOOP, XLA, _, _ = "Python loop", "`envs.xla()`", "`io_callback`", "kernel alone"
STEPS = {16: 200, 128: 200, 1024: 25}
"""Steps of a measurement by rows: long beside the call of a program, and short, 30 ms at most, so that a busy
machine leaves some uninterrupted."""

EPISODE = 500
"""Steps of an episode."""

ROUNDS = 60


def new_envs(count: int) -> Any:
    """Return environments at the start of episodes."""
    envs: Any = gym.make_vec(ID, num_envs=count).unwrapped
    envs.reset(seed=0)
    return envs


def python_loop(count: int, weights: Any) -> Callable[[], Any]:
    """Return a loop of steps in Python."""
    envs = new_envs(count)
    observations = envs.reset(seed=0)[0]

    def run() -> None:
        nonlocal observations
        for _ in range(STEPS[count]):
            observations, *_ = envs.step(np.tanh(observations @ weights))

    return run


def inside_jit(count: int, weights: Any) -> Callable[[], Any]:
    """Return a scan over `envs.xla()`."""
    envs = new_envs(count)
    handle, recv, _, step = envs.xla()

    def body(carry: Any, _: Any) -> Any:
        handle, observations = carry
        handle, states = step(handle, jnp.tanh(observations @ weights))
        return (handle, states.observations), (states.rewards, states.terminated | states.truncated)

    roll = jax.jit(lambda carry: jax.lax.scan(body, carry, length=STEPS[count])[0])
    handle, states = recv(handle)
    carry = handle, states.observations

    def run() -> None:
        nonlocal carry
        carry = jax.block_until_ready(roll(carry))

    return run


def by_callback(count: int, weights: Any) -> Callable[[], Any]:
    """Return a scan over a call of `step` by `io_callback`."""
    envs = new_envs(count)
    first = jnp.asarray(envs.reset(seed=0)[0])
    kinds = jax.ShapeDtypeStruct(first.shape, jnp.float32), jax.ShapeDtypeStruct((count,), jnp.float32)

    def host(actions: Any) -> Any:
        observations, rewards, *_ = envs.step(np.asarray(actions))
        return observations, rewards.astype(np.float32)

    def body(observations: Any, _: Any) -> Any:
        return io_callback(host, kinds, jnp.tanh(observations @ weights), ordered=True)

    roll = jax.jit(lambda observations: jax.lax.scan(body, observations, length=STEPS[count])[0])
    observations = first

    def run() -> None:
        nonlocal observations
        observations = jax.block_until_ready(roll(observations))

    return run


def kernel_alone(count: int, weights: Any) -> Callable[[], Any]:
    """Return a loop that times nothing but the kernel of the step."""
    envs = new_envs(count)
    batch = envs.batch
    taken = 0

    def run() -> Any:
        nonlocal taken
        if taken + STEPS[count] > EPISODE:
            envs.reset(seed=0)
            taken = 0
        taken += STEPS[count]
        spent = np.zeros(2)
        for _ in range(STEPS[count]):
            batch.rows.actions[:count] = np.tanh(batch.rows.observations[:count] @ weights)
            begin = np.array([time.process_time(), time.perf_counter()])
            batch.run_kernels()
            spent += np.array([time.process_time(), time.perf_counter()]) - begin
        return spent

    return run


def measure() -> dict[str, Any]:
    """Return microseconds of processor and of wall clock of a vector step, for each number of rows."""
    rows = []
    for count in STEPS:
        envs = new_envs(count)
        shape = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
        weights = (np.random.default_rng(0).normal(size=shape) * 0.3).astype(np.float32)
        runs = [make(count, weights) for make in (python_loop, inside_jit, by_callback, kernel_alone)]
        times = np.zeros((ROUNDS + 1, len(runs), 2))
        for each in times:
            for k, run in enumerate(runs):
                start = np.array([time.process_time(), time.perf_counter()])
                own: Any = run()
                each[k] = np.array([time.process_time(), time.perf_counter()]) - start if own is None else own
        least = times[1:].min(axis=0) / (STEPS[count]) * 1e6
        rows.append({"rows": count, **dict(zip(NAMES, least.tolist(), strict=True))})
    return {"id": ID, "rows": rows}


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of `measure`."""
    cells = []
    for row in rows:
        loop, xla = row[LOOP], row[XLA]
        times = (f"{row[name][0]:.0f} ({row[name][1]:.0f})" for name in NAMES)
        cells.append([f"{row['rows']:,}", *times, *(f"{loop[k] / xla[k]:.2f}" for k in (0, 1))])
    return markdown_table(("rows", *NAMES, "loop / xla", "by wall clock"), cells)


if __name__ == "__main__":
    print(f"jax {jax.__version__}, {ID}, microseconds of processor (of wall clock) a vector step")
    print(table(measure()["rows"]))

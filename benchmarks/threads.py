"""Gain of threads: one, two or more that share 1024 legs, compared with as many separate processes.

    python -m benchmarks.threads          writes threads.json and .md, where `benchmarks.speed` does

A round has each case once, in a new order: one thread, T threads that are joined after each control step, and
T processes with a T-th of the legs each, which begin together and do not wait for each other. Then the cost
of a call to a thread and the time of a group of columns, from which the table of more cores is computed, not
measured.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.history import RESULTS, write
from benchmarks.machine import machine, vector_bits
from benchmarks.rounds import bar_text, describe, interleave, spread
from hoof_env._output import markdown_table
from hoof_env.dynamics.advance import LANES
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.simd import Whole
from hoof_env.simd.compile import Kernel
from hoof_env.simd.threads import available, run_together

LEGS = 1024
STEPS = 60
BESIDE_PROCESSES = 0.9
BESIDE_ONE = 1.5
CORES = (2, 4, 8, 16, 32, 64)
MODELLED = (1024, 8192)

INTRO = """\
# What threads gain

Written by `python -m benchmarks.threads`. {legs} legs, random actions, {steps} control steps of 20 substeps a
case, {rounds} interleaved rounds of wall time: median (quartiles; extremes). A process has its share of the
legs and waits for no other thread; threads are joined after each control step."""

MODEL = """\
## More cores: computed, not measured

A control step of n legs on p threads takes f (s + g ceil(n / 8 p)) + c (p - 1): s is what one thread does for
all legs (actions, observations, rewards, resets), g the time of a group of eight columns, c that of a call to
a thread and its answer, f how much slower a processor is while another works, as the processes above say.
Here s = {serial:.0f} us for 1024 legs and in proportion to them, g = {group:.1f} us, f = {neighbours:.2f},
c = {call:.0f} us (medians; c of an empty kernel). The row of two threads shows how far the model may be off.
Left out are what a thread waits for one that is slower, and what more processors share than two do."""


class Legs:
    """Environments that are stepped with random actions."""

    def __init__(self, count: int, **options: Any) -> None:
        self.envs = HorseLegVectorEnv(num_envs=count, task="leg", **options)
        self.envs.reset(seed=0)
        shape = self.envs.action_space.shape or ()
        uniform = np.random.default_rng(0).uniform
        self.actions = [uniform(-1, 1, shape).astype(np.float32) for _ in range(8)]

    def run(self) -> float:
        """Return the wall time [s] of `STEPS` steps."""
        begin = time.perf_counter()
        for k in range(STEPS):
            self.envs.step(self.actions[k % 8])
        return time.perf_counter() - begin

    def serial_and_kernel(self) -> tuple[float, float]:
        """Return the wall time [s] of a step outside the kernel and in it."""
        batch_step = EpisodeBatch.step
        spent = 0.0

        def step(*arguments: Any) -> bool:
            nonlocal spent
            begin = time.perf_counter()
            ended = batch_step(*arguments)
            spent += time.perf_counter() - begin
            return ended

        # Timed from outside: the package has no clock in it
        with patch.object(EpisodeBatch, "step", step):
            whole = self.run()
        return (whole - spent) / STEPS, spent / STEPS


def work(pipe: Connection, count: int) -> None:
    """Run once per message, in a worker process."""
    legs = Legs(count)
    legs.run()
    pipe.send(None)
    while pipe.recv():
        legs.run()
        pipe.send(None)


class Processes:
    """Worker processes that share the legs equally."""

    def __init__(self, count: int) -> None:
        # a forked process would inherit threads
        context = multiprocessing.get_context("spawn")
        self.pipes = []
        for _ in range(count):
            ours, theirs = context.Pipe()
            context.Process(target=work, args=(theirs, LEGS // count), daemon=True).start()
            self.pipes.append(ours)
        self.wait()

    def end(self) -> None:
        """End the processes."""
        for pipe in self.pipes:
            pipe.send(False)

    def wait(self) -> None:
        """Wait until all have run."""
        for pipe in self.pipes:
            pipe.recv()

    def run(self) -> float:
        """Return the wall time [s] from the message until the last is done."""
        begin = time.perf_counter()
        for pipe in self.pipes:
            pipe.send(True)
        self.wait()
        return time.perf_counter() - begin


def call_cost(calls: int) -> float:
    """Return the time [s] of each additional call to a thread, of a kernel that does nothing."""

    def nothing(x: Whole) -> None:
        """Do nothing."""

    kernel = Kernel(nothing, [int], is_threaded=True)

    def timed(count: int) -> float:
        begin = time.perf_counter()
        run_together(kernel, [(1,)] * count, count)
        return time.perf_counter() - begin

    timed(1), timed(calls)  # compiled, and threads started
    return float(np.median([timed(calls) - timed(1) for _ in range(500)])) / (calls - 1)


def gain(legs: int, threads: int, serial: float, group: float, call: float, neighbours: float) -> float:
    """Return the speed of `threads` threads over one thread's by the page's model; `serial` is for `LEGS`."""
    groups = -(-legs // LANES)

    def seconds(p: int) -> float:
        return serial * legs / LEGS + group * -(-groups // p)

    return seconds(1) / (neighbours * seconds(threads) + call * (threads - 1))


def measure(rounds: int, threads: int) -> dict[str, Any]:
    """Return rates, ratios, and the parameters of the model."""
    single = Legs(LEGS)
    several = Legs(LEGS, num_threads=threads)
    processes = Processes(threads)
    shared = f"{threads} threads"
    apart = f"{threads} processes"
    runs: dict[str, Callable[[], float]] = {"1 thread": single.run, shared: several.run, apart: processes.run}
    seconds = interleave(runs, rounds)
    processes.end()
    parts = np.array([single.serial_and_kernel() for _ in range(rounds)])
    # Medians of each, as the page says
    serial, kernel = np.median(parts, 0).tolist()
    ratios = [
        (shared, "1 thread", seconds["1 thread"] / seconds[shared], BESIDE_ONE),
        (apart, "1 thread", seconds["1 thread"] / seconds[apart], None),
        (shared, apart, seconds[apart] / seconds[shared], BESIDE_PROCESSES),
    ]
    return {
        "machine": machine(),
        "bits": vector_bits(),
        "rounds": rounds,
        "legs": LEGS,
        "steps": STEPS,
        "rate": {name: spread(LEGS * STEPS / values) for name, values in seconds.items()},
        "ratios": [(case, reference, spread(ratio), bar) for case, reference, ratio, bar in ratios],
        "serial": serial,
        "group": kernel * LANES / LEGS,
        "call": call_cost(threads),
        "neighbours": threads / float(np.median(seconds["1 thread"] / seconds[apart])),
    }


def page(result: dict[str, Any]) -> str:
    """Return the tables as Markdown."""
    rates = [[name, f"{rate['median']:,.0f}", describe(rate)] for name, rate in result["rate"].items()]
    ratios = [
        [case, reference, describe(ratio), bar_text(bar, ratio) if bar else ""]
        for case, reference, ratio, bar in result["ratios"]
    ]
    model = [result[key] for key in ("serial", "group", "call", "neighbours")]
    more = [[str(p), *(f"{gain(legs, p, *model):.1f}" for legs in MODELLED)] for p in CORES]
    micro = {key: 1e6 * result[key] for key in ("serial", "group", "call")}
    about = markdown_table(["", ""], [[key, value] for key, value in result["machine"].items()])
    return (
        "\n\n".join(
            (
                INTRO.format(**result),
                about,
                markdown_table(["", "environment steps/s", "spread"], rates),
                markdown_table(["case", "beside", "ratio", "bar"], ratios),
                MODEL.format(**result | micro),
                markdown_table(["threads", *(f"{legs} legs" for legs in MODELLED)], more),
            )
        )
        + "\n"
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--threads", type=int, default=2, help="and processes")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of results of all vector widths")
    args = parser.parse_args()
    if not 2 <= args.threads <= available():
        parser.error(f"--threads: expected 2 to {available()}, the processors here, got {args.threads}")
    result = measure(args.rounds, args.threads)
    print(page(result))
    write(args.out, "threads", result, page(result), result["ratios"])


if __name__ == "__main__":
    main()

"""Reference gaits of the horse, found by CMA-ES: `python -m agents.horse_gaits`.

The search plays zero actions on `hoof_env/Horse-v0` around gaits of its own and knows nothing but the return,
with weights of its own. It begins from nothing at Froude number 0.25, and then commands a little more speed
every few generations, or less, so that neighbours are alike: actions set offsets to gaits interpolated
between them. A second family, trot-like, has the weights of the task and must also land fore and hind hooves
at the same time, and once a stride, as horses do in a trot or a pace. Searches that are in the file are not
made again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from agents import gait_figures, runs
from agents.command import parse, run
from agents.evolution import generations, make_strategy, mean_costs, require
from agents.kept import check_shape, read_kept
from agents.rules import MAX_SLIP, TROT
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import make_policy
from hoof_env.evaluation.episodes import make_rows
from hoof_env.simd.threads import limit_threads
from hoof_env.tasks.horse import HIP_HEIGHT
from hoof_env.tasks.horse_gaits import LEGS, LIMITS, NAMES, PAIRS, Stride, bounds

Floats = NDArray[np.float64]

POPULATION = 32
STARTS = 8
SECONDS = 5.0
"""Candidates of a generation, episodes of each, and their length [s]."""

FIRST = 0.4  # spread of a search from nothing
NEXT = 0.05  # least spread where the speed changes
STEP = 1.03  # ratio of one speed to the next
FROUDE = 0.25  # Froude number at which the search begins
# Froude numbers that the task commands; the slower gaits end at the first
LOWEST = 0.1
HIGHEST = 1.0
KNOTS = (1.2, 1.5, 1.85, 2.2, 2.6, 3.0, 3.4)  # speeds that the reference gaits have, about [m/s]
MOST = 40  # steps of speed at most
# Largest share of falls and largest relative distance of speeds of shipped gaits
STABLE = 0.1
NEAR = 0.05
HARMONICS = 3  # number of harmonics of the trunk's motion
FALLEN = 0.1  # share of falls at which the speed is raised no more
TROT_FROUDE = 0.5  # Froude number at which the trot-like family begins
LAG = 600.0  # cost of a stride between the landings of hind and fore hooves in the trot-like family

WEIGHTS = {
    "alive": 11.0,
    "tracking": 5.0,
    "peak": 0.35,
    "slip": 6.0,
    "landing": 0.3,
    "work": 0.5,
    "pitch": 4.0,
    "fall": 20.0,
}
"""Reward weights of the search for the reference gaits: an early reward of the task, which charges less for
slip than today's."""

TROT_WEIGHTS = {"landing": 2.0}
"""Reward weights of the search for trot-like gaits that differ from the task's: with a smaller one for
landing, hind hooves land twice a stride."""

CENTRE = (1.05, 0.45, -0.7, 0.0, 0.0)  # swing about which a search from nothing begins [rad]
SPANS = (0.5, 0.4, 0.4, 0.3, 0.3)
# Range of the crank rate [rad/s]; largest harmonic of the crank's speed [-]
RATE = (2.5, 12.5)
PART = 0.6


def decode(x: Floats) -> Floats:
    """Convert points of the box [-1, 1] to gaits, both of shape (n, 16)."""
    low = [RATE[0], -0.5, *[-PART, -PART, *np.subtract(CENTRE, SPANS)] * len(PAIRS)]
    high = [RATE[1], 0.5, *[PART, PART, *np.add(CENTRE, SPANS)] * len(PAIRS)]
    # The box is wider than what a gait may be at some points
    return np.clip(low + (x + 1) / 2 * np.subtract(high, low), *bounds())


def encode(gaits: Floats) -> Floats:
    """Convert gaits, shape (n, 16), to points within the box; the inverse of `decode`."""
    low = decode(-np.ones((1, gaits.shape[-1])))
    high = decode(np.ones((1, gaits.shape[-1])))
    return np.clip(2 * (gaits - low) / (high - low) - 1, -1, 1)


class BatchRollout:
    """Batch of horses with one commanded speed.

    Args:
        speed: commanded speed [m/s].
        num_envs: horses.
        weights: terms of the reward; those left out have the task's weights.
        **settings: more arguments of the environment.
    """

    def __init__(
        self, speed: float, num_envs: int, weights: Mapping[str, float] = WEIGHTS, **settings: Any
    ) -> None:
        envs: Any = gym.make_vec(
            "hoof_env/Horse-v0",
            num_envs,
            num_threads=limit_threads(2),
            target_speed=speed,
            autoreset_mode=AutoresetMode.SAME_STEP,
            reward_weights=weights,
            **{"episode_seconds": SECONDS, **settings},
        )
        self.envs = envs
        self.steps = round(envs.unwrapped.settings.episode_seconds / envs.unwrapped.dt)

    def play(
        self, gaits: Floats, seed: int, starts: int = STARTS
    ) -> tuple[Floats, list[dict[str, float]], Floats]:
        """Play the first episodes of gaits, shape (n, 16).

        Consecutive gaits meet `starts` different starts, which then repeat.

        Returns:
            Returns, shape (n,), summaries of the episodes, and lags [strides], shape (n,).
        """
        envs = self.envs
        n = len(gaits)
        envs.reset(seed=[seed + k % starts for k in range(n)], options={"gait": gaits})
        returns = np.zeros(n)
        ended = np.zeros(n, bool)
        summaries: list[dict[str, float]] = [{} for _ in range(n)]
        idle = np.zeros((n, 16), np.float32)
        lags = np.zeros(n, complex)
        for step in range(self.steps):
            _, rewards, terminated, truncated, infos = envs.step(idle)
            returns += np.where(ended, 0.0, rewards)
            for env in np.flatnonzero((terminated | truncated) & ~ended):
                columns = infos["final_info"]["episode_summary"]
                summaries[env] = {
                    name: float(values[env]) for name, values in columns.items() if not name.startswith("_")
                }
            ended |= terminated | truncated
            if ended.all():
                break
            # Only stances in the gait itself count, not the first ones
            if step > self.steps // 3:  # hooves have landed in the gait
                m = infos["measured"]
                lags += ~ended * landings(gaits, np.array([m[f"{leg}_stance_began"] for leg in LEGS]))
        return returns, summaries, np.angle(lags) / (4 * np.pi)


def landings(gaits: Floats, theta: Floats) -> NDArray[np.complex128]:
    """Return the mean of e^(4 pi i lag) over hooves, shape (n,), where the lag [strides] is the time from
    hind to fore.

    Left and right are half a stride apart, so half a stride counts as a whole turn.

    Args:
        gaits: gaits, shape (n, 16).
        theta: crank angles at which the hooves land [rad], shape (4, n).
    """
    at = []
    for k, numbers in enumerate(gaits[:, 2:].reshape(len(gaits), len(PAIRS), -1).transpose(1, 2, 0)):
        stride = Stride(numbers[0], numbers[1])
        lead = gaits[:, 1] * (k == 0)
        begin = _complex(stride.phase(np.ones(len(gaits)), np.zeros(len(gaits))))
        phases = [
            _complex(stride.phase(np.cos(angles), np.sin(angles))) for angles in theta[2 * k : 2 * k + 2]
        ]
        # Relative to the phase at crank angle 0; the square makes half a stride a whole turn
        at.append((np.array(phases) / (begin * np.exp(2j * np.pi * lead))) ** 2)
    mean: NDArray[np.complex128] = at[0].mean(0) * at[1].mean(0).conj()
    return mean


def _complex(pair: tuple[Floats, Floats]) -> NDArray[np.complex128]:
    """Return a complex number from its real and imaginary part."""
    return pair[0] + 1j * pair[1]


class Search:
    """CMA-ES with a commanded speed that may change on the way.

    Args:
        seed: seed of the search and of its episodes.
        first: gait to begin with, shape (16,); None begins from nothing.
        lag: cost of a stride between the landings of hind and fore hooves; if not 0, the weights are
            `TROT_WEIGHTS`.
    """

    def __init__(self, seed: int, first: Floats | None = None, lag: float = 0.0) -> None:
        require("agents.horse_gaits", "cma")
        self.lag = lag
        self.seed = seed
        self.count = 0
        start = np.zeros(2 + len(PAIRS) * len(LIMITS)) if first is None else encode(first[None])[0]
        spread = FIRST if first is None else NEXT
        self.strategy = make_strategy(start, spread, POPULATION, seed + 1)

    def gaits(self, points: Any) -> Floats:
        """Convert points of the box, shape (n, 16), to gaits."""
        return decode(np.clip(np.asarray(points), -1, 1))

    def run(self, speed: float, count: int, tick: Any) -> dict[str, Any]:
        """Search for `count` generations at a commanded speed [m/s]; return the gait at the mean of the
        distribution and its figures."""
        course = BatchRollout(speed, POPULATION * STARTS, TROT_WEIGHTS if self.lag else WEIGHTS)
        highest = -np.inf

        def costs_of(points: list[Floats]) -> list[float]:
            nonlocal highest
            gaits = np.repeat(self.gaits(points), STARTS, axis=0)
            self.count += 1
            returns, _, lags = course.play(gaits, 10_000 * self.seed + STARTS * self.count)
            returns = returns - self.lag * np.abs(lags)
            highest = returns.max()
            return mean_costs(returns, STARTS)

        for _ in generations(self.strategy, costs_of, count):
            # The speed will change: a search that has converged could not follow
            self.strategy.sigma = max(self.strategy.sigma, NEXT)
            tick(speed, highest)
        # The mean of the distribution, not its luckiest candidate; other starts than the search's
        gait = self.gaits(self.strategy.result.xfavorite[None])[0].round(5)
        returns, summaries, lags = course.play(
            np.tile(gait, (POPULATION * STARTS, 1)), 10**6, POPULATION * STARTS
        )
        shown = ("speed_m_s", "slip_m", "cost_of_transport", "duty_factor", "failed")
        figures = {key: round(float(np.mean([summary[key] for summary in summaries])), 4) for key in shown}
        figures["lag"] = round(float(np.abs(lags).mean()), 4)
        return {"speed": round(speed, 4), "gait": gait.tolist(), "return": float(returns.mean()), **figures}


@dataclass
class Args:
    """Arguments of the command."""

    out: Path = Path("runs/horse.json")
    """what was found; one that exists is gone on with"""
    shipped: Path = Path("runs/gaits.json")
    """what of it comes with the package, as hoof_env/data/horse/gaits.json"""
    generations: int = 200
    """of a search from nothing"""
    each: int = 10
    """generations for each step of speed"""
    restarts: int = 2
    """searches from nothing, of which the best is taken"""


def speed_of(froude: float) -> float:
    """Return the speed [m/s] of a Froude number."""
    return float(np.sqrt(froude * GRAVITY * HIP_HEIGHT))


def searches_of_file(content: Any) -> dict[str, Any]:
    """Return a file of searches; raise KeyError, TypeError or ValueError for the content of another one."""
    for name, one in content["searches"].items():
        for step in one["steps"]:
            check_shape(f"gait of {name}", step["gait"], (len(NAMES),))
    return dict(content)


class Finder:
    """Searches for what the file lacks; the file is written after every search."""

    def __init__(self, args: Args) -> None:
        self.args = args
        self.content: dict[str, Any] = {"searches": {}}
        if args.out.is_file():
            self.content = read_kept(args.out, "searches of agents.horse_gaits", searches_of_file)

    def keep(self, name: str, look: Any) -> list[dict[str, Any]]:
        """Return the steps that a search found under this name, or finds now."""
        from tqdm import tqdm

        if name not in self.content["searches"]:
            began = time.monotonic()
            with tqdm(desc=name, unit=" generations", leave=False, disable=None) as bar:

                def tick(speed: float, best: float) -> None:
                    bar.update()
                    bar.set_postfix(speed=f"{speed:.2f}", best=f"{best:.1f}")

                steps = look(tick)
            wall = round(time.monotonic() - began, 1)
            self.content["searches"][name] = {"steps": steps, "wall_s": wall}
            self.content |= {"command": runs.command(), "versions": runs.versions()}
            self.args.out.parent.mkdir(parents=True, exist_ok=True)
            runs.write_text(self.args.out, json.dumps(self.content, indent=1) + "\n")
            for step in steps:
                print(name, {key: value for key, value in step.items() if key != "gait"}, flush=True)
        kept: list[dict[str, Any]] = self.content["searches"][name]["steps"]
        return kept

    def ramp(
        self, search: Search, first: float, ratio: float, last: float, tick: Any
    ) -> list[dict[str, Any]]:
        """Change the speed by a ratio until it is `last`, or the horse falls; return the gait of each
        step."""
        steps = []
        speed = first
        for _ in range(MOST):
            speed = speed * ratio
            # Beyond the last speed, upward or downward
            if (speed - last) * (ratio - 1) > 0:
                break
            steps.append(search.run(speed, self.args.each, tick))
            if steps[-1]["failed"] > FALLEN:
                break
        return steps

    def family(self, name: str, froude: float = FROUDE, lag: float = 0.0) -> None:
        """Find a gait from nothing, and gaits of higher and lower speeds from there."""
        args = self.args
        speed = speed_of(froude)
        begins = []
        for seed in range(args.restarts):
            steps = self.keep(
                f"{name} {seed}",
                lambda tick, seed=seed: [Search(seed, lag=lag).run(speed, args.generations, tick)],
            )
            begins.append(steps[0])
        # Restarts end in different gaits: the ramps go on from the best one
        best = np.array(max(begins, key=lambda one: float(one["return"]))["gait"])
        for way, ratio, last in (("faster", STEP, 8.0), ("slower", 1 / STEP, speed_of(LOWEST) / STEP)):
            self.keep(
                f"{name}, {way}",
                lambda tick, ratio=ratio, last=last: self.ramp(
                    Search(7, best, lag), speed, ratio, last, tick
                ),
            )


def trunk_series(gait: list[float], speed: float) -> list[list[float]]:
    """Return the motion of the trunk in a gait that keeps a speed [m/s], as `reference.trunk_motion` reads
    it.

    These are height divided by the hips' [-], speed divided by its mean [-] and pitch [rad]: of each the
    mean, and cosine and sine coefficients of `HARMONICS` harmonics of half a stride.
    """
    course = BatchRollout(speed, 64, episode_seconds=2 * SECONDS)
    envs = course.envs
    numbers = np.array(gait)
    body = envs.unwrapped.body
    stride = Stride(*numbers[-len(LIMITS) :][:2])
    envs.reset(seed=1, options={"gait": numbers})
    rows: list[list[Floats]] = []
    upright = np.ones(envs.num_envs, bool)
    for k in range(course.steps - 1):
        _, _, terminated, _, infos = envs.step(np.zeros((envs.num_envs, 16), np.float32))
        upright &= ~terminated
        # The first half is the way into the gait
        if k >= course.steps // 2:
            m = infos["measured"]
            rows.append([m[name].copy() for name in ("left_hind_crank_angle", "y", "vx", "pitch")])
    theta, y, vx, pitch = np.moveaxis(np.array(rows), 1, 0)[..., upright].reshape(4, -1)
    ones = np.ones(1)
    zeros = np.zeros(1)
    begin = stride.phase(ones, zeros)
    phasor = stride.phase(np.cos(theta), np.sin(theta))
    # From crank angle 0, as in `landings`
    phase = np.arctan2(phasor[1], phasor[0]) - np.arctan2(begin[1], begin[0])
    # Even harmonics of the stride: the trunk moves twice a stride
    order = 2 * np.arange(1, HARMONICS + 1)
    waves = [wave(n * phase) for n in order for wave in (np.cos, np.sin)]
    terms = np.stack([np.ones_like(phase), *waves], 1)
    moves = np.stack([y / body.height, vx / vx.mean(), pitch], 1)
    coefficients: list[list[float]] = np.linalg.lstsq(terms, moves, rcond=None)[0].T.round(6).tolist()
    return coefficients


def slip_at(gait: list[float], speed: float) -> float:
    """Return the slip of a stance of a gait at its speed [m/s], once it is settled: the larger mean of fore
    and hind hooves [m], infinite if more than a tenth of the horses fall."""
    envs: Any = make_rows("hoof_env/Horse-v0", 32)
    figures = gait_figures.play(envs, make_policy("reference", envs), speed, np.array(gait))
    return max(figures["slip_fore"], figures["slip_hind"]) if figures["fell"] < STABLE else np.inf


def shipped(searches: dict[str, Any]) -> dict[str, Any]:
    """Return the gaits that come with the package, without the motion of the trunk.

    Gaits are filed under the speed that they reach, not the commanded one; of those within `NEAR` of a knot
    it is the one that slips least. By name there are the reference at Froude number 0.25, the fastest one of
    all, and the fastest that the task may command of the trot-like ones that slip little.
    """

    def steps_of(family: str) -> list[dict[str, Any]]:
        """Return the upright steps of a family: the best start, and the ramps from it."""
        begins = [search["steps"][0] for name, search in searches.items() if name[:-1] == f"{family} "]
        steps = sorted(begins, key=lambda step: float(step["return"]))[-1:]  # the rest is another gait
        for way in ("faster", "slower"):
            steps += searches.get(f"{family}, {way}", {"steps": []})["steps"]
        return [step for step in steps if step["failed"] < STABLE]

    def near(steps: list[dict[str, Any]], speed: float) -> dict[str, Any] | None:
        """Return the step near a speed that slips least, None if there is none."""
        close = [step for step in steps if abs(step["speed_m_s"] / speed - 1) < NEAR]
        return min(close, key=lambda step: float(step["slip_m"])) if close else None

    def may_be_commanded(trot: dict[str, Any]) -> bool:
        """True if the task commands the speed of a trot and the trot slips little."""
        speed = float(trot["speed_m_s"])
        return speed <= speed_of(HIGHEST) and slip_at(trot["gait"], speed) < MAX_SLIP

    free = steps_of("free")
    trots = sorted(steps_of("trot-like"), key=lambda step: -float(step["speed_m_s"]))
    trots = [step for step in trots if step["lag"] < TROT]
    knots = {step["speed_m_s"]: step["gait"] for speed in KNOTS if (step := near(free, speed))}
    named = {
        "walk": near(free, KNOTS[2]),
        "fast": max(free + trots, key=lambda step: float(step["speed_m_s"]), default=None),
        "trot-like": next((step for step in trots if may_be_commanded(step)), None),
    }
    return {
        "reference": {"speeds": list(knots), "gaits": list(knots.values())},
        "gaits": {name: step["gait"] for name, step in named.items() if step},
    }


def main(argv: list[str] | None = None) -> None:
    """Find gaits."""
    args = parse(Args, argv, "python -m agents.horse_gaits", __doc__)
    finder = Finder(args)
    finder.family("free")
    finder.family("trot-like", TROT_FROUDE, LAG)
    found = shipped(finder.content["searches"])
    reference = found["reference"]
    each = zip(reference["gaits"], reference["speeds"], strict=True)
    reference["trunk"] = [trunk_series(gait, speed) for gait, speed in each]
    runs.write_text(args.shipped, json.dumps(found, indent=1) + "\n")
    print(f"written: {args.shipped}")


if __name__ == "__main__":
    run(main)

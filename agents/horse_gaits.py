"""Reference gaits of the horse, found by CMA-ES: `python -m agents.horse_gaits`.

The search plays zero actions on `hoof_env/Horse-v0` around gaits of its own and knows nothing but the
return. It begins at Froude number 0.25 and goes on from each speed to the next one, so that neighbours are
alike; actions lie around what is between them. Two more gaits are searched for on their own: one whose fore
and hind legs keep time, as in a trot or a pace, and the fastest, which is asked for a speed that none has.
What was found already is not searched for again.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from agents import runs
from agents.command import run
from hoof_env.envs.horse import HIP_HEIGHT
from hoof_env.envs.reference import LIMITS, PAIRS
from hoof_env.errors import HoofEnvError

Floats = NDArray[np.float64]

GRAVITY = 9.81
POPULATION, STARTS, GENERATIONS, SECONDS = 32, 4, 250, 5.0
"""Candidates of a generation, episodes of each, generations, and the length of an episode [s]."""

FROUDE = (0.25, 0.35, 0.5, 0.7, 1.0, 0.175, 0.1)
"""Of the reference gaits, in the order in which they are found: each begins with the nearest one so far."""

FIRST, NEXT = 0.4, 0.12  # spread of a search from nothing, and of one that begins with a gait
FASTEST = 12.0  # speed that the fastest gait is asked for [m/s]

CENTRE = (1.05, 0.45, -0.7, 0.0, 0.0)  # swing about which a search from nothing begins [rad]
SPANS = (0.5, 0.4, 0.4, 0.3, 0.3)
RATE, PART = (2.5, 12.5), 0.6  # crank rate [rad/s]; harmonic of the crank's speed [-]


def decode(x: Floats) -> Floats:
    """Gaits from points of the box [-1, 1], both of shape (n, 16)."""
    low = [RATE[0], -0.5, *[-PART, -PART, *np.subtract(CENTRE, SPANS)] * len(PAIRS)]
    high = [RATE[1], 0.5, *[PART, PART, *np.add(CENTRE, SPANS)] * len(PAIRS)]
    bounds = np.array([(0.1, 18.0), (-1.0, 1.0), *[*LIMITS.values()] * len(PAIRS)]).T
    return np.clip(low + (x + 1) / 2 * np.subtract(high, low), *bounds)


def encode(gaits: Floats) -> Floats:
    """Inverse of `decode`, within the box."""
    low, high = decode(-np.ones((1, gaits.shape[-1]))), decode(np.ones((1, gaits.shape[-1])))
    return np.clip(2 * (gaits - low) / (high - low) - 1, -1, 1)


class Course:
    """Many horses that are asked for one speed [m/s], on ground of a stiffness [N/m^1.5] perhaps."""

    def __init__(self, speed: float, num_envs: int, **settings: Any) -> None:
        self.envs = gym.make_vec(
            "hoof_env/Horse-v0", num_envs, num_threads=2, target_speed=speed,
            autoreset_mode=AutoresetMode.SAME_STEP, **{"episode_seconds": SECONDS, **settings},
        )  # fmt: skip
        self.steps: int = self.envs.unwrapped.batch.steps_per_episode  # type: ignore[attr-defined]

    def play(self, gaits: Floats, seed: int) -> tuple[Floats, list[dict[str, float]]]:
        """Returns of the first episodes of some gaits, shape (n, 16), and their figures. Every `STARTS` of
        them meet the same starts."""
        envs, n = self.envs, len(gaits)
        envs.reset(seed=[seed + k % STARTS for k in range(n)], options={"gait": gaits})
        returns, ended, summaries = np.zeros(n), np.zeros(n, bool), [{} for _ in range(n)]
        idle = np.zeros(envs.action_space.shape, np.float32)  # type: ignore[arg-type]
        for _ in range(self.steps):
            _, rewards, terminated, truncated, infos = envs.step(idle)
            returns += np.where(ended, 0.0, rewards)
            for env in np.flatnonzero((terminated | truncated) & ~ended):
                found = infos["final_info"]["episode_summary"]
                summaries[env] = {
                    name: float(each[env]) for name, each in found.items() if not name.startswith("_")
                }
            ended |= terminated | truncated
            if ended.all():
                break
        return returns, summaries


def search(
    course: Course, first: Floats | None, seed: int, generations: int, lead: float | None
) -> tuple[Floats, float]:
    """One CMA-ES, which begins with a gait, shape (16,), or from nothing; the mean of its last distribution
    and its mean return. `lead` is fixed if it is given."""
    try:
        import cma
        from tqdm import tqdm
    except ModuleNotFoundError:
        raise HoofEnvError('agents.horse_gaits needs cma: pip install "hoof-env[train,identify]"') from None

    def gaits_of(points: Any) -> Floats:
        gaits = decode(np.asarray(points))
        if lead is not None:
            gaits[:, 1] = lead
        return gaits

    start = np.zeros(2 + len(PAIRS) * len(LIMITS)) if first is None else encode(first[None])[0]
    options = {"bounds": [-1, 1], "popsize": POPULATION, "seed": seed + 1, "verbose": -9, "verb_log": 0}
    strategy = cma.CMAEvolutionStrategy(start, FIRST if first is None else NEXT, options)
    with tqdm(total=generations, unit=" generations", leave=False, disable=None) as bar:
        for k in range(generations):
            points = strategy.ask()
            gaits = np.repeat(gaits_of(points), STARTS, axis=0)
            returns = course.play(gaits, 10_000 * seed + STARTS * k)[0].reshape(-1, STARTS).mean(1)
            strategy.tell(points, (-returns).tolist())
            bar.update()
            bar.set_postfix(best=f"{returns.max():.2f}")
    best = gaits_of(np.clip(strategy.result.xfavorite, -1, 1)[None])[0].round(5)
    returns, _ = course.play(np.tile(best, (POPULATION * STARTS, 1)), 10**6)
    return best, float(returns.mean())


@dataclass
class Args:
    """Arguments of the command."""

    out: Path = Path("runs/horse.json")
    """what was found; one that exists is gone on with"""
    generations: int = GENERATIONS
    """of a search"""
    restarts: int = 3
    """searches from nothing, of which the best is taken"""
    only: str = ""
    """one of walk, trot, fast; otherwise all of them and the reference gaits"""


def speed_of(froude: float) -> float:
    """[m/s], of a Froude number."""
    return float(round(np.sqrt(froude * GRAVITY * HIP_HEIGHT), 3))


def main(argv: list[str] | None = None) -> None:
    """Find what the file lacks, and write it after every search."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.horse_gaits", description=__doc__)
    content: dict[str, Any] = {"searches": {}}
    if args.out.is_file():
        content = json.loads(args.out.read_text(encoding="utf-8"))
    found: dict[str, Any] = content["searches"]

    def look(name: str, speed: float, first: Floats | None, seed: int, lead: float | None = None) -> Any:
        if name in found:
            return found[name]
        began, course = time.monotonic(), Course(speed, POPULATION * STARTS)
        gait, score = search(course, first, seed, args.generations, lead)
        summaries = course.play(np.tile(gait, (POPULATION * STARTS, 1)), 2 * 10**6)[1]
        shown = ("speed_m_s", "slip_m", "cost_of_transport", "duty_factor", "failed", "stances")
        figures = {key: round(float(np.mean([one[key] for one in summaries])), 4) for key in shown}
        found[name] = {
            "speed": speed, "gait": gait.tolist(), "return": round(score, 3), **figures,
            "wall_s": round(time.monotonic() - began, 1),
        }  # fmt: skip
        content["command"], content["versions"] = runs.command(), runs.versions()
        args.out.parent.mkdir(parents=True, exist_ok=True)
        runs.write_text(args.out, json.dumps(content, indent=1) + "\n")
        print(name, {key: value for key, value in found[name].items() if key != "gait"}, flush=True)
        return found[name]

    def best_of(name: str, speed: float, lead: float | None = None) -> Floats:
        each = [look(f"{name}, search {seed}", speed, None, seed, lead) for seed in range(args.restarts)]
        return np.array(max(each, key=lambda one: float(one["return"]))["gait"])

    if args.only in ("", "walk"):
        gaits = {FROUDE[0]: best_of("walk", speed_of(FROUDE[0]))}
        for froude in FROUDE[1:]:
            near = min(gaits, key=lambda other: abs(np.log(other / froude)))
            one = look(f"Froude {froude:g}", speed_of(froude), gaits[near], 0)
            gaits[froude] = np.array(one["gait"])
    if args.only in ("", "trot"):
        best_of("trot", speed_of(1.0), 0.0)
    if args.only in ("", "fast"):
        best_of("fast", FASTEST)


if __name__ == "__main__":
    run(main)

"""Force of the suspension on the trunk of one leg, and depth of its hoof in the ground.

    python -m agents.leg_forces                 the run, the best gaits without feedback and the shipped agent
    python -m agents.leg_forces runs/a/s0 --out forces.json

The suspension is the spring, the damper and the constant force that stand for the animal's other legs. Its
force follows from the motion of the trunk and the settings of the environment; the test checks it against
the momentum of all bodies. Forces are divided by the weight of trunk and leg, positive upward, and count from
`SETTLED` on; the heat of the damper, the work of the drives and depths are of the whole episode.
Intervals are for the mean over the episodes of one policy and do not cover other trainings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from tyro.conf import Positional

from agents import runs
from agents.command import parse, run
from agents.gait_figures import SETTLED
from agents.statistics import described
from hoof_env.errors import ParameterError, count
from hoof_env.evaluation.episodes import FINAL_SEEDS
from hoof_env.policies.actor import Actor
from hoof_env.policies.find import find_policy

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/HorseLeg-v0"
OUT = Path(__file__).parents[1] / "docs" / "evidence" / "leg_forces.json"

COLUMNS = (
    "time",
    "y",
    "vy",
    "momentum_y",
    "toe_normal",
    "heel_normal",
    "toe_penetration",
    "heel_penetration",
)
"""Columns of a record for the figures."""

UNITS = {
    "return": "-",
    "force_mean": "weights",
    "force_rms": "weights",
    "force_lowest": "weights",
    "force_highest": "weights",
    "pulling_time": "share of the time",
    "pulling_force": "weights",
    "correlation": "with the vertical force of the ground",
    "damper_heat_j": "J an episode",
    "drive_work_j": "J an episode",
    "toe_depth_m": "m",
    "heel_depth_m": "m",
    "depth_m": "m",
    "settled_depth_m": "m",
    "failed": "share of the episodes",
}
"""Figures of an episode: `pulling_time` is the share of the time in which the suspension pulls the trunk down
and `pulling_force` its mean while it does; depths are the greatest of the episode, the hoof's the greater
of toe and heel."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policies: Positional[tuple[str, ...]] = ("run", "constant", "open-loop", "shipped")
    """names of gaits, and names or paths of trained policies"""
    episodes: int = 100
    """episodes of each policy, the first of the published scores"""
    out: Path = OUT
    """file of the figures"""


def episode_of(env: gym.Env[Any, Any], policy: Any, seed: int) -> tuple[dict[str, Floats], dict[str, float]]:
    """Play an episode; return its record at every substep, columns of shape (n,), and its summary with its
    return."""
    leg: Any = env.unwrapped
    actor = Actor(policy, env)
    observation, info = env.reset(seed=seed, options=actor.start)
    leg.record()  # steps are recorded from here on
    parts = []
    total = 0.0
    ended = False
    while not ended:
        observation, reward, failed, truncated, info = env.step(actor.act(observation))
        total += float(reward)
        ended = failed or truncated
        record = leg.record()
        parts.append({name: np.ravel(record[name]) for name in COLUMNS})
    joined = {name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}
    return joined, {**info["episode_summary"], "return": total}


def suspension(env: gym.Env[Any, Any], y: Floats, vy: Floats) -> tuple[Floats, Floats]:
    """Return the force of the suspension on the trunk [N], positive upward, and the damper's part of it.

    Raises:
        ParameterError: the trunk of the environment has no suspension, or one that episodes change.
    """
    leg: Any = env.unwrapped
    settings = leg.settings
    if settings.trunk != "suspended" or settings.randomize:
        raise ParameterError(
            f'trunk: expected "suspended" with fixed parameters, got {settings.trunk!r} with'
            f" randomize={settings.randomize!r}"
        )
    spring = -settings.trunk_stiffness * (y - leg.body.height)
    damper = -settings.trunk_damping * vy
    return (1 - settings.trunk_share) * leg.weight + spring + damper, damper


def figures_of(env: gym.Env[Any, Any], policy: Any, seed: int) -> dict[str, float]:
    """Play an episode and return its figures, see `UNITS`; an episode that ends before `SETTLED` has only its
    return."""
    leg: Any = env.unwrapped
    record, summary = episode_of(env, policy, seed)
    forces, damper = suspension(env, record["y"], record["vy"])
    figures = {name: float(summary[name]) for name in ("return", "failed")}
    settled = record["time"] > SETTLED
    if not settled.any():
        return figures
    force = forces[settled] / leg.weight
    ground = (record["toe_normal"] + record["heel_normal"])[settled]
    pulling = force[force < 0]
    toe, heel = (record[f"{point}_penetration"] for point in ("toe", "heel"))
    hoof = np.maximum(toe, heel)
    return figures | {
        "force_mean": float(force.mean()),
        "force_rms": float(np.sqrt(np.mean(force**2))),
        "force_lowest": float(force.min()),
        "force_highest": float(force.max()),
        "pulling_time": float(np.mean(force < 0)),
        "pulling_force": float(pulling.mean()) if len(pulling) else 0.0,
        "correlation": float(np.corrcoef(force, ground)[0, 1]),
        "damper_heat_j": float(-np.sum(damper * record["vy"]) * leg.sim_dt),
        "drive_work_j": float(summary["positive_work_j"]),
        "toe_depth_m": float(toe.max()),
        "heel_depth_m": float(heel.max()),
        "depth_m": float(hoof.max()),
        "settled_depth_m": float(hoof[settled].max()),
    }


def over_episodes(episodes: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return mean, interval and extremes of every figure, over the episodes that have it."""
    found = {}
    for name in UNITS:
        values = [one[name] for one in episodes if name in one]
        if values:
            found[name] = described(values) | {"least": min(values), "most": max(values)}
    return found


def main(argv: list[str] | None = None) -> None:
    """Play and write."""
    args = parse(Args, argv, "python -m agents.leg_forces", __doc__)
    seeds = FINAL_SEEDS[: count("--episodes", args.episodes, most=len(FINAL_SEEDS))]
    policies = {}
    with runs.make_env(ENV_ID) as env:
        leg: Any = env.unwrapped
        for name in args.policies:
            policy = find_policy(name, env, ENV_ID)
            policies[name] = over_episodes([figures_of(env, policy, seed) for seed in seeds])
            shown = {key: round(value["mean"], 3) for key, value in policies[name].items()}
            print(name, shown, flush=True)
        about = {
            "command": runs.command(),
            "versions": runs.versions(),
            "env_id": ENV_ID,
            "seeds": [seeds.start, seeds.stop],
            "from_seconds": SETTLED,
            "settings": {
                "weight_n": float(leg.weight),
                "height_m": float(leg.body.height),
                **{
                    name: getattr(leg.settings, name)
                    for name in ("trunk_share", "trunk_stiffness", "trunk_damping")
                },
            },
            "units": UNITS,
        }
    runs.write_text(args.out, json.dumps(about | {"policies": policies}, indent=1) + "\n")
    print(f"written: {args.out}")


if __name__ == "__main__":
    run(main)

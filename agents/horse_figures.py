"""What a policy of the horse returns beyond the zero action, term by term and speed by speed, and which legs
brake and which propel.

    python -m agents.horse_figures                  the shipped agent
    python -m agents.horse_figures runs/horse/s0 --out figures.json

Every policy plays the episodes of the published scores, once with commands that change, and once at each
speed that is commanded for the whole episode. The zero action plays the reference gait of the speed; at the
highest command, the one next to its own speed, the gait `trot-like` plays as well. Horizontal forces are sums
over the two legs of a pair, over the mass of the animal, from `SETTLED` on: positive ones propel. Intervals
are for the mean over the episodes of one policy and do not cover other trainings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.command import parse, run
from agents.gait_figures import SETTLED
from agents.horse_gaits import speed_of
from agents.statistics import described
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import start_of
from hoof_env.errors import count
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows
from hoof_env.policies.actor import Actor
from hoof_env.policies.find import find_policy
from hoof_env.tasks.horse_gaits import LEGS, PAIRS

ENV_ID = "hoof_env/Horse-v0"
OUT = Path(__file__).parents[1] / "docs" / "evidence" / "horse" / "figures.json"

ZERO = "reference"  # name of the policy of zeros
TROT = "trot-like"  # a gait of one speed, 3.6 m/s
SPEEDS = (1.2, 1.85, 2.6, 3.3, 3.7)  # commanded for whole episodes [m/s]
FROUDE = (0.1, 0.25, 0.5, 1.0)  # of the horizontal forces

SUMMARY = (
    "speed_m_s",
    "loading_rate_n_s",
    "stance_peak_n",
    "highest_grf_n",
    "slip_m",
    "cost_of_transport",
    "failed",
)
"""Figures of an episode besides its return."""

NET = tuple(f"net_{pair}" for pair in PAIRS)
"""Net horizontal forces of the pairs [N/kg]."""

Episode = dict[str, float]


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policy: Positional[str] = "shipped"
    """name or path of the policy"""
    episodes: int = 100
    """episodes at each speed, the first of the published scores"""
    out: Path = OUT
    """file of the figures"""


def play(envs: Any, policy: Any, seeds: Sequence[int], options: Mapping[str, Any]) -> list[Episode]:
    """Play an episode in each row; return of each the return, its terms as `reward_NAME`, the figures of its
    summary, and the net horizontal forces `net_fore` and `net_hind` [N/kg].

    Args:
        envs: vector environment of a horse with a row for each seed.
        policy: what `load_policy` takes without an environment.
        seeds: seeds of the episodes.
        options: reset options of all.
    """
    n = envs.num_envs
    kilograms = envs.weight / GRAVITY
    observation, infos = envs.reset(seed=list(seeds), options=dict(options))
    names = [name for name in infos if name.startswith("reward_")]
    sums = {name: np.zeros(n) for name in ("return", *names, *NET)}
    episodes: list[Episode] = [{} for _ in seeds]
    going = np.ones(n, bool)
    actor = Actor(policy)
    actor.begin(n)
    step = 0
    while going.any():
        observation, rewards, failed, truncated, infos = envs.step(actor.act(observation))
        step += 1
        sums["return"] += np.where(going, rewards, 0.0)
        for name in names:
            sums[name] += np.where(going, infos[name], 0.0)
        if step * envs.dt > SETTLED:
            measured = infos["measured"]
            for k, pair in enumerate(PAIRS):
                for leg in LEGS[2 * k : 2 * k + 2]:
                    net = measured[f"{leg}_propulsion"] - measured[f"{leg}_braking"]
                    sums[f"net_{pair}"] += np.where(going, net, 0.0)
        ended = going & (failed | truncated)
        for row in np.flatnonzero(ended):
            summary = {key: float(values[row]) for key, values in infos["episode_summary"].items()}
            summary["stance_peak_n"] = summary["stance_peak_sum_n"] / max(summary["stances"], 1.0)
            counted = max(step * envs.dt - SETTLED, envs.dt)
            one = {name: float(total[row]) for name, total in sums.items()}
            one |= {name: one[name] / counted / kilograms[row] for name in NET}
            episodes[row] = one | {name: summary[name] for name in SUMMARY}
        going = going & ~ended
        actor.restart(failed | truncated)
    return episodes


def means(episodes: Sequence[Episode], names: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return mean and interval of figures over episodes."""
    return {name: described([one[name] for one in episodes]) for name in names}


def gain(ours: Sequence[Episode], theirs: Sequence[Episode]) -> dict[str, dict[str, float]]:
    """Return mean and interval of what each episode returns more than the same one of another policy, in all
    and by term."""
    names = [name for name in ours[0] if name == "return" or name.startswith("reward_")]
    pairs = list(zip(ours, theirs, strict=True))
    return {name: described([one[name] - other[name] for one, other in pairs]) for name in names}


def players(policy: Any, zero: Any, speed: float) -> dict[str, tuple[Any, dict[str, Any]]]:
    """Return policies and their reset options at a speed by name, the zero action first."""
    own = start_of(policy)
    found = {"zero action": (zero, {}), "agent": (policy, dict(own))}
    if speed == max(SPEEDS):
        found[TROT] = (zero, {"gait": TROT})
    return {name: (one, {**options, "target_speed": speed}) for name, (one, options) in found.items()}


def tell(what: str, figures: Mapping[str, Mapping[str, float]]) -> None:
    """Print means."""
    print(f"{what}:", ", ".join(f"{name} {value['mean']:.4g}" for name, value in figures.items()), flush=True)


def main(argv: list[str] | None = None) -> None:
    """Play and write."""
    args = parse(Args, argv, "python -m agents.horse_figures", __doc__)
    seeds = FINAL_SEEDS[: count("--episodes", args.episodes, most=len(FINAL_SEEDS))]
    envs = make_rows(ENV_ID, len(seeds))
    with runs.make_env(ENV_ID) as env:
        policy, zero = (find_policy(name, env, ENV_ID) for name in (args.policy, ZERO))
    figures = figures_of(envs, policy, zero, seeds)
    about = {
        "command": runs.command(),
        "versions": runs.versions(),
        "env_id": ENV_ID,
        "seeds": [seeds.start, seeds.stop],
        "from_seconds": SETTLED,
        "agent": args.policy,
    }
    runs.write_text(args.out, json.dumps(about | figures, indent=1) + "\n")
    print(f"written: {args.out}")


def figures_of(envs: Any, policy: Any, zero: Any, seeds: Sequence[int]) -> dict[str, Any]:
    """Return the gain by term, the figures by speed and the horizontal forces by Froude number."""
    ours, theirs = (play(envs, one, seeds, start_of(one)) for one in (policy, zero))
    found: dict[str, Any] = {"gain": gain(ours, theirs), "speeds": [], "forces": []}
    tell("gain", found["gain"])
    for speed in SPEEDS:
        played = {
            name: play(envs, one, seeds, options)
            for name, (one, options) in players(policy, zero, speed).items()
        }
        shown = {name: means(episodes, ("return", *SUMMARY, *NET)) for name, episodes in played.items()}
        more = gain(played["agent"], played["zero action"])
        found["speeds"].append({"speed_m_s": speed, "policies": shown, "gain": more})
        for name, of_policy in shown.items():
            tell(f"{speed:g} m/s, {name}", of_policy)
    for froude in FROUDE:
        speed = speed_of(froude)
        both = players(policy, zero, speed)
        nets = {
            name: means(play(envs, both[name][0], seeds, both[name][1]), NET)
            for name in ("zero action", "agent")
        }
        found["forces"].append({"froude": froude, "speed_m_s": speed, "policies": nets})
        for name, of_policy in nets.items():
            tell(f"Froude number {froude:g}, {name}", of_policy)
    return found


if __name__ == "__main__":
    run(main)

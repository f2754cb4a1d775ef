"""Train with four charges for landings, one at a time, over grounds that are drawn: an ablation.

    python -m agents.soft_landing weights               what each charge costs the run, for equal weights
    python -m agents.soft_landing train --seeds 10      all trainings; the same command goes on
    python -m agents.soft_landing table                 what the agents do, in the same episodes

The leg, the task and the other terms are those of HorseLeg-v0, and stiffness and restitution of the ground
are drawn for each episode. In place of its charges for peak and loading stands one of
`agents.soft_terms`:

* threshold: the running peak beyond a threshold, for as long as it lasts. legged_gym charges the present
  force beyond one (`_reward_feet_contact_forces`). To remember a maximum in the state is a published
  construction (arXiv 2405.13609, 2402.01361).
* first contact: the force at the end of the control step in which a stance begins, as mjlab's `soft_landing`.
* approach: the square of the speed at which a hoof point meets the ground, when a stance begins, as for Olaf
  (arXiv 2512.16705).
* own: peak and loading rate of every substep, the terms of HorseLeg-v0.
* loading_2, loading_3, loading_4: these with so many times the weight of the loading rate, for what softer
  landings cost.

Each weight of the first three makes the run pay `PRICE` a second on the usual ground, so that none asks for
more than another.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.command import run
from agents.soft_terms import CHARGES, PRICE, TERMS, WEIGHTS, id_of
from agents.train import Args as TrainingArgs
from agents.train import train
from hoof_env._output import check_folder, markdown_table
from hoof_env.envs.policies import start_of
from hoof_env.errors import check_choice, count
from hoof_env.evaluation.episodes import make_rows
from hoof_env.policies.find import find_policy

FIRST_SEED = 5_000_000  # on which nothing else is played


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    what: Positional[Literal["weights", "train", "table"]]
    """weights of the charges, trainings, or the table"""
    seeds: int = 10
    """trainings of each charge"""
    steps: int | None = None
    """of a training; otherwise those of HorseLeg-v0"""
    charges: tuple[str, ...] = CHARGES
    """charges to train with, or of the table"""
    episodes: int = 100
    """of each agent in the table"""
    out: Path = Path("runs/soft_landing")
    """folder of the trainings and of table.md"""


def folder_of(args: Args, charge: str, seed: int) -> Path:
    """Return the folder of a training."""
    return args.out / f"{charge}-s{seed}"


def train_all(args: Args) -> None:
    """Train all agents; what is done is not repeated."""
    for seed in range(args.seeds):
        for charge in args.charges:
            env_id = f"agents.soft_terms:{id_of(charge)}"
            print(train(_training(args, env_id, charge, seed)), flush=True)


def _training(args: Args, env_id: str, charge: str, seed: int) -> TrainingArgs:
    """Return the arguments of one training, with the settings of HorseLeg-v0."""
    from agents.settings import FOLDER, load_settings

    settings = load_settings(FOLDER / "ppo_flat.yml", "hoof_env/HorseLeg-v0")
    return TrainingArgs(
        env_id=env_id,
        algo="ppo_flat",
        steps=args.steps,
        params=(json.dumps(settings),),
        seed=seed,
        out=folder_of(args, charge, seed),
        resume=True,
    )


def play(policy: str, env_id: str, episodes: int, **settings: Any) -> dict[str, float]:
    """Play episodes of a policy; return the means of their figures, and "seen", the highest force at the ends
    of control steps over that of all substeps."""
    envs: Any = make_rows(env_id, episodes, **settings)
    with runs.make_env(env_id, **settings) as env:
        player = find_policy(policy, env, env_id)
    seeds = list(range(FIRST_SEED, FIRST_SEED + episodes))
    observation, _ = envs.reset(seed=seeds, options=start_of(player))
    going = np.ones(episodes, bool)
    start = np.ones(episodes, bool)
    seen = np.zeros(episodes)
    found: dict[str, Any] = {}
    terms: dict[str, Any] = {}
    while going.any():
        actions, _ = player.predict(observation, episode_start=start, deterministic=True)
        observation, _, terminated, truncated, infos = envs.step(actions)
        report = envs.batch.engine.report
        normal = (report["toe_normal"] + report["heel_normal"])[0]
        friction = (report["toe_friction"] + report["heel_friction"])[0]
        seen = np.where(going, np.maximum(seen, np.hypot(normal, friction)), seen)
        for name in CHARGES:
            if f"reward_{name}" in infos:
                terms[name] = terms.get(name, 0.0) + np.where(going, infos[f"reward_{name}"], 0.0)
        ended = going & (terminated | truncated)
        for key, values in infos.get("episode_summary", {}).items():
            if not key.startswith("_"):
                found.setdefault(key, np.zeros(episodes))[ended] = np.asarray(values)[ended]
        going &= ~ended
        start = terminated | truncated
    highest = found["highest_grf_n"]
    figures = {key: float(np.mean(values)) for key, values in found.items()}
    figures["stance_peak_n"] = float(np.mean(found["stance_peak_sum_n"] / np.maximum(found["stances"], 1)))
    # An agent that never touches the ground hides nothing
    figures["seen"] = float(np.mean(np.divide(seen, highest, out=np.ones(episodes), where=highest > 0.0)))
    charges = {f"charge_{name}": float(np.mean(values)) for name, values in terms.items()}
    return figures | charges


def weights_table(args: Args) -> str:
    """Return the weights with which each charge costs the run `PRICE` a second, on the usual ground."""
    rows = []
    for charge in TERMS:
        found = play("run", id_of(charge), args.episodes, randomize=None)
        paid = -found[f"charge_{charge}"] / found["seconds"]
        rows.append([charge, f"{WEIGHTS[charge]:g}", f"{paid:.3g}", f"{WEIGHTS[charge] * PRICE / paid:.3g}"])
    return markdown_table(["charge", "weight", "the run pays [1/s]", "weight for the price"], rows)


FIGURES = {
    "stance_peak_n": ("stance peak [kN]", 1e-3),
    "loading_rate_n_s": ("loading rate [kN/s]", 1e-3),
    "weight_share": ("weight share [-]", 1.0),
    "cost_of_transport": ("cost of transport [-]", 1.0),
    "speed_m_s": ("speed [m/s]", 1.0),
    "failed": ("failed [-]", 1.0),
    "seen": ("seen at control steps [-]", 1.0),
}
"""Columns of the table: figures of `play`, their titles and factors."""


def table(args: Args) -> str:
    """Return the table of what agents of each charge do: median and range over seeds; first the run."""
    rows = [["run", "", *_cells([play("run", id_of("own"), args.episodes)])]]
    for charge in args.charges:
        folders = [folder_of(args, charge, seed) for seed in range(args.seeds)]
        done = [str(folder) for folder in folders if (folder / runs.MODEL).is_file()]
        found = [play(folder, id_of(charge), args.episodes) for folder in done]
        rows.append([charge, str(len(done)), *(_cells(found) if found else [""] * len(FIGURES))])
    return markdown_table(["charge", "seeds", *(title for title, _ in FIGURES.values())], rows)


def _cells(found: list[dict[str, float]]) -> list[str]:
    """Return the cells of a row: the median over agents, and the range of several."""
    cells = []
    for key, (_, factor) in FIGURES.items():
        values = factor * np.array([figures[key] for figures in found])
        spread = f" ({values.min():.3g} to {values.max():.3g})" if len(values) > 1 else ""
        cells.append(f"{np.median(values):.3g}{spread}")
    return cells


def main(argv: list[str] | None = None) -> None:
    """Train, or print a table."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.soft_landing", description=__doc__)
    count("--seeds", args.seeds)
    count("--episodes", args.episodes)
    for charge in args.charges:
        check_choice("--charges", charge, CHARGES)
    check_folder(args.out)
    if args.what == "train":
        return train_all(args)
    text = weights_table(args) if args.what == "weights" else table(args)
    args.out.mkdir(parents=True, exist_ok=True)
    runs.write_text(args.out / f"{args.what}.md", text + "\n")
    print(text)


if __name__ == "__main__":
    run(main)

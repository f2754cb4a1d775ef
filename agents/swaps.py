"""Agents trained on one ground or limb and played on another.

    python -m agents.swaps                  trains what is missing, then writes the page
    python -m agents.swaps --no-train       the page of what is there

The paper asks what elastic ground does to the force on a hoof, of a gait that is given. Here one is learnt
on each of two values of a setting, by a leg that carries and balances itself, and played on both. What the
setting does to a gait and what a learner makes of it come apart. Trainings go on where they stopped.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents import runs
from agents.command import parse, run
from agents.experiments.hop_page import figures_of, rounded
from agents.experiments.outcomes import read_figures
from agents.kept import EVIDENCE
from agents.softness import commits_of, learn, trained_folders
from agents.statistics import spread
from hoof_env._output import markdown_table
from hoof_env.errors import DataFileError, count
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, score_vector

DATA = "swaps.json"
PAGE_FILE = "swaps.md"

ID = "hoof_env/HorseLegBalance-v0"

STEPS = 600_000
"""Environment steps of a training, as many as those of `agents.experiments --plan seeing`."""

USUAL = "usual"
SETTINGS: Mapping[str, Mapping[str, float]] = {
    USUAL: {},
    "inelastic": {"restitution": 0.0},
    "elastic": {"restitution": 1.0},
    "soft-ground": {"stiffness": 2e5},
    # Twice as stiff, with the same damping ratio
    "stiff-limb": {"hoof_stiffness": 8400.0, "hoof_damping": 147.0},
}
"""Changed arguments of the environment by name."""

NAMES = {
    USUAL: "the usual ground and springs",
    "inelastic": "restitution 0",
    "elastic": "restitution 1",
    "soft-ground": "ground 0.2 MN/m^1.5",
    "stiff-limb": "springs of 8.4 kN/m",
}

FALLS = 0.1
"""Share of episodes below which an agent that falls stays up."""

PAIRS = (("inelastic", "elastic"), (USUAL, "soft-ground"), (USUAL, "stiff-limb"))
"""Settings between which agents are swapped."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    seeds: int = 3
    """trainings on each setting, of the seeds from 0 on"""
    folder: Path = Path("runs/swaps")
    """folder of the trainings"""
    train: bool = True
    """train; otherwise write the page of what is there"""
    out: Path = EVIDENCE
    """folder of page and figures"""


def partners(name: str) -> tuple[str, ...]:
    """Return the settings on which agents of one are played, itself among them."""
    return tuple(dict.fromkeys(other for pair in PAIRS if name in pair for other in pair))


def measure(args: Args) -> dict[str, Any]:
    """Play all agents on both settings of each pair, write their figures and return them; figures of agents
    whose folders are not here stay."""
    known = read_figures(args.out / DATA).get("played", {})
    envs: Any = make_rows(ID, 1)
    played: dict[str, Any] = {}
    for name in SETTINGS:
        folders = trained_folders(args.folder / name, "s*")
        played[name] = {
            other: [
                {
                    "seed": int(path.name.rpartition("s")[2]),
                    "steps": int(runs.read_record(path)["finished"]["steps"]),
                    "commit": runs.read_record(path)["versions"].get("commit", ""),
                    **rounded(figures_of(score_vector(str(path), ID, FINAL_SEEDS, **SETTINGS[other]))),
                }
                for path in folders
            ]
            for other in partners(name)
        }
        if not folders:
            played[name] = known.get(name)
        if not played[name]:
            raise DataFileError(
                f"{args.folder}: expected agents trained on {name}, found none; without --no-train the folder"
                " is filled"
            )
    data = {"weight_n": float(envs.weight.ravel()[0]), "played": played}
    args.out.mkdir(parents=True, exist_ok=True)
    runs.write_text(args.out / DATA, json.dumps(data, indent=1) + "\n")
    return data


def table(data: Mapping[str, Any], pair: tuple[str, str]) -> str:
    """Return the table of two settings: agents of each, played on both."""
    lines = []
    for mine in pair:
        for other in pair:
            seeds = data["played"][mine][other]

            def column(name: str, factor: float = 1.0, seeds: Any = seeds) -> list[float]:
                return [factor * float(seed[name]) for seed in seeds]

            lines.append(
                [
                    NAMES[mine],
                    NAMES[other],
                    str(len(seeds)),
                    spread(column("return"), 0),
                    spread(column("failed", 100.0), 0),
                    spread(column("speed_m_s"), 2),
                    spread(column("stance_peak_n", 1 / data["weight_n"]), 2),
                    spread(column("loading_rate_n_s", 1e-3), 0),
                    spread(column("cost_of_transport"), 2),
                ]
            )
    titles = ("trained on", "played on", "seeds", "return", "falls %", "speed m/s")
    return markdown_table((*titles, "stance peak, weights", "loading kN/s", "cost of transport"), lines)


def reading(data: Mapping[str, Any], pair: tuple[str, str]) -> str:
    """Write what the second setting does to the forces of agents that do not know it, and what of it is left
    once agents have learnt on it: of agents that stay up, if there are two or more."""

    def played(mine: str, other: str) -> list[Mapping[str, Any]]:
        return list(data["played"][mine][other])

    def upright(mine: str, other: str) -> list[Mapping[str, Any]]:
        return [seed for seed in played(mine, other) if seed["failed"] < FALLS]

    def mean(seeds: Sequence[Mapping[str, Any]], name: str) -> float:
        return sum(float(seed[name]) for seed in seeds) / len(seeds)

    first, second = pair
    before = upright(first, first)
    texts = []
    for mine, title in ((first, "as they were"), (second, "trained there")):
        there = upright(mine, second)
        text = f"of {len(played(mine, second))} agents {title} {len(there)} stay up"
        if len(there) > 1 and len(before) > 1:
            factors = (
                f"{mean(there, name) / mean(before, name):.2f} times the {of}"
                for name, of in (("stance_peak_n", "stance peaks"), ("loading_rate_n_s", "loading"))
            )
            speeds = " and ".join(f"{mean(some, 'speed_m_s'):.2f}" for some in (before, there))
            text += f", with {' and '.join(factors)} of agents at home, which go at {speeds} m/s"
        texts.append(text)
    stayed, learnt_there = (mean(played(mine, second), "return") for mine in (first, second))
    return (
        f"From {NAMES[first]} to {NAMES[second]}: {'; '.join(texts)}. On {NAMES[second]} agents that were"
        f" trained there return {learnt_there:.0f}, the others {stayed:.0f}."
    )


PAGE = """# Agents swapped between grounds and limbs

The paper asks what elastic ground does to the force on a hoof, of a gait that is given. Agents of
[`HorseLegBalance-v0`](../environments/HorseLegBalance.md), a leg that carries and balances itself, were
trained on two values of a setting and played on both. Written by `python -m agents.swaps` from
[swaps.json](swaps.json): `ppo_flat`, {steps:,} steps, trained by the code of {commits}. Means over trainings
in the same {starts} episodes, in brackets the lowest and the highest. An agent stays up that falls in under
{falls:.0%} of its episodes. Speeds are free, and a faster gait lands harder: forces at other speeds tell
little.

{sections}
"""

TITLES = {
    ("inelastic", "elastic"): "Restitution of the ground",
    (USUAL, "soft-ground"): "Stiffness of the ground",
    (USUAL, "stiff-limb"): "Springs of the limb",
}


def write(out: Path, data: Mapping[str, Any]) -> Path:
    """Write the page; return its path."""
    seeds = [seed for played in data["played"].values() for each in played.values() for seed in each]
    sections = [f"## {TITLES[pair]}\n\n{table(data, pair)}\n\n{reading(data, pair)}" for pair in PAIRS]
    text = PAGE.format(
        steps=max(seed["steps"] for seed in seeds),
        commits=commits_of(seeds),
        starts=len(FINAL_SEEDS),
        falls=FALLS,
        sections="\n\n".join(sections),
    )
    runs.write_text(out / PAGE_FILE, text)
    return out / PAGE_FILE


def main(argv: list[str] | None = None) -> None:
    """Train, play and write."""
    args = parse(Args, argv, "python -m agents.swaps", __doc__)
    if args.train:
        for seed in range(count("seeds", args.seeds)):
            for name, setting in SETTINGS.items():
                learn(args.folder / name / f"s{seed}", seed, setting, env_id=ID, steps=STEPS)
    print(f"written: {write(args.out, measure(args))}")


if __name__ == "__main__":
    run(main)

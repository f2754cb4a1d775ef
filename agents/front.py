"""An approximate Pareto front of hoof_env/HorseLegMO-v0, its hypervolume, and a picture of it.

    python -m agents.front                      trains what is missing, then writes
    python -m agents.front --seeds 1 --out DIR  the front of one seed, elsewhere

For each of `PREFERENCES` and each seed `ppo_flat` learns the weighted sum of the objectives, with the
settings of HorseLeg-v0 but fewer steps. The shipped agent, of the same learner, equal weights and more steps,
is added. Policies play the episodes of the published scores; the file has the returns of the policies that
are not dominated. Linear weights find no concave part of a front. Trainings resume where they stopped.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse, run
from agents.train import Args as TrainingArgs
from agents.train import train
from hoof_env._output import markdown_table, staged
from hoof_env._plotting import AMBER, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, STYLE, save_png
from hoof_env.envs.multi_objective import HorseLegMOVectorEnv
from hoof_env.errors import ParameterError, count
from hoof_env.evaluation.episodes import FINAL_SEEDS
from hoof_env.evaluation.fronts import hypervolume, non_dominated
from hoof_env.evaluation.statistics import Interval, iqm
from hoof_env.policies.actor import Actor
from hoof_env.policies.find import find_policy, load_policy
from hoof_env.tasks.objectives import REFERENCE_POINT, scalar_weights
from hoof_env.tasks.reward import OBJECTIVES

ROOT = Path(__file__).parents[1]
DATA = ROOT / "hoof_env" / "data"
EVIDENCE = ROOT / "docs" / "evidence"
FILE = "HorseLegMO-v0.json"
SHIPPED = DATA / "policies" / "HorseLeg-v0"

PREFERENCES = (
    (1, 0, 0),
    (10, 1, 1),
    (10, 3, 3),
    (10, 10, 3),
    (10, 3, 10),
    (1, 1, 1),
    (1, 1, 3),
    (1, 1, 10),
)
"""Proportions of the weights of `OBJECTIVES`. With more weight on forces or work than this, agents stand."""

STEPS = 150_000
"""Environment steps of a training."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    seeds: int = 4
    """trainings for each preference, of the seeds from 0 on"""
    folder: Path = Path("runs/front")
    """folder of the trainings"""
    out: Path | None = None
    """folder of data, page and picture; otherwise hoof_env/data/fronts and docs/evidence"""


@dataclass(frozen=True)
class Trained:
    """A trained policy.

    Attributes:
        preference: weights of the objectives, which sum to 1.
        seed: seed of the training.
        steps: environment steps of the training.
        returns: mean return of each objective.
        commit: commit that trained it.
    """

    preference: tuple[float, ...]
    seed: int
    steps: int
    returns: tuple[float, ...]
    commit: str = "unknown"


def shares(preference: Sequence[float]) -> tuple[float, ...]:
    """Return weights in these proportions that sum to 1."""
    return tuple(part / sum(preference) for part in preference)


def learn(preference: Sequence[float], seed: int, folder: Path) -> Path:
    """Train on a preference, or go on with the training, and return its folder. A training that is through
    stays as it is, also one of another commit.

    Raises:
        ParameterError: it was stopped before its end.
    """
    weights = scalar_weights(shares(preference))
    out = folder / "-".join(f"{part:g}" for part in preference) / f"s{seed}"
    record = runs.read_record(out)
    asked = {"algo": "ppo_flat", "seed": seed, "env_kwargs": {"reward_weights": weights}}
    if record.get("finished") and all(record.get(key) == value for key, value in asked.items()):
        return out
    trained = train(
        TrainingArgs(
            algo="ppo_flat",
            steps=STEPS,
            seed=seed,
            env_kwargs=(json.dumps({"reward_weights": weights}),),
            out=out,
            resume=True,
        )
    )
    if trained.stopped_by:
        raise ParameterError(f"{out}: stopped by signal {trained.stopped_by}; the same command goes on")
    return out


def returns_of(policy: Any, seeds: Sequence[int] = FINAL_SEEDS) -> NDArray[np.float64]:
    """Return the return of each objective in an episode for each seed, shape (len(seeds), 3); `policy` is
    an argument of `load_policy`."""
    envs = HorseLegMOVectorEnv(len(seeds))
    actor = Actor(policy)
    actor.begin(len(seeds))
    observations, _ = envs.reset(seed=[*seeds], options=actor.start)
    totals = np.zeros((len(seeds), len(OBJECTIVES)))
    going = np.ones(len(seeds), bool)
    while going.any():
        observations, rewards, terminated, truncated, _ = envs.step(actor.act(observations))
        totals[going] += rewards[going]
        going &= ~(terminated | truncated)
        actor.restart(terminated | truncated)
    return totals


def summarise(found: Sequence[Trained], more: Sequence[Trained] = ()) -> dict[str, Any]:
    """Return the content of the file.

    Args:
        found: trainings of all preferences with each seed; each seed has a front and its volume.
        more: further trainings, which count in the common front alone.
    """
    everything = [*found, *more]
    front = [everything[k] for k in np.flatnonzero(non_dominated([each.returns for each in everything]))]
    front.sort(key=lambda each: each.returns, reverse=True)
    seeds = sorted({each.seed for each in found})
    volumes = [hypervolume([each.returns for each in found if each.seed == seed]) for seed in seeds]
    middle, low, high = map(float, iqm(volumes))
    return {
        "env_id": "hoof_env/HorseLegMO-v0",
        "objectives": [*OBJECTIVES],
        "reference_point": [*REFERENCE_POINT],
        "algorithm": "ppo_flat",
        "seeds": seeds,
        "trainings": len(everything),
        "episodes": [FINAL_SEEDS.start, FINAL_SEEDS.stop],
        "front": [
            {
                "weight": [round(part, 6) for part in each.preference],
                "seed": each.seed,
                "steps": each.steps,
                "returns": [*each.returns],
                "commit": each.commit,
            }
            for each in front
        ],
        "hypervolume": {
            "all": hypervolume([each.returns for each in front]),
            "seeds": volumes,
            "iqm": middle,
            "interval95": None if len(volumes) < 2 else [low, high],
        },
        "command": runs.command(),
        "versions": runs.versions(),
    }


def draw(found: Sequence[Trained], path: Path) -> None:
    """Draw all trainings, the front filled, progress against the other two objectives."""
    import matplotlib
    from matplotlib.figure import Figure

    points = np.array([each.returns for each in found])
    in_front = non_dominated(points)
    colours = (BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER, "black", GREY)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 3.8), layout="constrained")
        for axes, other in zip(figure.subplots(1, 2), (1, 2), strict=True):
            for preference, colour in zip(PREFERENCES, colours, strict=True):
                for is_filled in (True, False):
                    chosen = [
                        each.preference == shares(preference) and bool(inside) == is_filled
                        for each, inside in zip(found, in_front, strict=True)
                    ]
                    filling = colour if is_filled else "none"
                    label = " : ".join(f"{part:g}" for part in preference) if is_filled else None
                    x, y = points[np.array(chosen)][:, [0, other]].T
                    axes.plot(x, y, "o", color=colour, mfc=filling, ms=5, label=label)
            axes.set(xlabel=f"return of {OBJECTIVES[0]}", ylabel=f"return of {OBJECTIVES[other]}")
            axes.set_yscale("symlog", linthresh=1.0)
            axes.yaxis.set_major_formatter("{x:g}")
            axes.grid(color=GREY, alpha=0.15)
        title = f"{' : '.join(OBJECTIVES)}; hollow: dominated"
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4, title=title)
        save_png(figure, path, dpi=150)


PAGE = """# A front of HorseLegMO-v0

Written by `python -m agents.front`, with [its data](../../hoof_env/data/fronts/HorseLegMO-v0.json), which
`hoof_env.evaluation.fronts.read_front` returns. `ppo_flat` learnt {preferences} preferences with {seeds}
seeds each, {steps:,} steps each; the shipped agent of equal weights, {shipped:,} steps, is added.
Returns are undiscounted means over the {episodes} episodes of the published scores. Of {trainings} policies
{front} are dominated by no other.

The hypervolume of their returns over the reference point {reference} is **{volume:,.0f}**.
The policies of one seed reach {interval} thousand: interquartile mean over seeds, without the
shipped agent, and its 95 % interval ({each}).

This is what one learner with linear weights reached in few steps, and not the true front: a higher volume
is possible, and such weights find no concave part of it. With weights 1 : 5 : 1 or 1 : 1 : 25 an agent of
one seed learnt to stand.

![Returns of all trainings by the proportions of their weights](front.png)

{table}
"""


def write(found: Sequence[Trained], more: Sequence[Trained], data: Path, evidence: Path) -> dict[str, Any]:
    """Write file, page and picture, and return the content of the file; `found` and `more` are as in
    `summarise`."""
    about = summarise(found, more)
    rows = [
        [
            " : ".join(f"{part:.3f}" for part in point["weight"]),
            str(point["seed"]),
            f"{point['steps']:,}",
            *(f"{value:.1f}" for value in point["returns"]),
        ]
        for point in about["front"]
    ]
    volume = about["hypervolume"]
    page = PAGE.format(
        trainings=about["trainings"],
        preferences=len({each.preference for each in found}),
        seeds=len(about["seeds"]),
        steps=STEPS,
        shipped=max((each.steps for each in more), default=0),
        episodes=len(FINAL_SEEDS),
        front=len(about["front"]),
        reference=tuple(REFERENCE_POINT),
        volume=volume["all"],
        interval=Interval(volume["iqm"], *(volume["interval95"] or ())).text(0, 1e-3),
        each=", ".join(f"{value / 1000:.0f}" for value in volume["seeds"]),
        table=markdown_table(["weights", "seed", "steps", *OBJECTIVES], rows),
    )
    with staged(data) as stage:
        (stage / FILE).write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    with staged(evidence) as stage:
        draw([*found, *more], stage / "front.png")
        (stage / "front.md").write_text(page, encoding="utf-8")
    return about


def shipped() -> Trained:
    """Score the shipped agent."""
    record = json.loads((SHIPPED / "run.json").read_text(encoding="utf-8"))
    with runs.make_env(runs.DEFAULT_ENV) as env:
        policy = find_policy("shipped", env, runs.DEFAULT_ENV)
    return trained(shares((1, 1, 1)), record, mean_returns(policy))


def trained(preference: tuple[float, ...], record: dict[str, Any], returns: tuple[float, ...]) -> Trained:
    """Return a policy with the steps, seed and commit of the record of its training."""
    steps = int(record["finished"]["steps"])
    commit = record.get("versions", {}).get("commit", "unknown")
    return Trained(preference, record["seed"], steps, returns, commit)


def mean_returns(policy: Any) -> tuple[float, ...]:
    """Return the mean return of each objective, to 1e-4, over the episodes of the published scores."""
    return tuple(round(float(value), 4) for value in returns_of(policy).mean(axis=0))


def main(argv: list[str] | None = None) -> None:
    """Train, score and write."""
    args = parse(Args, argv, "python -m agents.front", __doc__)
    found = []
    for seed in range(count("seeds", args.seeds)):
        for preference in PREFERENCES:
            weights = scalar_weights(shares(preference))
            folder = learn(preference, seed, args.folder)
            with runs.make_env(runs.DEFAULT_ENV, reward_weights=weights) as env:
                returns = mean_returns(load_policy(folder, env))
            found.append(trained(shares(preference), runs.read_record(folder), returns))
            told = ", ".join(f"{name} {value:.1f}" for name, value in zip(OBJECTIVES, returns, strict=True))
            print(f"{folder}: {told}", flush=True)
    about = write(found, [shipped()], args.out or DATA / "fronts", args.out or EVIDENCE)
    print(f"{len(about['front'])} points, hypervolume {about['hypervolume']['all']:,.0f}")


if __name__ == "__main__":
    run(main)

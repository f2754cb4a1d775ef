"""Page of a leg that carries itself: learners beside policies that need no learning, their forces beside a
horse's, and which gaits the reward prefers."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agents import order, runs
from agents.experiments.outcomes import is_done, read_figures, read_outcome
from agents.experiments.plans import Entry, Run
from agents.statistics import spread
from hoof_env._output import markdown_table
from hoof_env.constants import GRAVITY
from hoof_env.envs.open_loop import gait_file, open_loop_record
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, score_vector
from hoof_env.policies.actor import Actor
from hoof_env.policies.find import find_policy
from hoof_env.tasks.registry import task_of

PUBLISHED = Path(__file__).parents[2] / "docs" / "evidence"
"""Folder of the page and its figures."""

DATA = "hop.json"
PAGE_FILE = "hop.md"

ID = "hoof_env/HorseLegHop-v0"

NAMES = {
    "ppo": "stock PPO",
    "sac": "stock SAC",
    "ppo_flat": "`ppo_flat`",
    "ppo_flat crank": "`ppo_flat`, crank and gait alone",
}
"""Names of learners by algorithm and variant."""

GAITS = {
    "zero": "zero action",
    "constant": "best constant gait",
    "open-loop": "best gait with a clock",
    "shipped": "shipped agent",
}
"""Policies that are played as they are stored."""

FIGURES = (
    "return",
    "failed",
    "speed_m_s",
    "duty_factor",
    "stance_peak_n",
    "loading_rate_n_s",
    "slip_m",
    "stances",
    "cost_of_transport",
)
"""Figures of a policy, means over the episodes of the final scores."""

SEEDS = (0, 1, 2)
"""Seeds of the draws of gaits whose order is measured."""

GAITS_OF_A_DRAW = 1024

CONDITIONS = {"that hardly slide": order.SLIDING, "of any slip": math.inf}
"""Largest slip over distance of the gaits in a draw, by name of the condition."""


def figures_of(episodes: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the means of `FIGURES` over episodes, of those that are finite."""
    columns = {name: np.array([float(episode[name]) for episode in episodes]) for name in FIGURES}
    return {name: float(column[np.isfinite(column)].mean()) for name, column in columns.items()}


def greatest_deflections(name: str) -> dict[str, float]:
    """Return how far the hoof's springs give at most in an episode of a stored policy, at the ends of control
    steps [m]: the median over episodes, and the largest."""
    envs: Any = make_rows(ID, len(FINAL_SEEDS))
    with runs.make_env(ID) as env:
        actor = Actor(find_policy(name, env, ID))
    actor.begin(envs.num_envs)
    observation, _ = envs.reset(seed=list(FINAL_SEEDS), options=actor.start)
    going = np.ones(envs.num_envs, bool)
    deepest = np.zeros(envs.num_envs)
    while going.any():
        observation, _, terminated, truncated, infos = envs.step(actor.act(observation))
        going &= ~(terminated | truncated)
        for part in ("toe", "heel"):
            deflection = infos["measured"][f"{part}_deflection_normal"]
            deepest = np.where(going, np.maximum(deepest, deflection), deepest)
        actor.restart(terminated | truncated)
    return {"median": float(np.median(deepest)), "largest": float(deepest.max())}


def key_of(entry: Entry) -> str:
    """Return the key of an entry in `NAMES`."""
    return " ".join(filter(None, (entry.algo, entry.variant)))


def publish(plan: Sequence[Entry], folder: Path, out: Path) -> dict[str, Any]:
    """Add the trainings of `folder` that are done to the data in `out`, measure gaits and order anew, and
    return all."""
    data = read_figures(out / DATA)
    learners: dict[str, Any] = data.get("learners", {})
    for one in (Run(entry, seed) for entry in plan for seed in range(entry.seeds)):
        if not is_done(one, folder):
            continue
        outcome = read_outcome(one, folder)
        learners.setdefault(key_of(one.entry), {})[str(one.seed)] = {
            "steps": int(outcome.final["steps"]),
            "cpu_s": round(outcome.final["cpu_s"], 1),
            "commit": runs.read_record(outcome.folder)["versions"].get("commit", ""),
            **{name: round(value, 6) for name, value in figures_of(outcome.final["episodes"]).items()},
        }
    envs: Any = make_rows(ID, 1)
    weight = float(np.ravel(envs.weight)[0])
    data = {
        "weight_n": weight,
        "learners": learners,
        "planned": {key_of(entry): entry.seeds for entry in plan},
        "gaits": {name: rounded(figures_of(score_vector(name, ID, FINAL_SEEDS))) for name in GAITS},
        "deflections": {name: rounded(greatest_deflections(name)) for name in GAITS},
        "order": {name: orders(sliding) for name, sliding in CONDITIONS.items()},
        "search": searched(),
        "commit": runs.versions().get("commit", ""),
    }
    out.mkdir(parents=True, exist_ok=True)
    runs.write_text(out / DATA, json.dumps(data, indent=1) + "\n")
    return data


def orders(sliding: float) -> dict[str, dict[str, float]]:
    """Return the correlations of each draw of gaits that slide for less than a share of their way."""
    draws = {seed: order.travelling_gaits(ID, GAITS_OF_A_DRAW, seed, sliding) for seed in SEEDS}
    return {str(seed): rounded(order.correlations(gaits)) for seed, gaits in draws.items()}


def rounded(figures: Mapping[str, float]) -> dict[str, float]:
    """Return figures with six digits after the point."""
    return {name: round(value, 6) for name, value in figures.items()}


def searched() -> list[dict[str, Any]]:
    """Return what the searches for the gait with a clock spent and found."""
    record = open_loop_record(gait_file(ID, "phase"))
    names = ("origin", "episodes", "stalled")
    return [
        {name: one[name] for name in names} | {"return": round(one["mean"]["return"], 2)}
        for one in record["restarts"]
    ]


def line_of(title: str, seeds: Sequence[Mapping[str, float]], data: Mapping[str, Any]) -> list[str]:
    """Return the line of a policy: figures of its seeds."""
    weight = data["weight_n"]
    zero = data["gaits"]["zero"]["return"]
    best = blind_return(data)

    def column(name: str, factor: float = 1.0) -> list[float]:
        return [factor * float(seed[name]) for seed in seeds]

    gained = [(value - zero) / (best - zero) for value in column("return")]
    steps = f"{int(seeds[0]['steps']):,}" if "steps" in seeds[0] else ""
    return [
        title,
        str(len(seeds)) if steps else "",
        steps,
        spread(column("return"), 0),
        spread(gained, 2),
        spread(column("failed", 100.0), 0),
        spread(column("speed_m_s"), 2),
        spread(column("duty_factor"), 2),
        spread(column("stance_peak_n", 1 / weight), 1),
        spread(column("stance_peak_n", GRAVITY / weight), 0),
        spread(column("loading_rate_n_s", 1e-3), 0),
        spread(column("slip_m", 100.0), 1),
    ]


def blind_return(data: Mapping[str, Any]) -> float:
    """Return the mean return of the best policy without feedback."""
    return max(float(data["gaits"][name]["return"]) for name in ("constant", "open-loop"))


def table(data: Mapping[str, Any]) -> str:
    """Return the table of policies."""
    lines = [line_of(title, [data["gaits"][name]], data) for name, title in GAITS.items()]
    for key, title in NAMES.items():
        if seeds := data["learners"].get(key):
            lines.append(line_of(title, [seeds[seed] for seed in sorted(seeds, key=int)], data))
    titles = (
        "policy",
        "seeds",
        "steps",
        "return",
        "gain",
        "falls %",
        "speed m/s",
        "duty factor",
        "stance peak, weights",
        "stance peak N/kg",
        "loading kN/s",
        "slip of a stance cm",
    )
    return markdown_table(titles, lines)


def order_table(data: Mapping[str, Any]) -> str:
    """Return the table of correlations."""
    names = {
        "stance_peak_n": "stance peak",
        "loading_rate_n_s": "loading rate",
        "slip_m": "slip",
        "cost_of_transport": "cost of transport",
        "duty_factor": "duty factor",
    }
    draws = [[*data["order"][condition].values()] for condition in CONDITIONS]
    lines = [
        [title, *(spread([draw[name] for draw in each], 2) for each in draws)]
        for name, title in names.items()
    ]
    return markdown_table(("figure", *(f"gaits {condition}" for condition in CONDITIONS)), lines)


def passed(data: Mapping[str, Any], key: str) -> str:
    """Write how many trainings gain two thirds, and how many fall in under a tenth of their episodes."""
    seeds = data["learners"][key].values()
    zero, best = data["gaits"]["zero"]["return"], blind_return(data)
    gained = sum(seed["return"] - zero >= 2 / 3 * (best - zero) for seed in seeds)
    upright = sum(seed["failed"] < 0.1 for seed in seeds)
    return (
        f"In {gained} of {len(seeds)} trainings {NAMES[key]} gains two thirds or more of what the best"
        f" policy without feedback gains over the zero action. It falls in under a tenth of the episodes"
        f" in {upright} of {len(seeds)}."
    )


def unfinished(data: Mapping[str, Any]) -> str:
    """Write which trainings of the plan are not done yet; empty if all are."""
    counts = {key: len(data["learners"].get(key, ())) for key in data["planned"]}
    missing = [
        f"{counts[key]} of {planned} of {NAMES[key]}"
        for key, planned in data["planned"].items()
        if counts[key] < planned
    ]
    return f"Trainings of the plan that are done: {', '.join(missing)}." if missing else ""


def deflection_text(data: Mapping[str, Any]) -> str:
    """Write how far springs give."""
    each = data["deflections"].items()
    return ", ".join(f"{GAITS[name]} {one['median']:.2f} ({one['largest']:.2f})" for name, one in each)


def searches(data: Mapping[str, Any]) -> str:
    """Write what the searches spent."""
    return "\n".join(
        f"* from {one['origin']}: {one['episodes']:,} episodes, return {one['return']:.0f},"
        f" {'stalled' if one['stalled'] else 'most episodes spent'}"
        for one in data["search"]
    )


PAGE = """# A leg that carries itself: learners and gaits

Policies on [`HorseLegHop-v0`](../environments/HorseLegHop.md) in the same {starts} episodes. Written by
`python -m agents.experiments --plan hop` from [hop.json](hop.json). Numbers are means over trainings, in
brackets the lowest and the highest; a single number is of one policy. Trained by the code of
{commits}; where a commit is `-dirty`, pages that an earlier publication had written differed, and no code.

{table}

* **Gain** is the return above the zero action's, over the same of the best policy without feedback.
* **Stock** learners are Stable-Baselines3's, with `PPO("MlpPolicy", env)` and one environment.
* **Crank and gait alone** is more than blind: the ground slows down the crank, which a motor drives.
* **The best constant gait and the gait with a clock** see nothing. They were searched by CMA-ES
  (`python -m agents.open_loop`), the first by four numbers, the second by {numbers}: a harmonic of a clock,
  and its frequency. A search goes on until its last quarter gains less than a hundredth:

{searches}

{reading}

## Beside a horse

A horse's fore limb bears 1.3 to 1.4 weights at a gallop, 12.8 to 14 N/kg (McGuigan and Wilson 2003, JEB
206:1325), and is on the ground for 0.44 of a stride at a trot of 3.2 m/s (Bullimore and Burn 2006). A horse
has three more legs: this one bears everything alone, so that over a stance it bears the weight divided by the
duty factor. A half sine of duty factor 0.5 peaks at pi weights.

The springs between the leg's hoof points and the soles are {length:g} m long, and have no stop. Median over
episodes of how far they give at most, and the largest of all, in m: {deflections}. A galloping horse's distal
limb shortens by 0.127 m under 12.8 N/kg, half the load of this one leg. Where a spring gives by more than its
length, the leg's point is below the sole, which pictures show as a hoof in the ground.

## Which gaits the reward prefers

Partial rank correlations of the return with figures of a gait, at given speed: {gaits:,} gaits that last and
travel at {slowest:g} m/s or more, drawn about two gaits of a hop (`python -m agents.order`). A gait hardly
slides if its hoof slides for less than {sliding:.0%} of the distance. Means of {draws} draws, in brackets the
lowest and the highest.

{order}

Gaits that slide have small peaks and pay for slip instead.
"""


def write(out: Path, data: Mapping[str, Any]) -> Path:
    """Write the page; return its path."""
    commits = sorted(
        {f"`{seed['commit']}`" for seeds in data["learners"].values() for seed in seeds.values()}
    )
    record = open_loop_record(gait_file(ID, "phase"))["parameters"]
    reading = [passed(data, key) for key in ("ppo", "sac") if key in data["learners"]]
    text = PAGE.format(
        starts=len(FINAL_SEEDS),
        commits=", ".join(commits),
        table=table(data),
        numbers=np.size(record["coefficients"]) + 1,
        searches=searches(data),
        reading="\n".join([*reading, unfinished(data)]),
        gaits=GAITS_OF_A_DRAW,
        slowest=order.SLOWEST,
        sliding=order.SLIDING,
        draws=len(SEEDS),
        order=order_table(data),
        length=task_of("hop").defaults["hoof_length"],
        deflections=deflection_text(data),
    )
    runs.write_text(out / PAGE_FILE, text)
    return out / PAGE_FILE

"""What the trainings of a plan left, what policies without learning get in the same episodes, and agents
beside the paper's run at matched speed: forces and costs of gaits of other speeds say little.

Agents are slowed down to the run: those with a label in agents/plans are paid for progress up to a speed,
some for bearing weight, too, for else they lean on the suspension; those of HorseLegSpeed-v0 are commanded
it. And the run is sped up to the agents of the default reward: constants scale its crank speed and the
amplitude of its swing, over all that the actions allow. An agent dominates where it is at least as fast, and
its peak forces and cost of transport are lower, all intervals apart; bearing less weight is a way to be soft.

Statistics over seeds: interquartile means with bootstrap 95 % intervals (Agarwal et al. 2021, Deep
reinforcement learning at the edge of the statistical precipice).
"""

from __future__ import annotations

import json
import math
import shlex
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents import runs
from agents.baselines_run import CURVE, FINAL, LEG, Entry, Run, read_curve
from agents.evaluate import Interval, estimate
from agents.score import CURVE_SEEDS, FINAL_SEEDS, TRANSPORT, mean_figures, score_vector
from agents.settings import FOLDER, load_settings
from hoof_env._output import markdown_table
from hoof_env.envs.policies import GAITS as STORED
from hoof_env.envs.policies import open_loop
from hoof_env.errors import DataFileError, HoofEnvError
from hoof_env.gait import LIMITS, GaitParameters

Floats = NDArray[np.float64]

GAITS = ("run", "walk")
OPEN_LOOP = "open-loop"  # name of the gait that CMA-ES found for an id, without learning
REPS = 5000  # of a bootstrap over seeds

SPEED = "hoof_env/HorseLegSpeed-v0"
MATCHED_SPEED = 2.1
"""Speed [m/s] that agents of `SPEED` are commanded, and that of the label "matched" in agents/plans."""

LOWER = ("peak_grf_n", "stance_peak_n", "cost_of_transport")
"""Figures that dominance is about; less is better."""

GAIT_COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "peak_grf_n": ("highest GRF kN", 2, 1e-3),
    "stance_peak_n": ("stance peak kN", 2, 1e-3),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "weight_share": ("weight share", 2, 1.0),
}
"""Title, digits and factor of what the tables show."""

SCALES = 25  # of the crank speed and of the amplitude that are tried, each
SLOWER = 0.05  # by so much of its speed a scaled run may be slower than the agents it stands beside


@dataclass(frozen=True)
class Scored:
    """A policy without learning, or the seeds of an entry, on the episodes of the final score: figures over
    episodes or over seeds, and those of each seed."""

    name: str
    intervals: Mapping[str, Interval]
    seeds: Sequence[Mapping[str, float]] = ()


@dataclass(frozen=True)
class Result:
    folder: Path
    final: dict[str, Any]

    @cached_property
    def figures(self) -> dict[str, float]:
        return mean_figures(self.final["episodes"])

    @cached_property
    def curve(self) -> list[dict[str, float]]:
        return read_curve(self.folder / CURVE)


@dataclass(frozen=True)
class Row:
    entry: Entry
    results: tuple[Result, ...]

    @property
    def title(self) -> str:
        return " ".join(filter(None, (self.entry.algo.upper(), self.entry.label)))

    @cached_property
    def scored(self) -> Scored:
        seeds = [one.figures for one in self.results]
        return Scored(self.title, over_seeds(seeds), seeds)

    @property
    def command(self) -> str:
        """What trains its first seed."""
        return shlex.join(["python", "-m", "agents.baselines_run", *Run(self.entry, 0).command()])


def read_results(plan: Sequence[Entry], folder: Path) -> list[Row]:
    """What is done of a plan; entries without a training that is done are left out. `DataFileError`: nothing
    is done, or a result cannot be read or is not what the plan asks for."""
    rows = []
    for entry in plan:
        folders = [folder / Run(entry, seed).name for seed in range(entry.seeds)]
        results = tuple(read_result(entry, one) for one in folders if (one / FINAL).is_file())
        if results:
            rows.append(Row(entry, results))
    if not rows:
        raise DataFileError(f"{folder}: expected trainings of agents.baselines, found none that is done")
    return rows


def read_result(entry: Entry, folder: Path) -> Result:
    """One training, checked to have the arguments and hyperparameters that its entry has now."""
    try:
        result = Result(folder, json.loads((folder / FINAL).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise DataFileError(f"{folder / FINAL}: expected what agents.baselines_run wrote: {error}") from None
    config = load_settings(folder / runs.CONFIG, entry.env_id)
    for used, expected in (
        (result.final["env_kwargs"], entry.env_kwargs),
        (config, expected_settings(entry)),
    ):
        keys = sorted(key for key in {**used, **expected} if used.get(key) != expected.get(key))
        if keys:
            here, there = ({key: some.get(key) for key in keys} for some in (expected, used))
            raise DataFileError(
                f"{folder}: expected a training with {here}, got {there}; remove what is outdated"
            )
    return result


def expected_settings(entry: Entry) -> dict[str, Any]:
    settings = load_settings(FOLDER / f"{entry.algo}.yml", entry.env_id)
    return settings if entry.steps is None else settings | {"n_timesteps": entry.steps}


def versions_of(rows: Sequence[Row]) -> dict[str, str]:
    """Versions that the trainings were made with; several of one package stand beside each other."""
    versions: dict[str, set[str]] = {}
    for one in (one for row in rows for one in row.results):
        for name, value in runs.read_record(one.folder)["versions"].items():
            versions.setdefault(name, set()).add(value)
    return {name: ", ".join(sorted(values)) for name, values in versions.items()}


def references(env_id: str) -> dict[str, Scored]:
    """The paper's gaits and the open-loop gait of an id on the episodes of the agents; those that it has."""
    known = {}
    for name in (*GAITS, OPEN_LOOP):
        try:
            known[name] = reference(name, name, env_id)
        except HoofEnvError:
            if name in GAITS:
                raise
    return known


def reference(name: str, policy: Any, env_id: str) -> Scored:
    """Score a policy without learning, as `agents.score.score_vector` takes it."""
    return Scored(name, over_episodes(score_vector(policy, env_id, FINAL_SEEDS)))


def over_episodes(episodes: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """The bootstrap's intervals around `mean_figures`; the cost of transport is one of sums, of which whole
    episodes are drawn."""
    from scipy.stats import bootstrap

    means = mean_figures(episodes)
    intervals = {key: estimate([one[key] for one in episodes]) for key in means if key != "cost_of_transport"}
    if "cost_of_transport" in means:
        mean = means["cost_of_transport"]
        intervals["cost_of_transport"] = Interval(mean)
        if math.isfinite(mean):
            parts = np.array([[one[name] for one in episodes] for name in TRANSPORT])

            def cost(drawn: Any, axis: int = -1) -> Any:
                distance, work, force, share = parts[:, drawn].sum(axis)
                return work * share / (force * distance)

            rng, rows = np.random.default_rng(0), np.arange(len(episodes))
            bounds = bootstrap((rows,), cost, vectorized=True, rng=rng).confidence_interval
            intervals["cost_of_transport"] = Interval(mean, float(bounds.low), float(bounds.high))
    return intervals


def iqm(scores: ArrayLike) -> Floats:
    """Interquartile mean over seeds and the percentile bootstrap's interval of it, which draws whole seeds:
    mean, low and high, shape (3,) or (3, n), of scores of shape (seeds,) or (seeds, n). Low and high are NaN
    for one seed. The bootstrap draws the same seeds each time."""
    from scipy.stats import bootstrap, trim_mean

    def middle(some: Floats, axis: int) -> Floats:
        return np.asarray(trim_mean(some, 0.25, axis=axis))

    values = np.asarray(scores, np.float64)
    mean = middle(values, axis=0)
    if len(values) < 2:
        return np.stack([mean, *[np.full_like(mean, np.nan)] * 2])
    options = {"axis": 0, "n_resamples": REPS, "method": "percentile", "rng": np.random.default_rng(0)}
    bounds = bootstrap((values,), middle, **options).confidence_interval
    return np.stack([mean, bounds.low, bounds.high])


def over_seeds(each: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """`iqm` of every figure that the seeds have in common, by name."""
    names = [name for name in each[0] if all(name in one for one in each)]
    columns = iqm([[one[name] for name in names] for one in each]).T
    return {name: Interval(*map(float, column)) for name, column in zip(names, columns, strict=True)}


def cells(one: Scored) -> list[str]:
    known = one.intervals
    return [
        known[key].text(digits, by) if key in known else "" for key, (_, digits, by) in GAIT_COLUMNS.items()
    ]


def commanded_speed(row: Row, speed: float) -> Scored:
    kwargs: dict[str, Any] = {"target_speed": [speed, speed]}
    with warnings.catch_warnings():
        # That they were trained with other speeds, which is meant
        warnings.simplefilter("ignore", UserWarning)
        each = [
            mean_figures(score_vector(str(one.folder), SPEED, FINAL_SEEDS, **kwargs)) for one in row.results
        ]
    return Scored(f"{row.title} of HorseLegSpeed-v0, told {speed:g} m/s", over_seeds(each), each)


def scaled_runs() -> tuple[list[tuple[float, float]], np.ndarray]:
    """Factors of (crank speed, swing amplitude) from 1 to as much as the actions allow, and the actions."""
    env = runs.make_env(LEG)
    leg: Any = env.unwrapped
    gait: GaitParameters = leg.gaits["run"]
    crank = LIMITS["crank_speed"][1] / gait.crank_speed
    swing = min(
        max(bound / value for bound in LIMITS[name])
        for name, value in (("swing_sin", gait.swing_sin), ("swing_cos", gait.swing_cos))
    )
    factors = [(c, s) for c in np.linspace(1, crank, SCALES) for s in np.linspace(1, swing, SCALES)]
    scaled = np.array(factors)[:, [0, 0, 1, 1]]
    scaled[:, 1] = 1.0  # the swing's middle stays
    actions = leg.action_for(scaled * gait.to_array())
    env.close()
    return factors, actions


def held(actions: np.ndarray) -> Any:
    """The policy that holds actions, shape (4,), or (n, 4) for n environments."""
    return open_loop({"constant": actions}, dt=1.0)  # of a clock that is not there


def sped_up(speed: float) -> list[Scored]:
    """The scaled runs that go at `speed` [m/s], or by `SLOWER` less at most, with the lowest stance peak and
    with the lowest cost of transport, chosen on the episodes of the learning curves; where none goes so
    fast, the fastest."""
    factors, actions = scaled_runs()
    episodes = [score_vector(held(actions), LEG, [seed] * len(actions)) for seed in CURVE_SEEDS[:5]]
    means = [mean_figures(each) for each in zip(*episodes, strict=True)]
    near = [k for k, one in enumerate(means) if (1 - SLOWER) * speed <= one["speed_m_s"] <= speed]
    words: dict[int, list[str]] = {}
    if near:
        for key, word in (("stance_peak_n", "softest"), ("cost_of_transport", "cheapest")):
            words.setdefault(min(near, key=lambda k: means[k][key]), []).append(word)
    else:
        words[int(np.argmax([one["speed_m_s"] for one in means]))] = ["fastest"]
    return [
        reference(
            f"run, crank × {factors[k][0]:.2f}, swing × {factors[k][1]:.2f} ({' and '.join(chosen)})",
            held(actions[k]),
            LEG,
        )
        for k, chosen in words.items()
    ]


def dominates(agent: Scored, other: Scored) -> bool:
    """Whether the agent is at least as fast, in the mean, and lower in all of `LOWER`, intervals apart."""
    is_fast = agent.intervals["speed_m_s"].mean >= other.intervals["speed_m_s"].mean
    return is_fast and all(other.intervals[key].above(agent.intervals[key]) for key in LOWER)


def verdict(agent: Scored, other: Scored) -> str:
    if not dominates(agent, other):
        return "no"
    bears_less = other.intervals["weight_share"].above(agent.intervals["weight_share"])
    return "yes, bearing less of the weight" if bears_less else "yes"


def seeds_that_dominate(agent: Scored, other: Scored) -> str:
    """How many seeds are at least as fast and lower in all of `LOWER`, each by its own mean; no interval."""
    means = {key: interval.mean for key, interval in other.intervals.items()}
    count = sum(
        one["speed_m_s"] >= means["speed_m_s"] and all(one[key] < means[key] for key in LOWER)
        for one in agent.seeds
    )
    return f"{count}/{len(agent.seeds)}" if agent.seeds else ""


def compare(rows: Sequence[Row], best: Row | None, run: Scored) -> str:
    """The comparison as a table: each version of the paper's `run`, and below it what is held against it: the
    plan's rows that are done, and the best agents of HorseLeg-v0."""
    agents = []
    for row in rows:
        if row.entry.env_id == LEG and row.entry.label:
            title = f"{row.entry.algo.upper()}, {row.entry.paid}"
            agents.append(Scored(title, row.scored.intervals, row.scored.seeds))
        elif row.entry.env_id == SPEED:
            agents.append(commanded_speed(row, MATCHED_SPEED))
    agents += [
        reference(f"open-loop, {path.stem}", str(path), LEG)
        for path in sorted(STORED.glob("HorseLeg-v0-*-2.json"))  # found for 2 m/s or more
    ]
    groups = [(Scored("run of the paper", run.intervals), agents)]
    if best is not None:
        title = f"{best.title} of HorseLeg-v0, as fast as it likes"
        fast = Scored(title, best.scored.intervals, best.scored.seeds)
        groups += [(one, [fast]) for one in sped_up(fast.intervals["speed_m_s"].mean)]
    lines = []
    for other, beside in groups:
        lines.append([other.name, *cells(other)])
        lines += [
            [one.name, *cells(one), verdict(one, other), seeds_that_dominate(one, other)] for one in beside
        ]
    titles = [title for title, *_ in GAIT_COLUMNS.values()]
    return markdown_table(["", *titles, "dominates", "seeds that do, by their means"], lines)

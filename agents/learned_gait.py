"""A gait looked at closely: its strides, and where impulse and energy come from and go."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.baselines_plan import CURVE_SEEDS
from agents.evaluate import find_policy

Floats = NDArray[np.float64]
ENV_ID = "hoof_env/HorseLeg-v0"
SETTLED = 4.0
"""Seconds of an episode that the strides leave out."""

SHORTEST = 0.1
"""A touch-down so soon after another [s] belongs to the same stride."""

POINTS = 200
"""Of a stride."""


@dataclass(frozen=True)
class Episode:
    """An episode substep by substep.

    Attributes:
        record: state and report of the engine by name, shape (substeps + 1,).
        account: the engine's, at the end.
        terms: sums of the reward's terms.
        summary: figures of the episode.
        leg: the environment.
    """

    record: dict[str, Floats]
    account: dict[str, float]
    terms: dict[str, float]
    summary: dict[str, float]
    leg: Any


def watch(policy: str) -> Episode:
    """Play one episode and run an engine beside it that keeps its account."""
    env = runs.make_env(ENV_ID)
    leg: Any = env.unwrapped
    player = find_policy(policy, env, ENV_ID)
    observation, info = env.reset(seed=CURVE_SEEDS[0])
    engine = leg.engine.alone()
    engine.set_column(0, leg.engine.column(0))
    rows: list[dict[str, Any]] = [engine.run(None, 0)]
    terms: dict[str, float] = {}
    done = False
    while not done:
        action, _ = player.predict(observation)
        observation, _, terminated, truncated, info = env.step(action)
        beside = engine.run(leg.command_of(action), leg.batch.substeps)
        rows.append({name: values[1:] for name, values in beside.items()})
        for key in filter(lambda key: key.startswith("reward_"), info):
            terms[key] = terms.get(key, 0.0) + info[key]
        done = terminated or truncated
    names = [name for name in rows[0] if name != "result"]
    record = {name: np.concatenate([row[name] for row in rows]).squeeze() for name in names}
    record["time"] = leg.sim_dt * np.arange(len(record["time"]))
    record["normal"] = record["toe_normal"] + record["heel_normal"]
    account = {name: float(np.ravel(value)[0]) for name, value in engine.account.items()}
    return Episode(record, account, terms, info["episode_summary"], leg)


def strides(episode: Episode) -> dict[str, Floats]:
    """Steady strides from touch-down to touch-down: columns by name, shape (strides, `POINTS`), and the
    "duration" of each [s]."""
    r, threshold = episode.record, 0.05 * episode.leg.weight
    down = np.flatnonzero((r["normal"][1:] > threshold) & (r["normal"][:-1] <= threshold))
    down = down[r["time"][down] > SETTLED]
    down = down[np.r_[True, np.diff(r["time"][down]) > SHORTEST]]
    found: dict[str, list[Floats]] = {name: [] for name in ("theta_rate", "phi", "normal", "y")}
    for first, last in pairwise(down):
        place = np.linspace(first, last, POINTS)
        for name, rows in found.items():
            rows.append(np.interp(place, np.arange(len(r["time"])), r[name]))
    return {name: np.array(rows) for name, rows in found.items()} | {"duration": np.diff(r["time"][down])}


def audit(episode: Episode) -> dict[str, float]:
    """Where impulse and energy of an episode came from and went, by row of the page's table."""
    r, a, leg = episode.record, episode.account, episode.leg
    trunk = leg.engine.trunk
    seconds, metres = r["time"][-1], r["x"][-1] - r["x"][0]
    weight = leg.weight
    sag = float(np.mean(trunk.height - r["y"]))
    spring, damper = trunk.stiffness * sag * seconds, trunk.damping * (r["y"][0] - r["y"][-1])
    work = a["crank_work"] + a["swing_work"]
    losses = {
        "lost to friction of the hoof [J/m]": a["friction_loss"],
        "lost in the ground [J/m]": a["ground_loss"],
        "lost to the suspension's damper [J/m]": a["damper_loss"],
        "lost to drag of the trunk [J/m]": a["drag_loss"],
    }
    momentum = r["momentum_y"][-1] - r["momentum_y"][0]
    borne = (1 - trunk.share) * weight * seconds + spring + damper
    return {
        "return [-]": sum(episode.terms.values()),
        "speed [m/s]": metres / seconds,
        "stances [1/s]": episode.summary["stances"] / seconds,
        "mean peak of a stance [kN]": 1e-3
        * episode.summary["stance_peak_sum_n"]
        / episode.summary["stances"],
        "distance a stance [m]": metres / episode.summary["stances"],
        "ground bears [of the weight]": a["impulse_y"] / weight / seconds,
        "the rest of the animal bears [of the weight]": borne / weight / seconds,
        "of that by sagging [of the weight]": spring / weight / seconds,
        "vertical momentum gained [of the weight]": momentum / weight / seconds,
        "not accounted for [of the weight]": (a["impulse_y"] + borne - momentum) / weight / seconds - 1,
        "work of the crank [J/m]": a["crank_work"] / metres,
        "work of the swing [J/m]": a["swing_work"] / metres,
        **{name: value / metres for name, value in losses.items()},
        "kept as speed and height [J/m]": (work - sum(losses.values())) / metres,
    }


def draw_strides(episodes: dict[str, Episode], path: Path) -> None:
    """Crank speed, swing, force and height through a stride, one column for each policy."""
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREY, ORANGE

    shown = (
        ("theta_rate", "crank speed [rad/s]", 1.0), ("phi", "swing angle [rad]", 1.0),
        ("normal", "normal force [kN]", 1e-3), ("y", "height of the trunk [m]", 1.0),
    )  # fmt: skip
    figure = Figure(figsize=(9, 8.5), layout="constrained")
    grid = figure.subplots(len(shown), len(episodes), sharex=True, sharey="row")
    for column, (name, colour) in enumerate(zip(episodes, (BLUE, ORANGE), strict=True)):
        found = strides(episodes[name])
        for row, (key, label, factor) in enumerate(shown):
            axes, values = grid[row][column], factor * found[key]
            phase = np.linspace(0, 1, POINTS)
            axes.plot(phase, values.T, color=colour, lw=0.6, alpha=0.3)
            axes.plot(phase, np.median(values, 0), color=colour, lw=2)
            axes.grid(axis="y", color=GREY, alpha=0.15)
            if column == 0:
                axes.set_ylabel(label)
        lasting = np.median(found["duration"])
        grid[0][column].set_title(f"{name}: {len(found['duration'])} strides of {lasting:.2f} s (median)")
        grid[-1][column].set_xlabel("part of the stride, from touch-down to touch-down")
    figure.savefig(path, dpi=110)

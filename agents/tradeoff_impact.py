"""What learned gaits do at impact that a fixed crank cannot, beside gaits that do not see."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.baselines_plan import FINAL_SEEDS, LEG, figures
from agents.impact import AROUND, TOUCH_DOWN, Episode, Floats, find_anyway, watch
from agents.score import score_vector
from agents.tradeoff_gait import as_text
from agents.tradeoff_plan import Plan
from hoof_env.dynamics.trunk_model import LIFT_OFF
from hoof_env.gait.parameters import PARAMETERS


@dataclass(frozen=True)
class Frozen:
    """A policy some of whose actions are held, so that it can be seen what varying them brings.

    Attributes:
        policy: anything with `predict`.
        action: values that are held, shape (4,).
        held: which, bool, shape (4,).
    """

    policy: Any
    action: NDArray[np.float32]
    held: NDArray[np.bool_]

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """The policy's action, with the held ones in place of its own."""
        action, state = self.policy.predict(observation, state, episode_start, deterministic)
        return np.where(self.held, self.action, action).astype(np.float32), state


FAST, SLOW, RUN, OPEN_LOOP = "learned, default reward", "learned to bear at 2 m/s", "paper's run", "open loop"
"""Who is looked at; the second one is about as fast as the paper's run and bears as much."""

Played = Mapping[str, tuple[Any, list[Episode]]]
"""Policy and episodes by name."""


def players(folders: Mapping[str, Path], plan: Plan, tick: Callable[[], Any]) -> Played:
    """Learned policies, each also with its crank speed, or its swing, held at its mean; then the paper's run
    and the open-loop gait of highest return.

    Args:
        folders: of the trainings of `FAST` and `SLOW`.
        plan: which episodes.
        tick: called after each.
    """
    found: dict[str, tuple[Any, list[Episode]]] = {}
    only_crank = np.array([True, False, False, False])
    with runs.make_env(LEG) as env:
        leg: Any = env.unwrapped
        for name, folder in folders.items():
            policy = find_anyway(str(folder), env, LEG)
            episodes = watch(policy, LEG, plan.seeds, tick)
            gaits = [np.mean([one.record[key] for key in PARAMETERS], 1) for one in episodes]
            action = leg.action_for(np.mean(gaits, 0))
            found[name] = policy, episodes
            for part, held in (("crank", only_crank), ("swing", ~only_crank)):
                frozen = Frozen(policy, action, held)
                found[f"{name}, {part} held"] = frozen, watch(frozen, LEG, plan.seeds, tick)
    for name, policy in ((RUN, "run"), (OPEN_LOOP, "open-loop")):
        found[name] = policy, watch(policy, LEG, plan.seeds, tick)
    return found


SCORED = {
    "return": ("return", 1.0), "speed_m_s": ("speed m/s", 1.0), "stance_peak_n": ("stance peak kN", 1e-3),
    "peak_grf_n": ("highest kN", 1e-3), "cost_of_transport": ("cost of transport", 1.0),
    "weight_share": ("weight share", 1.0),
}  # fmt: skip
"""Of the fresh episodes: title and factor."""


def impact_table(played: Played) -> str:
    """What happens at impact, a column for each gait: scores in fresh episodes, then medians over stances."""
    columns = []
    for policy, episodes in played.values():
        scores = figures(score_vector(policy, LEG, FINAL_SEEDS))
        column = [as_text(factor * scores[key]) for key, (_, factor) in SCORED.items()]
        stances = of_stances(episodes)
        column += [str(len(stances["peak"]))]
        columns.append(
            column + [_quartiles(factor * stances[key]) for key, (_, factor) in TOUCH_DOWN.items()]
        )
    titles = [*(title for title, _ in SCORED.values()), "stances looked at",
              *(title for title, _ in TOUCH_DOWN.values())]  # fmt: skip
    lines = [f"| | {' | '.join(played)} |", "|---|" + "---|" * len(played)]
    lines += [
        f"| {title} | {' | '.join(row)} |"
        for title, row in zip(titles, zip(*columns, strict=True), strict=True)
    ]
    return "\n".join(lines)


def of_stances(episodes: Sequence[Episode]) -> dict[str, Floats]:
    """`TOUCH_DOWN` of all stances of some episodes."""
    each = [one.per_stance() for one in episodes]
    return {name: np.concatenate([one[name] for one in each]) for name in TOUCH_DOWN}


def _quartiles(values: Floats) -> str:
    if not len(values):
        return "-"
    low, middle, high = (as_text(x) for x in np.percentile(values, (25, 50, 75)))
    return middle if low == high else f"{middle} ({low} to {high})"


def draw_impact(played: Played, weight: float, path: Path) -> dict[str, Floats]:
    """Curves around touch-down and crank speed against crank angle; returns the medians that it shows, by
    "gait: curve", shape (instants,), and "time_ms"."""
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREY, ORANGE, PURPLE, SKY

    shown = (
        ("crank_speed", "crank speed [rad/s]"), ("hoof_angle", "hoof angle, heel up [°]"),
        ("height", "height of the hoof's lower end [cm]"), ("force", "normal force [body weights]"),
    )  # fmt: skip
    figure = Figure(figsize=(11, 6), layout="constrained")
    panels = list(figure.subplots(2, 3).flat)
    colours = {FAST: BLUE, SLOW: SKY, RUN: PURPLE, OPEN_LOOP: ORANGE}
    found: dict[str, Floats] = {}
    for name, colour in colours.items():
        episodes = played[name][1]
        dt = episodes[0].dt
        time = 1e3 * dt * np.arange(round(AROUND[0] / dt), round(AROUND[1] / dt) + 1.0)
        found["time_ms"] = time
        curves = [one.curves() for one in episodes]
        stacked = {key: np.concatenate([one[key] for one in curves]) for key, _ in shown}
        for axes, (key, label) in zip(panels[:4], shown, strict=True):
            axes.set_ylabel(label)
            axes.set_xlabel("time from touch-down [ms]")
            if len(stacked[key]):
                low, middle, high = np.asarray(np.percentile(stacked[key], (25, 50, 75), axis=0), float)
                axes.fill_between(time, low, high, color=colour, alpha=0.2, lw=0)
                axes.plot(time, middle, color=colour, lw=1.6, label=name)
                found[f"{name}: {key}"] = middle
                if key == "force":
                    near = (time >= -3) & (time <= 30)
                    panels[4].fill_between(time[near], low[near], high[near], color=colour, alpha=0.2, lw=0)
                    panels[4].plot(time[near], middle[near], color=colour, lw=1.6)
        draw_phase(panels[5], episodes[0], weight, colour)
    for axes in panels[:4]:
        axes.axvline(0, color=GREY, lw=0.8, ls=":")
    panels[4].set(xlabel="time from touch-down [ms]", ylabel="force, first 30 ms [body weights]")
    panels[5].set(xlabel="crank angle [°]", ylabel="crank speed, thick: stance [rad/s]", xlim=(0, 360))
    panels[5].set_xticks(range(0, 361, 90))
    for axes in panels:
        axes.grid(color=GREY, alpha=0.15)
        if axes not in panels[1:3]:
            axes.set_ylim(bottom=0)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.savefig(path, dpi=120)
    return found


def draw_phase(axes: Any, episode: Episode, weight: float, colour: str) -> None:
    """Crank speed against crank angle, thick where the hoof bears."""
    angle, speed = np.degrees(episode.record["theta"]) % 360, episode.record["theta_rate"].copy()
    jump = np.flatnonzero(np.abs(np.diff(angle)) > 180)
    speed[jump] = np.nan
    bears = episode.normal > LIFT_OFF * weight
    axes.plot(angle, speed, color=colour, lw=0.6, alpha=0.6)
    axes.plot(angle, np.where(bears, speed, np.nan), color=colour, lw=2.4)

"""Why stock PPO gains little on rough ground: `python -m agents.horse_learning`.

It measures how much of PPO's first gradient is signal under several weights of the reward. Then it trains
stock PPO of several seeds and blind twins under each of `CASES`, plays all of them and policies that need no
learning on the same 1,000 starts, and writes `docs/evidence/horse_learning.md` with its figures. What is
among the figures is not measured again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs, side_by_side
from agents.command import parse, run
from hoof_env._output import check_folder
from hoof_env.envs.policies import make_policy
from hoof_env.errors import check_choice, parse_json
from hoof_env.evaluation.episodes import make_rows, play_rows

EVIDENCE = Path(__file__).parents[1] / "docs" / "evidence"
NAME = "horse_learning"
ENV_ID = "hoof_env/HorseRough-v0"

FIRST_SEED = 3_000_000  # of the starts, which no training and no published score plays

BLIND = ("target", "crank", "gait", "offset")
BALANCE = ("balance", "target", "crank", "hoof", "offset")
"""Groups that blind twins see, if the environment has them; and groups with the trunk scaled by its
deviations, without what follows from crank, command and offsets."""

CURVE_STARTS = 200
CURVE = 100_000
"""Episodes of each learner at the points of the curve, and steps between two."""

WEIGHTS = {
    "alive": 45.0, "tracking": 64.0, "peak": 0.25, "slip": 35.0, "landing": 0.25, "work": 0.4, "pitch": 3.0,
    "fall": 100.0,
}  # fmt: skip
"""Weights of the id."""

GAINS = (0.0, 0.2, 0.4, 0.8)
"""Offsets of all cranks for each m/s above the commanded speed, in units of the action [s/m]."""

KEPT = ("return", "failed", "success", "speed_m_s", "slip_m", "stance_peak_n", "loading_rate_n_s")
"""Figures of an episode that are kept."""

Figures = dict[str, Any]
Floats = NDArray[np.float64]


def changed(scale: float = 1.0, **changes: float) -> dict[str, float]:
    """Return the weights of the id with changes, all times a factor."""
    return {name: scale * weight for name, weight in (WEIGHTS | changes).items()}


REWARDS = {
    "of the id": changed(),
    "a fall and survival alone": changed() | dict.fromkeys(set(WEIGHTS) - {"alive", "fall"}, 0.0),
    "without `alive`, a fall costs 190": changed(alive=0.0, fall=190.0),
    "of level ground": changed(tracking=16.0, fall=15.0),
    "of level ground, without `alive`": changed(alive=0.0, tracking=16.0, fall=15.0),
    "quiet": changed(alive=0.0, tracking=32.0, slip=70.0, fall=40.0),
    "slip alone": dict.fromkeys(WEIGHTS, 0.0) | {"slip": 35.0},
}
"""Weights under which the signal of the gradient is measured."""

SURROUNDINGS: Mapping[str, Mapping[str, Any]] = {
    "as it is": {},
    "pushes twice as strong": {"strength": 2.0},
}
"""Arguments under which it is measured."""


@dataclass(frozen=True)
class Case:
    """Stock PPO on one form of the task.

    Attributes:
        seeds, blind: learners that see all, and blind twins.
        env_kwargs: arguments of the environment.
    """

    seeds: int
    blind: int
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)


CASES = {
    "as it is": Case(5, 3),
    "quiet": Case(
        5,
        3,
        {
            "reward_weights": changed(0.1, alive=0.0, tracking=32.0, slip=70.0, fall=40.0),
            "observation": BALANCE,
        },
    ),
}
"""Forms of the task under which stock PPO learns: the id's own; and with weights of the reward that a fall
does not dominate, a tenth as large, and observations in which feedback is not small."""


class CrankFeedback:
    """All cranks turn faster by `gain` of the action's span for each m/s above the commanded speed."""

    def __init__(self, env: Any, gain: float) -> None:
        self.gain = gain
        names = env.observation_names
        self.speed = names.index("forward speed")
        self.commanded = names.index("commanded speed")

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return actions, shape (n, 16), for observations, shape (n, k)."""
        at_speed, commanded = (5.0 * np.arctanh(observation[:, k]) for k in (self.speed, self.commanded))
        actions = np.zeros((len(observation), 16), np.float32)
        actions[:, ::4] = (self.gain * (at_speed - commanded))[:, None]
        return np.clip(actions, -1.0, 1.0), state


class OneOf:
    """One of several learners as a policy."""

    def __init__(self, learners: side_by_side.Learners, at: int) -> None:
        self.learner = learners.alone(at)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return actions, shape (n, 16), for observations, shape (n, k)."""
        return self.learner.act(np.ascontiguousarray(observation, np.float32)[None])[0], state


def played(
    policy: Callable[[Any], Any], starts: int, env_kwargs: Mapping[str, Any] | None = None
) -> dict[str, Floats]:
    """Return figures of the episodes of a policy, which is made for an environment, from the first `starts`
    seeds: an array for each of `KEPT`."""
    envs = make_rows(ENV_ID, starts, **(env_kwargs or {}))
    assert envs is not None
    episodes = play_rows(envs, policy(envs), range(FIRST_SEED, FIRST_SEED + starts))
    return {name: np.array([episode[name] for episode in episodes]) for name in KEPT}


def summary(figures: Mapping[str, Floats], zero: Mapping[str, Floats]) -> Figures:
    """Return means, and differences of returns and falls from the zero action's in the same episodes, with
    their standard errors."""
    found: Figures = {name: float(figures[name].mean()) for name in KEPT}
    for name in ("return", "failed"):
        off = figures[name] - zero[name]
        found[f"{name} over zero"] = [float(off.mean()), float(off.std(ddof=1) / np.sqrt(len(off)))]
    return found


def every(
    learners: side_by_side.Learners,
    case: Case,
    env_kwargs: Mapping[str, Any],
    zero: Mapping[str, Floats],
    starts: int,
) -> list[Figures]:
    """Return the summaries of all learners of a case, blind twins last."""
    return [
        summary(played(lambda envs, at=at: OneOf(learners, at), starts, env_kwargs), zero)
        for at in range(case.seeds + case.blind)
    ]


def learn(case: Case, steps: int, starts: int) -> Figures:
    """Train the learners of a case; play them and the zero action in its environment."""
    began = time.process_time()
    kwargs = dict(case.env_kwargs)

    curve = []

    def look(done: int, learners: side_by_side.Learners) -> None:
        if done // CURVE == (done - side_by_side.DEFAULTS.n_steps) // CURVE:
            return
        spent = time.process_time() - began
        zero = played(lambda envs: make_policy("zero", envs), CURVE_STARTS, kwargs)
        figures = every(learners, case, kwargs, zero, CURVE_STARTS)
        curve.append({"steps": done, "seeds": figures[: case.seeds], "blind": figures[case.seeds :]})
        for kind in ("seeds", "blind"):
            told = ", ".join(
                f"{one['return over zero'][0]:.1f} ({one['failed']:.3f})" for one in curve[-1][kind]
            )
            print(f"{done:,} steps, {spent:.0f} s, {kind}: return over zero (falls) {told}", flush=True)

    learners = side_by_side.train(
        ENV_ID, case.seeds, steps, tick=look, blind=case.blind, groups=BLIND, **kwargs
    )
    trained = time.process_time() - began
    zero = played(lambda envs: make_policy("zero", envs), starts, kwargs)
    figures = every(learners, case, kwargs, zero, starts)
    return {
        "steps": steps,
        "starts": starts,
        "env_kwargs": kwargs,
        "processor_s": round(trained),
        "zero": summary(zero, zero),
        "seeds": figures[: case.seeds],
        "blind": figures[case.seeds :],
        "curve": curve,
    }


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    out: Path = EVIDENCE
    """folder of the page"""
    only: tuple[str, ...] = ()
    """cases to train; otherwise all that the figures lack"""
    train: bool = True
    """train; otherwise measure and write the rest"""
    steps: int = 300_000
    """of each learner"""
    starts: int = 1000
    """episodes of each policy"""
    rows: int = 256
    """environments whose gradients are samples"""
    recorded: int = 1500
    """steps of each"""
    sighted: tuple[Path, ...] = ()
    """runs of ppo_flat on this id, to be compared with the best blind policies"""


def main(argv: list[str] | None = None) -> None:
    """Measure what the figures lack, and write the page."""
    args = parse(Args, argv, "python -m agents.horse_learning", __doc__)
    check_folder(args.out)
    figures = args.out / NAME / "figures.json"
    found: Figures = parse_json(figures.read_text(encoding="utf-8")) if figures.is_file() else {}
    for name in args.only or CASES:
        if name not in found.get("learners", {}):
            case = CASES[check_choice("only", name, CASES)]
            found.setdefault("learners", {})[name] = learn(case, args.steps, args.starts)
            figures.parent.mkdir(exist_ok=True)
            runs.write_text(figures, json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    run(main)

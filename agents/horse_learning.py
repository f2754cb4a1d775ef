"""How steadily stock PPO learns on rough ground, and why: `python -m agents.horse_learning`.

On the id as it was, it measures how much of PPO's first gradient is signal under several weights of the
reward, and what a step along it gains. It trains stock PPO of several seeds and blind twins on each of
`CASES`, plays all of them and policies that need no learning on the same 1,000 starts, and writes
`docs/evidence/horse_learning.md` with its figures. What is among the figures is not measured again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hoof_env
from agents import results, runs, side_by_side
from agents.command import parse, run
from agents.gradient_signal import first_step, record, signal_to_noise
from agents.kept import EVIDENCE, check_numbers, check_shape, read_kept
from hoof_env._output import check_folder, markdown_table
from hoof_env.envs.policies import make_policy
from hoof_env.errors import check_choice
from hoof_env.evaluation.episodes import make_rows, play_rows
from hoof_env.policies.find import find_policy
from hoof_env.tasks.disturbances import rough_ground
from hoof_env.tasks.horse import MASS

NAME = "horse_learning"
ENV_ID = "hoof_env/HorseRough-v0"
BEFORE = "horse_learning/HorseRoughBefore-v0"
"""Form of the id whose faults the study found: 50 actions a second, the observation of `Horse-v0`, and
rewards fifty times as large."""

FIRST_SEED = 3_000_000  # of the starts, which no training and no published score plays

BLIND = ("target", "crank", "gait", "offset")
"""Groups that blind twins see where they are observed."""

CURVE_STARTS = 200
CURVE = 100_000
"""Episodes of each learner at the points of the curve, and steps between two."""

WEIGHTS = {
    "alive": 45.0, "tracking": 64.0, "peak": 0.25, "slip": 35.0, "landing": 0.25, "work": 0.4, "pitch": 3.0,
    "fall": 100.0,
}  # fmt: skip
"""Weights of the id as it was; now they are a fiftieth of these."""

QUIET = {"alive": 0.0, "tracking": 32.0, "slip": 70.0, "fall": 40.0}
"""Weights that differ in a reward which falls do not dominate."""

GAINS = (0.0, 0.2, 0.4, 0.8)
"""Offsets of all cranks for each m/s above the commanded speed, in units of the action [s/m]."""

KEPT = ("return", "failed", "success", "speed_m_s", "slip_m", "stance_peak_n", "loading_rate_n_s")
"""Figures of an episode that are kept."""

MEASURED = ("gains", "signal", "steps", "sighted")
"""Figures besides those of learners."""

STEPPED = ("of the id", "quiet")
SIZE = 0.3
SAMPLES = 3
"""Weights under which a step is taken along a first gradient, root mean square of its actions, and number of
recordings, each with a gradient of its own."""

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
    "quiet": changed(**QUIET),
    "slip alone": dict.fromkeys(WEIGHTS, 0.0) | {"slip": 35.0},
}
"""Weights under which the signal of the gradient is measured."""

SURROUNDINGS: Mapping[str, Mapping[str, Any]] = {
    "as it is": {},
    "pushes twice as strong": {"strength": 2.0},
}
"""Arguments under which it is measured."""


hoof_env.register(
    BEFORE,
    base="horse",
    reward_weights=WEIGHTS,
    **rough_ground(1.0, MASS),
)


@dataclass(frozen=True)
class Case:
    """Stock PPO on one form of the task.

    Attributes:
        seeds, blind: learners that see all, and blind twins.
        env_id: id of the environment.
        env_kwargs: its arguments.
    """

    seeds: int
    blind: int
    env_id: str = ENV_ID
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)


CASES = {
    "as it is": Case(10, 10),
    "as it was": Case(5, 0, BEFORE),
    "as it was, with 25 actions a second": Case(5, 0, BEFORE, {"dt": 0.04}),
    "as it is, with 50 actions a second": Case(5, 0, env_kwargs={"dt": 0.02}),
    "as it is, with rewards fifty times as large": Case(5, 0, env_kwargs={"reward_weights": WEIGHTS}),
}
"""Forms of the task under which stock PPO is trained: the id's own, the one before, and with one change each.
The page has those whose training is through."""


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


def zero_action(envs: Any) -> Any:
    """Make the policy that does nothing."""
    return make_policy("zero", envs)


def found_policy(name: str, env_kwargs: Mapping[str, Any]) -> Any:
    """Return a policy for the id as it is, with arguments."""
    with runs.make_env(ENV_ID, **env_kwargs) as env:
        return find_policy(name, env, ENV_ID)


def _always(policy: Any) -> Callable[[Any], Any]:
    """Return a function that gives this policy for any environment."""
    return lambda envs: policy


def played(
    policy: Callable[[Any], Any], starts: int, env_id: str, env_kwargs: Mapping[str, Any] | None = None
) -> dict[str, Floats]:
    """Return figures of the episodes of a policy, which is made for an environment, from the first `starts`
    seeds: an array for each of `KEPT`."""
    envs = make_rows(env_id, starts, **(env_kwargs or {}))
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
    zero: Mapping[str, Floats],
    starts: int,
) -> list[Figures]:
    """Return the summaries of all learners of a case, blind twins last."""
    return [
        summary(played(_always(OneOf(learners, at)), starts, case.env_id, case.env_kwargs), zero)
        for at in range(case.seeds + case.blind)
    ]


def learn(case: Case, steps: int, starts: int) -> Figures:
    """Train the learners of a case; play them and the zero action in its environment."""
    began = time.process_time()
    curve: list[Figures] = []

    def look(done: int, learners: side_by_side.Learners) -> None:
        if done // CURVE == (done - side_by_side.DEFAULTS.n_steps) // CURVE:
            return
        spent = time.process_time() - began
        zero = played(zero_action, CURVE_STARTS, case.env_id, case.env_kwargs)
        figures = every(learners, case, zero, CURVE_STARTS)
        curve.append({"steps": done, "seeds": figures[: case.seeds], "blind": figures[case.seeds :]})
        for kind in ("seeds", "blind"):
            told = ", ".join(
                f"{one['return over zero'][0]:.1f} ({one['failed']:.3f})" for one in curve[-1][kind]
            )
            print(f"{done:,} steps, {spent:.0f} s, {kind}: return over zero (falls) {told}", flush=True)

    learners = side_by_side.train(
        case.env_id, case.seeds, steps, tick=look, blind=case.blind, groups=BLIND, **case.env_kwargs
    )
    trained = time.process_time() - began
    zero = played(zero_action, starts, case.env_id, case.env_kwargs)
    figures = every(learners, case, zero, starts)
    return {
        "steps": steps,
        "starts": starts,
        "env_id": case.env_id,
        "env_kwargs": dict(case.env_kwargs),
        "processor_s": round(trained),
        "zero": summary(zero, zero),
        "seeds": figures[: case.seeds],
        "blind": figures[case.seeds :],
        "curve": curve,
    }


def measure_gains(starts: int) -> list[Figures]:
    """Play one number of feedback: all cranks faster by a gain times the error of the speed."""
    zero = played(zero_action, starts, BEFORE)
    return [
        {"gain": gain, **summary(played(partial(CrankFeedback, gain=gain), starts, BEFORE), zero)}
        for gain in GAINS
    ]


def measure_signal(rows: int, steps: int) -> dict[str, dict[str, float]]:
    """Return signal over noise of the first gradient, by surroundings and weights of the reward."""
    found = {}
    for name, kwargs in SURROUNDINGS.items():
        recording = record(BEFORE, rows, steps, **kwargs)
        found[name] = {of: signal_to_noise(recording, weights) for of, weights in REWARDS.items()}
    return found


def measure_steps(rows: int, steps: int, starts: int) -> list[Figures]:
    """Play policies one step from the untrained one, along first gradients."""
    zero = played(zero_action, starts, BEFORE)
    found = []
    for sample in range(SAMPLES):
        recording = record(BEFORE, rows, steps, sample)
        for weights, whitened in product(STEPPED, (False, True)):
            policy = first_step(recording, REWARDS[weights], SIZE, whitened)
            about = {"weights": weights, "whitened": whitened, "sample": sample}
            found.append(about | summary(played(_always(policy), starts, BEFORE), zero))
    return found


def measure_sighted(folders: Sequence[Path], starts: int) -> list[Figures]:
    """Play runs of `ppo_flat`, the best policies without feedback and the zero action."""
    zero = played(zero_action, starts, ENV_ID)
    with runs.make_env(ENV_ID) as env:
        observed = env.unwrapped.settings.observation  # type: ignore[attr-defined]
    found = [{"name": "zero action", **summary(zero, zero)}]
    others: list[tuple[str, str, Mapping[str, Any]]] = [
        ("best gait locked to the crank", "open-loop", {}),
        (
            "best blind agent",
            str(results.RESULTS / "policies" / "HorseRough-v0-blind"),
            {"observation": [group for group in observed if group in BLIND]},
        ),
        ("shipped agent", "shipped", {}),
    ]
    for folder in folders:
        kept = runs.read_record(folder)
        others.append(
            (f"{kept['algo']}, {kept['finished']['steps']:,} steps", str(folder), kept["env_kwargs"])
        )
    for name, policy, kwargs in others:
        figures = played(_always(found_policy(policy, kwargs)), starts, ENV_ID, kwargs)
        found.append({"name": name, **summary(figures, zero)})
    return found


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
    rows: int = 128
    """environments whose gradients are samples"""
    recorded: int = 1500
    """steps of each"""
    probed: int = 250
    """episodes of each step along a gradient"""
    sighted: tuple[Path, ...] = ()
    """runs of ppo_flat on this id, which are compared with the best blind policies"""


LEARNERS = """## Stock PPO

`PPO("MlpPolicy", env)` of Stable-Baselines3 with its defaults (`agents/side_by_side.py`), {learnt:,} steps,
played without noise on the same {starts} starts. Blind twins see crank, command and offsets. Returns are over
the zero action's in the same episodes, as a part of it.

{table}

On the way there, in {curve_starts} of the episodes:

{curve}

"""

PAGE = """# What stock PPO learns on rough ground

Written by `python -m agents.horse_learning` from [its figures]({name}/figures.json), measured at {commits}.
Episodes have seeds from 3,000,000 on, and differences from the zero action are paired. *As it was* means the
id until November 2026: 50 actions a second, the observation of `Horse-v0`, and rewards fifty times as large.

**Asked.** What kept stock PPO from learning steadily on rough ground, and what mends it?

**Found.** {found}

{learners}## One number of feedback

As it was. All cranks turn faster by a gain, in units of the action, for each m/s above the commanded speed.
{starts} starts.

{gains}

## How much of the first gradient is signal

As it was. The square of the first policy gradient over the variance of its estimate from one rollout of 2048
steps, for feedback that is linear in the observation (`agents/gradient_signal.py`); {rows} environments of
{recorded} steps. With 0.01 a hundred rollouts have as much signal as noise, and 300,000 steps are 147
rollouts. *Quiet* are `alive` 0, `tracking` 32, `slip` 70 and `fall` 40 in place of 45, 64, 35 and 100.

{signal}

## One step along the first gradient

As it was. Policies without noise, linear in the observation, one step from the zero action: the root mean
square of their actions is {size}. {probed} starts. The gradient is that of {total:,} recorded steps, and each
figure of a cell is of a recording of its own. *Whitened* is the gradient with respect to observations that
are uncorrelated and of one size, the natural gradient.

{steps}

## Sighted and blind

As it is. `ppo_flat` with its settings, {starts} starts. Blind agents see crank, command and offsets; the best
of several is chosen by other starts. The gait is the best of several searches.

{sighted}
"""


def interval(pair: Sequence[float], digits: int = 1) -> str:
    """Format a difference with its 95 % interval."""
    mean, error = pair
    return f"{mean:+.{digits}f} [{mean - 1.96 * error:.{digits}f}, {mean + 1.96 * error:.{digits}f}]"


def row_of(one: Figures, *names: str) -> list[str]:
    """Return the cells of a policy: names, falls, success, slip, and the return over the zero action's."""
    falls = f"{100 * one['failed']:.1f} %"
    return [
        *names,
        falls,
        f"{100 * one['success']:.1f} %",
        f"{one['slip_m']:.3f}",
        interval(one["return over zero"]),
    ]


HEAD = ("falls", "success", "slip a stance [m]", "return over the zero action's")


def learner_rows(learners: Mapping[str, Figures]) -> list[list[str]]:
    """Return two rows for each case: learners that see all, and blind twins."""
    rows = []
    for name, of_case in learners.items():
        for kind, title in (("seeds", "sighted"), ("blind", "blind")):
            ones = of_case[kind]
            if not ones:
                continue
            falls = ", ".join(f"{100 * one['failed']:.1f}" for one in ones)
            whole = of_case["zero"]["return"]
            gains = ", ".join(f"{100 * one['return over zero'][0] / whole:+.1f}" for one in ones)
            success = ", ".join(f"{100 * one['success']:.0f}" for one in ones)
            zero = of_case["zero"]
            rows.append([name, title, falls, f"{100 * zero['failed']:.1f}", success, gains])
    return rows


def curve_rows(learners: Mapping[str, Figures]) -> list[list[str]]:
    """Return a row for each look at the learners of a case that see all."""
    rows = []
    for name, of_case in learners.items():
        for look in of_case["curve"]:
            ones = look["seeds"]
            gaining = sum(one["return over zero"][0] >= 0 for one in ones)
            falls = np.mean([100 * one["failed"] for one in ones])
            rows.append([name, f"{look['steps']:,}", f"{gaining} of {len(ones)}", f"{falls:.0f}"])
    return rows


def of_kind(steps: Sequence[Figures], weights: str, whitened: bool) -> list[Figures]:
    """Return the samples of a step."""
    return [one for one in steps if one["weights"] == weights and one["whitened"] == whitened]


def step_cells(ones: Sequence[Figures]) -> list[str]:
    """Return the falls, successes and returns of the samples of a step."""
    return [
        ", ".join(f"{100 * one['failed']:.0f}" for one in ones),
        ", ".join(f"{100 * one['success']:.0f}" for one in ones),
        ", ".join(f"{one['return over zero'][0]:+.0f}" for one in ones),
    ]


def learners_text(learners: Mapping[str, Figures], args: Args) -> str:
    """Return the section of stock PPO, nothing if none was trained."""
    if not learners:
        return ""
    head = [
        "form",
        "sees",
        "falls of each seed [%]",
        "zero action's",
        "success [%]",
        "return over zero's [%]",
    ]
    return LEARNERS.format(
        learnt=max(one["steps"] for one in learners.values()),
        starts=f"{args.starts:,}",
        table=markdown_table(head, learner_rows(learners)),
        curve_starts=CURVE_STARTS,
        curve=markdown_table(
            ["form", "steps", "sighted: not below zero action", "falls on the average [%]"],
            curve_rows(learners),
        ),
    )


def page(found: Figures, args: Args) -> str:
    """Return the text of the page."""
    gains = [row_of(one, f"{one['gain']:g}") for one in found["gains"]]
    names = list(found["signal"])
    signal = [[of, *(f"{found['signal'][name][of]:.3f}" for name in names)] for of in REWARDS]
    steps = [
        [
            weights,
            "whitened" if whitened else "as it is",
            *step_cells(of_kind(found["steps"], weights, whitened)),
        ]
        for weights, whitened in product(STEPPED, (False, True))
    ]
    sighted = [row_of(one, one["name"]) for one in found.get("sighted", [])]
    return PAGE.format(
        name=NAME,
        commits=commits_of(found),
        found=found_text(found),
        starts=f"{args.starts:,}",
        rows=args.rows,
        recorded=f"{args.recorded:,}",
        total=args.rows * args.recorded,
        size=SIZE,
        probed=args.probed,
        gains=markdown_table(["gain", *HEAD], gains),
        signal=markdown_table(["weights", *names], signal),
        steps=markdown_table(
            [
                "weights",
                "gradient",
                "falls [%]",
                "success [%]",
                "return over the zero action's",
            ],
            steps,
        ),
        learners=learners_text(found.get("learners", {}), args),
        sighted=markdown_table(["policy", *HEAD], sighted),
    )


def found_text(found: Figures) -> str:
    """Say what was found, with its figures."""
    none, *others = found["gains"]
    best = min(others, key=lambda one: one["failed"])
    signal = found["signal"][next(iter(SURROUNDINGS))]

    def falls(weights: str, whitened: bool) -> str:
        """Say how often the samples of a step fall."""
        ones = [100 * one["failed"] for one in of_kind(found["steps"], weights, whitened)]
        return f"{min(ones):.0f} to {max(ones):.0f} %"

    return (
        f"{learnt_text(found.get('learners', {}))}Of PPO's first gradient as it was, the signal over noise of"
        f" a rollout was {signal['of the id']:.3f} in the one recording of the table, and"
        f" {signal['quiet']:.3f} with quiet weights. Recordings differ by more: ten, samples 0 to 9 of"
        " `gradient_signal.record`, have 0.011 to 0.059 and 0.010 to 0.068, and quiet weights are the better"
        " ones in seven, so that no order of weights is shown. PPO limits the norm of all gradients together,"
        " and with returns of hundreds the value function's share of it leaves little to the policy. With 25"
        " actions a second a rollout lasts twice as long, and a discounted return sees twice as far. What a"
        " step gains depends on the scale of observations: one linear step"
        f" along the gradient falls in {falls('quiet', False)}, along the whitened one in"
        f" {falls('quiet', True)}, with the weights of the id in"
        f" {falls('of the id', False)} and {falls('of the id', True)}. Feedback pays: with one number of it"
        f" {100 * best['failed']:.1f} % of the episodes end in a fall in place of"
        f" {100 * none['failed']:.1f} %."
    )


def learnt_text(learners: Mapping[str, Figures]) -> str:
    """Say how many learners of each case gain, and how often they fall."""
    told = []
    for name, of_case in learners.items():
        ones = of_case["seeds"]
        gain = [one["return over zero"][0] for one in ones]
        falls = [100 * one["failed"] for one in ones]
        told.append(
            f"{name}, {sum(each >= 0 for each in gain)} of {len(ones)} return no less than the zero action"
            f" and fall in {min(falls):.0f} to {max(falls):.0f} % of the episodes, {np.mean(falls):.0f} %"
            f" on the average (zero action {100 * of_case['zero']['failed']:.0f} %)"
        )
    return f"Of stock PPO's seeds, {'; '.join(told)}. " if told else ""


def figures_of_file(content: Any) -> Figures:
    """Return the figures of a file's content; raise KeyError, TypeError or ValueError for another file's."""
    found: Figures = dict(content)
    if unknown := sorted({*found} - {*MEASURED, "learners", "commits", "versions"}):
        raise ValueError(f"there are entries {', '.join(unknown)}")
    for name in {*MEASURED} & {*found}:
        rows = [found[name][each] for each in SURROUNDINGS] if name == "signal" else found[name]
        for one in rows:
            check_numbers(f"a row of {name}", one, REWARDS if name == "signal" else KEPT)
            if name != "signal":
                check_shape(f"return over zero of {name}", one["return over zero"], (2,))
    for case in found.get("learners", {}).values():
        check_numbers("a case of learners", case, ("steps", "starts"))
        for one in (case["zero"], *case["seeds"], *case["blind"]):
            check_numbers("a learner", one, KEPT)
    # Files once had a commit for all figures
    measured = [name for name in MEASURED if name in found]
    measured += [f"learners {name}" for name in found.get("learners", {})]
    found.setdefault("commits", dict.fromkeys(measured, found.get("versions", {}).get("commit", "unknown")))
    return found


def commits_of(found: Figures) -> str:
    """Return the commits that measured the figures, with what each measured if there are several."""
    of_commits: dict[str, list[str]] = {}
    for name, commit in found["commits"].items():
        of_commits.setdefault(commit, []).append(name)
    if len(of_commits) == 1:
        return f"commit `{next(iter(of_commits))}`"
    return "commits " + ", ".join(f"`{commit}` ({', '.join(names)})" for commit, names in of_commits.items())


def tell_what_is_missing(found: Figures, cases: Sequence[str], args: Args) -> None:
    """Print what is to be trained and measured."""
    for name in cases:
        case = CASES[name]
        learners = f"{case.seeds} learners and {case.blind} blind twins of {args.steps:,} steps each"
        print(f"to train: {name}, {learners}; hours", flush=True)
    missing = [] if args.only else [name for name in MEASURED[:3] if name not in found]
    print(f"to measure: {', '.join(missing) or 'nothing'}", flush=True)


def main(argv: list[str] | None = None) -> None:
    """Measure what the figures lack, and write the page."""
    args = parse(Args, argv, "python -m agents.horse_learning", __doc__)
    check_folder(args.out)
    figures = args.out / NAME / "figures.json"
    found: Figures = {"commits": {}}
    if figures.is_file():
        found = read_kept(figures, "figures that agents.horse_learning measured", figures_of_file)
    # Before hours in which others may commit
    versions, commit = runs.versions(), results.commit_of_code()

    def keep(name: str, measured: Any, case: str = "") -> None:
        found[name] = measured
        found["commits"][f"{name} {case}".strip()] = commit
        found["versions"] = versions
        figures.parent.mkdir(parents=True, exist_ok=True)
        runs.write_text(figures, json.dumps(found, indent=1) + "\n")

    asked = [check_choice("only", name, CASES) for name in args.only] or (CASES if args.train else ())
    cases = [name for name in asked if name not in found.get("learners", {})]
    tell_what_is_missing(found, cases, args)
    for name in cases:
        learnt = {name: learn(CASES[name], args.steps, args.starts)}
        keep("learners", found.get("learners", {}) | learnt, name)
    if args.only:
        return
    if "gains" not in found:
        keep("gains", measure_gains(args.starts))
    if "signal" not in found:
        keep("signal", measure_signal(args.rows, args.recorded))
    if "steps" not in found:
        keep("steps", measure_steps(args.rows, args.recorded, args.probed))
    if args.sighted:
        keep("sighted", measure_sighted(args.sighted, args.starts))
    runs.write_text(args.out / f"{NAME}.md", page(found, args))


if __name__ == "__main__":
    run(main)

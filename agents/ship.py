"""Ship trained policies: a small folder for each id, written by one command.

    python -m agents.ship runs/baselines                for each id the best of all runs beneath this folder
    python -m agents.ship runs/ppo-HorseLeg-v0-s0       this run

The best of an id is that with the highest mean return in episodes on which nothing is reported. What plays is
in the package, hoof_env/data/policies/NAME: its weights as plain data, how it was trained, its returns beside
the gaits' and how far other machines may be off. agents/policies/NAME has the exported policy, a model
card, a curve and a film, and agents/policies/README.md lists all. Each folder is written whole or not at all.
After a change of the card's template `python -m agents.cards` writes the cards of all policies anew.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.cards import CARD, FILM, POLICIES, SCORE, card
from agents.command import parse, run
from agents.export import write_policy
from agents.pages import draw_learning_curve, training_length
from hoof_env._output import check_folder, markdown_table, staged
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.errors import DataFileError, OutputError, ParameterError, check_choice, parse_json
from hoof_env.evaluation.episodes import FINAL_SEEDS as SCORE_SEEDS
from hoof_env.evaluation.episodes import score_vector
from hoof_env.evaluation.scores import Score, to_json
from hoof_env.evaluation.statistics import Interval
from hoof_env.film import render_episode
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.policies.onnx_file import FILE, OnnxPolicy
from hoof_env.policies.record import about, environment_of, own_id
from hoof_env.policies.saved import ABOUT, WEIGHTS

CHOOSING_SEEDS = range(500_000, 500_100)
"""Seeds of the episodes by which the best of several runs is chosen; no training and no reported score plays
them."""

CHECKED = 20
"""Number of episodes, from the first of the score on, that are played again to check a shipped policy."""

GAITS = ("zero", "run", "walk", "carrying_walk", "reference", "constant", "open-loop")
"""Policies that are scored as well, if an id has them."""

LIMIT = 1_000_000
FILM_LIMIT = 650_000
"""Largest size of a folder and of the film in it [bytes]; a film that is larger is made shorter."""

FILM_SECONDS = 4.0

COPIED = (WEIGHTS, ABOUT, runs.CONFIG)
PACKAGED = (WEIGHTS, ABOUT, runs.RECORD, SCORE)
"""Files of the package; people read the rest."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    runs: Positional[Path]
    """a run folder of agents.train, or a folder with several beneath it"""
    env_id: tuple[str, ...] = ()
    """only these ids"""
    chosen: str = ""
    """how a run that was picked by hand was picked, a phrase for its card; among the runs given, the best by
    return is found"""
    out: Path = POLICIES
    """folder for the policies' folders; in another one than this they have all files"""


@dataclass(frozen=True)
class Choice:
    """Run that is shipped, the number of runs of which it has the highest return, and how it was picked by
    hand before that, if it was."""

    saved: runs.SavedModel
    among: int = 1
    by_hand: str = ""


def find_runs(folder: Path) -> dict[str, list[runs.SavedModel]]:
    """Return the trained models in or beneath a folder by environment, without models that have arguments of
    it.

    Raises:
        DataFileError: there is none, or one lacks a file.
    """
    models: dict[str, list[runs.SavedModel]] = {}
    is_run = (folder / runs.RECORD).is_file()
    for path in [folder] if is_run else sorted(record.parent for record in folder.rglob(runs.RECORD)):
        if not any((path / name).is_file() for name in (runs.MODEL, ABOUT)):
            print(f"passed over {path}: it is not through")
            continue
        # A folder that is half copied must not be shipped
        needed = [runs.CONFIG, runs.MONITOR, *([WEIGHTS] if (path / ABOUT).is_file() else [])]
        if missing := [name for name in needed if not (path / name).is_file()]:
            raise DataFileError(f"run {path}: expected all of a training, found no {missing[-1]}")
        saved = runs.SavedModel.find(path)
        # A policy for other arguments would play under the plain id
        if not saved.record.get("env_kwargs"):
            env_id, _ = environment_of(saved.path, saved.record)
            models.setdefault(str(env_id), []).append(saved)
    if not models:
        raise DataFileError(f"runs {folder}: expected a run of agents.train, or a folder with some, got none")
    return models


def choose(saved: Sequence[runs.SavedModel], env_id: str, by_hand: str = "") -> Choice:
    """Return the run with the highest mean return in `CHOOSING_SEEDS`."""
    from tqdm import tqdm

    if len(saved) == 1:
        return Choice(saved[0], by_hand=by_hand)
    values = []
    with runs.make_env(env_id) as env:
        for model in tqdm(saved, desc=f"runs of {env_id}", leave=False, disable=None):
            episodes = score_vector(model.load(env, env_id), env_id, CHOOSING_SEEDS)
            values.append(float(np.mean([episode["return"] for episode in episodes])))
    return Choice(saved[int(np.argmax(values))], len(saved), by_hand)


def ship(choice: Choice, env_id: str, out: Path) -> dict[str, Any]:
    """Write the folder of one policy beneath `out`, for its own id, or for one of `STANDS_FOR` that takes
    its policy; return its score.json.

    Raises:
        DataFileError: the model does not fit.
        OutputError: the folder gets too large.
    """
    saved = choice.saved
    trained_on = own_id(choice.saved.record["env_id"])
    # A vector reward has no score: it plays the episodes of the id whose policy it shares
    played_on = trained_on if env_id in STANDS_FOR else env_id
    if not len(runs.read_episodes(saved.path.parent)):
        raise DataFileError(f"run {saved.path.parent}: expected a training in which episodes end, got none")
    record = saved.record | {"command": shown_command(saved.record.get("command", "")), "env_id": env_id}
    record.setdefault("finished", training_length(saved.path.parent))
    record.pop("args", None)  # paths of the machine that trained; the command says the rest
    with runs.make_env(trained_on) as env:
        trained = saved.load(env, trained_on)
    with runs.make_env(env_id) as env:
        metadata = about(env, env_id, {}, record)
    folder = out / env_id.rpartition("/")[2]
    with staged(folder) as stage:
        write_policy(trained, stage / FILE, metadata)
        policy = OnnxPolicy(stage / FILE)  # the shipped file is scored, not the model
        scores = [Score("policy", score_vector(policy, played_on, SCORE_SEEDS)), *gaits(played_on)]
        score = score_record(policy, scores, env_id, played_on) | {"runs": choice.among}
        if choice.by_hand:
            score["chosen"] = choice.by_hand
        if env_id != trained_on:
            record["trained_on"] = trained_on
        for name in COPIED:
            if saved.path.with_name(name).is_file():
                shutil.copyfile(saved.path.with_name(name), stage / name)
        (stage / runs.RECORD).write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
        text = json.dumps(score, indent=1, allow_nan=False)
        (stage / SCORE).write_text(text + "\n", encoding="utf-8")
        no_name = {"Software": None}  # the drawing program's name would change the file
        draw_learning_curve(saved.path.parent, scores, stage / "curve.png", dpi=90, metadata=no_name)
        shown = shared_film(stage, out / trained_on.rpartition("/")[2]) if env_id != played_on else ""
        if not shown:
            film(stage, env_id)
        config = (stage / runs.CONFIG).read_text(encoding="utf-8")
        has_weights = (stage / WEIGHTS).is_file()
        text = card(env_id, record, score, config, shown or FILM, has_weights)
        (stage / CARD).write_text(text, encoding="utf-8")
        size = sum(file.stat().st_size for file in stage.iterdir())
        if size > LIMIT:
            raise OutputError(f"{folder}: expected at most {LIMIT:,} bytes, got {size:,}")
    if shown:
        (folder / FILM).unlink(missing_ok=True)  # of an earlier policy
    if out == POLICIES:
        with staged(SHIPPED / folder.name) as stage:
            for name in filter(lambda name: (folder / name).is_file(), PACKAGED):
                os.replace(folder / name, stage / name)
    return score


def shared_film(folder: Path, other: Path) -> str:
    """Find a film of the same weights in another policy's folder, as a link from `folder`; "" for none."""
    beside = SHIPPED / other.name if other.parent == POLICIES else other
    both = folder / WEIGHTS, beside / WEIGHTS
    if not all(file.is_file() for file in (*both, other / FILM)):
        return ""
    return f"../{other.name}/{FILM}" if both[0].read_bytes() == both[1].read_bytes() else ""


def film(folder: Path, env_id: str) -> None:
    """Write the film of the policy in `folder`, shorter where it would be larger than `FILM_LIMIT`."""
    path = folder / FILM
    policy = str(folder / FILE)
    seconds = FILM_SECONDS
    while not path.is_file() or path.stat().st_size > FILM_LIMIT:
        render_episode(path, policy, env_id, seed=SCORE_SEEDS[0], seconds=seconds, fps=20, size=(640, 360))
        # The size is known only after the film is made
        seconds *= 0.75


@cache
def gaits(env_id: str) -> list[Score]:
    """Score the gaits that an id has, on the episodes of the score."""
    scores = []
    for name in GAITS:
        with suppress(ParameterError, DataFileError):  # it has no such gait
            scores.append(Score(name, score_vector(name, env_id, SCORE_SEEDS)))
    return scores


def score_record(policy: Any, scores: Sequence[Score], env_id: str, played_on: str) -> dict[str, Any]:
    """Return the content of score.json: means and intervals of all, and the returns of the first, the
    policy."""
    data = to_json(scores)["policies"]
    for of_policy in data.values():
        del of_policy["episodes"]
    returns = [episode["return"] for episode in scores[0].episodes]
    return {
        "env_id": env_id,
        "played_on": played_on,
        "seeds": [SCORE_SEEDS.start, SCORE_SEEDS.stop],
        "policies": data,
        "returns": [round(value, 4) for value in returns],
        "check": {"episodes": CHECKED, "tolerance": round(tolerance(policy, played_on, returns), 3)},
        "command": shown_command(runs.command()),
        "versions": runs.versions(),
    }


class NoisyPolicy:
    """Policy with actions that are off by a millionth: another machine's arithmetic, exaggerated."""

    def __init__(self, policy: Any) -> None:
        self._policy = policy
        self._generator = np.random.default_rng(0)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return the policy's actions with noise, and its state."""
        actions, state = self._policy.predict(observation, state, episode_start, deterministic)
        return actions + self._generator.uniform(-1e-6, 1e-6, actions.shape).astype(np.float32), state


def tolerance(policy: Any, env_id: str, returns: Sequence[float]) -> float:
    """Return the largest difference of the mean return of the first `CHECKED` episodes on another machine:
    four standard errors of what a `NoisyPolicy` changes, and 1 % of the mean."""
    # Arithmetic differs in its last bits between processors; chaos makes more of it
    again = score_vector(NoisyPolicy(policy), env_id, SCORE_SEEDS[:CHECKED])
    off = np.array([episode["return"] for episode in again]) - returns[: len(again)]
    return float(4 * np.sqrt(np.mean(off**2) / len(off)) + 0.01 * abs(np.mean(returns)))


def shown_command(command: str) -> str:
    """Return a command without --out and without folders of this machine."""
    words = shlex.split(command)
    # It may stand twice
    while "--out" in words:
        del words[words.index("--out") : words.index("--out") + 2]
    shown = [word.removeprefix(f"{Path.cwd()}/") for word in words]
    return shlex.join([Path(word).name if Path(word).is_absolute() else word for word in shown])


def write_index(folder: Path, scores: Path) -> None:
    """Write README.md into `folder`, the table of its policies, whose scores are beneath `scores`."""
    rows = []
    references = {
        "blind": "best without feedback",
        "constant": "best constant gait",
        "run": "run",
        "zero": "zero action",
    }
    for path in sorted(scores.glob(f"*/{SCORE}")):
        score = parse_json(path.read_text(encoding="utf-8"))
        algo = parse_json(path.with_name(runs.RECORD).read_text(encoding="utf-8"))["algo"]
        row = [f"`{score['env_id']}`", algo.upper()]
        for name in ("policy", *references):
            of_policy = score["policies"].get(name) or (name == "zero" and score["policies"].get("reference"))
            if of_policy:
                interval = Interval(of_policy["mean"]["return"], *of_policy["interval95"]["return"])
                row.append(interval.text(2))
            else:
                row.append("")
        rows.append([*row, f"[card]({path.parent.name}/card.md)"])
    text = (
        "# Trained policies\n\n"
        "One for each id, made by `python -m agents.ship`; docs/agents.md says how to use them.\n"
        "Mean returns in the same episodes, and the bootstrap's 95 % interval over the episodes of each"
        " policy.\n"
        "It says nothing about other trainings; each card says of how many its policy is the best.\n"
        "`HorseLegFixed-v0` has one deterministic episode.\n\n"
    )
    titles = ["id", "policy", "return", *references.values(), "card"]
    runs.write_text(folder / "README.md", text + markdown_table(titles, rows) + "\n")


def main(argv: list[str] | None = None) -> None:
    """Choose and ship the policy of each id."""
    args = parse(Args, argv, "python -m agents.ship", __doc__)
    models = find_runs(args.runs)
    sources = {env_id: env_id for env_id in models}
    # An id without a training of its own may be played by another's policy
    sources |= {
        env_id: trained_on
        for env_id, trained_on in STANDS_FOR.items()
        if env_id not in models and trained_on in models
    }
    ids = [check_choice("env_id", env_id, sources) for env_id in args.env_id] or list(sources)
    check_folder(args.out)
    needed = {sources[env_id] for env_id in ids}
    choices = {source: choose(models[source], source, args.chosen) for source in needed}
    for env_id in ids:
        score = ship(choices[sources[env_id]], env_id, args.out)
        means = {name: of_policy["mean"]["return"] for name, of_policy in score["policies"].items()}
        write_index(args.out, SHIPPED if args.out == POLICIES else args.out)
        print(f"{env_id}: " + ", ".join(f"{name} {value:.2f}" for name, value in means.items()), flush=True)
    if args.out == POLICIES:
        print(
            "next: python -m agents.results score shipped --env-id ID --runs RUNS, for each; then ... pages"
        )


if __name__ == "__main__":
    run(main)

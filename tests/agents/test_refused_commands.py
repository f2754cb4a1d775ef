"""Arguments and files that commands of agents refuse, by the words of each error: one table (`CASES`). A new
argument adds its rows here. What needs a stopped or killed training is in tests/agents/test_resume.py."""

from __future__ import annotations

import importlib.util
import os
import sys
from dataclasses import replace

import pytest
import torch

from agents import (
    dataset,
    distribute,
    judge,
    open_loop,
    train,
    tune,
)
from agents.cards import POLICIES
from agents.experiments import __main__ as experiments
from agents.experiments import plans as plan_files
from agents.experiments.outcomes import read_rows
from agents.settings import ALGORITHMS, algorithm_class, load_settings
from hoof_env.errors import DataFileError, HoofEnvError, MissingExtraError, OutputError, ParameterError
from hoof_env.evaluation import scores
from hoof_env.evaluation.episodes import score_vector
from tests.agents.conftest import ENV_ID, SHORT, TINY, train_tiny

GPU = torch.cuda.is_available()
CORES = os.cpu_count() or 1
AGENT = str(POLICIES / "HorseLeg-v0")
MINARI = importlib.util.find_spec("minari") is not None


def case(call, words, error=ParameterError, **files):
    """A row: files by name, a call with their folder, class and words of the error."""
    return files, call, error, words


def trains(words, error=ParameterError, **changes):
    return case(lambda folder: train_tiny(**{"out": folder / "runs" / "run", **changes}), words, error)


def trains_flat(words, **changes):
    args = {"algo": "ppo_flat", "steps": 256, **changes}
    return case(lambda folder: train.train(train.Args(out=folder / "run", **args)), words)


def evaluates(words, error=ParameterError, **changes):
    return case(lambda _: scores.evaluate(**{"policies": ("run",), **changes}), words, error)


def optimises(words, **changes):
    args = open_loop.Args(env_kwargs=SHORT, restarts=2, test_episodes=8)
    return case(lambda folder: open_loop.optimise(replace(args, out=folder / "gait.json", **changes)), words)


def plans(words, **changes):
    return case(lambda _: distribute.prepare(distribute.Trials(**changes)), words, HoofEnvError)


def tunes(words, error=ParameterError, space="", **changes):
    """A study; its search space is a file."""
    held = {"trials": 2, "steps": 256, "scores": 2, "env_kwargs": SHORT, "params": ("n_envs=4", *TINY)}

    def call(folder):
        given = {"space": folder / "space_yml", "params": ("n_envs=4", *TINY[:-1])} if space else {}
        tune.tune(tune.Args(**held | {"out": folder / "study"} | given | changes))

    return case(call, words, error, **({"space_yml": space} if space else {}))


def judges(words, *arguments, error=ParameterError):
    return case(lambda folder: judge.main([*arguments, "--out", str(folder)]), words, error)


def collects(words, *arguments):
    """A dataset; all arguments but the environment are checked where Minari is missing, too."""
    return case(lambda folder: dataset.main([*arguments, "--out", str(folder)]), words)


def reads_settings(content):
    """A file of hyperparameters, which is not there, or has some content."""
    files = {} if content is None else {"ppo.yml": content}
    return case(
        lambda folder: load_settings(folder / "ppo.yml", "Pendulum-v1"), r"ppo\.yml", DataFileError, **files
    )


CODE = ("dict(a=print(1))", "print(1)", "dict(a=nn.Nothing)", "[1]", "dict(a=", "dict(__import__('os'))")
CASES = [
    # train
    trains("Cow", env_id="hoof_env/Cow-v0"),
    trains("wheels", env_kwargs=("wheels=4",)),
    trains("flying", env_kwargs=("trunk=flying",)),
    trains("--env-kwargs: expected .*got 'trunk'", env_kwargs=("trunk",)),
    trains("JSON", env_kwargs=("{trunk: 1}",)),
    trains("horsepower", params=("horsepower=1",)),
    trains("learning_rate.*fast", DataFileError, params=("learning_rate=fast",)),
    trains("steps: expected .*got 0", steps=0),
    trains("n_envs: expected .*got 0", n_envs=0),
    trains("seed: expected .*got -1", seed=-1),
    trains("max_minutes: expected .*got 0.0", max_minutes=0.0),
    trains("checkpoint_every: expected .*got -1", checkpoint_every=-1),
    trains("expected .*reward, got a vector", env_id="hoof_env/HorseLegMO-v0"),
    trains("torch_threads: expected .*got 0", torch_threads=0),
    trains(f"torch_threads: expected .*got {CORES + 1}", torch_threads=CORES + 1),
    trains("device .*abacus", device="abacus"),
    *([] if GPU else [trains("device: expected .*torch finds here, got 'cuda'", device="cuda")]),
    trains(
        "n_epochs: expected .*1 .*got 0", DataFileError, params=(*TINY, "n_epochs=0")
    ),
    trains(
        "batch_size: expected .*got 2.5", DataFileError, params=(*TINY, "batch_size=2.5")
    ),
    trains("normalize: expected .*'foo'", DataFileError, params=(*TINY, 'normalize={"foo": 1}')),
    trains(
        "normalize: expected true, false .*got 7",
        DataFileError,
        params=(*TINY, "normalize=7"),
    ),
    trains("normalize", DataFileError, params=(*TINY, 'normalize={"clip_obs": "x"}')),
    trains("--out", resume=True, out=None),
    case(lambda folder: train_tiny(folder / "file" / "run"), "cannot write to .*file", OutputError, file=""),
    *(
        case(train_tiny, rf"found {name} .*run\.json", OutputError, **{name: "mine"})
        for name in ("config.yml", "monitor.csv")
    ),
    case(
        lambda folder: train_tiny(folder, resume=True),
        r"found checkpoints .*run\.json; choose another folder$",
        OutputError,
        **{"checkpoints/100/file": ""},
    ),
    trains_flat("expected nn.Tanh", params=('policy_kwargs={"activation_fn": "nn.ReLU"}',)),
    trains_flat("use_sde", params=("normalize=true", "use_sde=true")),
    trains_flat("batch_size: expected 2 .*got 1", params=("batch_size=1",)),
    trains_flat("norm_reward: expected False", params=("normalize=true", "norm_reward=true")),
    trains_flat("policy_kwargs: expected some of", params=('policy_kwargs={"squash_output": true}',)),
    *([] if GPU else [trains_flat("device: expected .*got 'cuda'", device="cuda")]),
    trains_flat("Discrete", env_id="CartPole-v1"),
    # evaluate and score
    evaluates("policy: expected a name .*got none", policies=()),
    evaluates("episodes: expected .*got 0", episodes=0),
    evaluates("seed: expected .*got -1", seed=-1),
    evaluates("Cow", env_id="hoof_env/Cow-v0"),
    *(
        case(lambda _, policy=policy: score_vector(policy, ENV_ID, [7]), f"policy: expected .*{given}")
        for policy, given in ((0.5, "got 0.5"), (None, "got None"), ("gallop", "got 'gallop'"))
    ),
    # open loop
    optimises("restarts: expected .*got 0", restarts=0),
    optimises("episodes: expected .*got 10", episodes=10),
    optimises("test_episodes: expected .*got 1", test_episodes=1),
    optimises("Cow", env_id="hoof_env/Cow-v0"),
    optimises("many .*got 'Pendulum-v1'", env_id="Pendulum-v1", env_kwargs=()),
    optimises("expected 'phase' .*horse, got 'constant'", env_id="hoof_env/Horse-v0", family="constant"),
    optimises("'gait' among the observed groups", env_kwargs=('observation=["crank"]',)),
    # experiments
    *(
        case(lambda _, wrong=wrong: experiments.train_planned(experiments.Args("stock", **wrong)), words)
        for wrong, words in (
            ({"only": ("gallop",)}, r"only: expected a part of .*ppo-HorseLeg-v0, .*got \('gallop',\)"),
            ({"seeds": 0}, "seeds: expected .* got 0"),
            ({"steps": -1}, "steps: expected .* got -1"),
            ({"workers": 0}, "workers: expected .* got 0"),
        )
    ),
    case(
        lambda folder: experiments.write_page(experiments.Args("stock", out=folder)),
        r"curves.csv: expected columns env_id, algo",
        DataFileError,
        **{"curves.csv": "env_id,algo\nx,ppo\n"},
    ),
    case(
        lambda folder: experiments.write_page(experiments.Args("stock", out=folder)),
        r"curves.csv: expected learning curves, found none",
        DataFileError,
    ),
    case(lambda folder: read_rows([], folder), "found none", DataFileError),
    *(
        case(
            lambda _: plan_files.load_plan("full"),
            r"full\.yml: expected a list of entries",
            DataFileError,
            **{"full.yml": text},
        )
        for text in ("- {algo: ppo}", "3", "- {")
    ),
]  # fmt: skip
"""Files, call with their folder, class and words of the error."""


def content_of(folder):
    """All files and folders, with their bytes."""
    return {path: path.is_dir() or path.read_bytes() for path in folder.rglob("*")}


@pytest.mark.parametrize(
    ("files", "call", "error", "words"), CASES, ids=[f"{k} {row[3]}" for k, row in enumerate(CASES)]
)
def test_commands(files, call, error, words, tmp_path, monkeypatch):
    """Nothing is played, and the folder is left as it was."""
    for module, name in ((scores, "play"), (dataset, "_collect")):
        monkeypatch.setattr(module, name, lambda *_, **__: pytest.fail("was played"))
    if "full.yml" in files:
        monkeypatch.setattr(plan_files, "PLANS", tmp_path)
    if "check_threads" in call.__code__.co_names:
        monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {3, 5}, raising=False)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    before = content_of(tmp_path)
    with pytest.raises(error, match=words):
        call(tmp_path)
    assert content_of(tmp_path) == before


def without_ray(call):
    return "ray", call, r"pip install 'hoof-env\[distribute\]'"


MISSING = [
    (
        "cma",
        lambda folder: open_loop.optimise(open_loop.Args(env_kwargs=SHORT, out=folder / "gait.json")),
        r'needs cma: pip install "hoof-env\[train,identify\]"',
    ),
    (
        "minari",
        lambda folder: dataset.main(["run", "--out", str(folder)]),
        r'pip install "hoof-env\[minari\]"',
    ),
    without_ray(lambda _: distribute.start(distribute.Trials())),
    without_ray(lambda _: distribute.main(["--seeds", "2", "--steps", "99"])),
]
"""Package, call with a folder, words."""


@pytest.mark.parametrize(("package", "call", "words"), MISSING)
def test_missing_packages(package, call, words, tmp_path, monkeypatch):
    """Named with the extra that has them."""
    monkeypatch.setitem(sys.modules, package, None)
    if package == "ray":
        monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises((HoofEnvError, MissingExtraError), match=words):
        call(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_missing_library_of_an_algorithm(monkeypatch):
    monkeypatch.setitem(ALGORITHMS, "tqc", "sb3_contrib_of_tomorrow")
    with pytest.raises(ParameterError, match=r"pip install 'hoof-env\[train\]'"):
        algorithm_class("tqc")

"""Episodes of policies as a Minari dataset, to learn from offline.

    python -m agents.dataset --level medium             also random, simple, expert, mixed (agents/levels.py)
    python -m agents.dataset run walk random --episodes 100 --dataset-id hoof_env/HorseLeg/scripted-v0
    python -m agents.dataset agents/policies/Horse-v0 --env-id hoof_env/Horse-v0

A policy is what `hoof-env evaluate` takes. Episode k of each is reset with seed + k and the options that its
policy starts with, so that resetting `dataset.recover_environment()` likewise and taking the same actions
gives the same numbers. Next to Minari's files lies manifest.json with the command, the versions, the licence,
the returns of each policy and how its episodes start, and the SHA-256 of every file and of the files of
trained policies. A dataset is written in a folder of its own and moved when it is whole.

Minari's metadata record the form of the actions, the names and scales of what is observed, and the settings:
`load` and `check_fit` refuse a dataset of another form, other names or other scales, which may have the same
shapes, and warn of other settings.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
import tomllib
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from tyro.conf import Positional

import hoof_env
from agents import runs
from agents.command import parse, parse_pairs, run
from agents.levels import SCORES, Level, Levels, Partly
from hoof_env.envs.policies import start_of
from hoof_env.errors import (
    DataFileError,
    MissingExtraError,
    OutputError,
    ParameterError,
    bounded,
    count,
)
from hoof_env.gait import GaitParameters
from hoof_env.policies.actor import Actor
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.policies.find import find_policy, find_saved, is_model, shipped_ids
from hoof_env.policies.record import SCALES, describe, misfits, other_settings, own_id, settings_of
from hoof_env.policies.saved import ABOUT, STATISTICS, WEIGHTS

MANIFEST = "manifest.json"
PROJECT = Path(__file__).parents[1] / "pyproject.toml"  # file of the checkout, which need not be installed
ID = re.compile(r"(?:[-\w][-\w/]*[-\w]/)?[-\w]+-v\d+")  # Minari's form of an id, but always with a version
ROOT = "MINARI_DATASETS_PATH"  # variable with Minari's folder of datasets
ACTIONS = "actions"  # the key of what actions are
OBSERVED = ("observation_names", SCALES)  # keys of what observations are


@dataclass
class Args:
    """Arguments of the command."""

    policies: Positional[tuple[str, ...]] = ()
    """policies to play, one after the other"""
    level: Level | None = None
    """policies of this level in place of named ones"""
    env_id: str = "hoof_env/HorseLeg-v0"
    """the environment"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object"""
    episodes: int = 100
    """of each policy"""
    seed: int = 0
    """of the first episode"""
    dataset_id: str = ""
    """NAMESPACE/NAME-vK; otherwise hoof_env/ID/POLICIES-v0"""
    author: str = ""
    """for Minari's description; otherwise the authors in pyproject.toml"""
    author_email: str = ""
    """likewise; empty for none"""
    code_permalink: str = ""
    """likewise, address of the code that made it; otherwise the repository in pyproject.toml, if any"""
    out: Path = Path("runs/datasets")
    """folder of datasets, as Minari's MINARI_DATASETS_PATH"""


def main(argv: list[str] | None = None) -> None:
    """Write a dataset."""
    args = parse(Args, argv, "python -m agents.dataset", __doc__)
    print(f"written: {write(args)}")


def write(args: Args) -> Path:
    """Write the dataset that the arguments ask for and return its folder.

    Raises:
        OutputError: there is a dataset already.
        ParameterError: a policy, an id or a number does not fit.
        MissingExtraError: Minari is not installed.
    """
    # All arguments are checked before Minari makes a folder
    _check_policies(args.policies, args.level)
    episodes = count("episodes", args.episodes)
    if args.level == "mixed" and episodes % len(SCORES):
        raise ParameterError(
            f"episodes: expected a multiple of {len(SCORES)}, the parts of a mixed level, got {episodes}"
        )
    named = [args.level] if args.level else args.policies
    dataset_id = check_id(args.dataset_id or default_id(args.env_id, named))
    folder = args.out / dataset_id
    if folder.exists():
        raise OutputError(f"{folder}: expected no dataset there; choose another --dataset-id or --out")
    try:
        import h5py  # noqa: F401  # with which Minari writes
        import minari
        import minari.data_collector  # which asks for more than reading does
    except ImportError:
        raise MissingExtraError('agents.dataset needs Minari: pip install "hoof-env[minari]"') from None
    args.out.mkdir(parents=True, exist_ok=True)
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    # Minari finds its folder by the environment alone
    before = os.environ.get(ROOT)
    with tempfile.TemporaryDirectory(dir=args.out, prefix=".making-") as making:
        os.environ[ROOT] = making
        try:
            with runs.make_env(args.env_id, **kwargs) as env:
                returns = _collect(minari, env, args, episodes, dataset_id)
        finally:
            os.environ.pop(ROOT)
            if before is not None:
                os.environ[ROOT] = before
        finished = Path(making, dataset_id)
        _write_manifest(finished, args, returns)
        folder.parent.mkdir(parents=True, exist_ok=True)
        finished.rename(folder)
    return folder


def load(dataset_id: str) -> Any:
    """Load a dataset as `minari.load_dataset` does.

    Raises:
        DataFileError: its environment is not registered here, or takes actions of another form today, or
            shows other entries or scales.
        MissingExtraError: Minari is not installed.
    """
    try:
        import minari
    except ImportError:
        raise MissingExtraError('agents.dataset needs Minari: pip install "hoof-env[minari]"') from None
    dataset = minari.load_dataset(dataset_id)
    # Before `recover_environment`, which imports what the dataset names
    check_environment(dataset)
    with dataset.recover_environment() as env:
        check_fit(dataset, env)
    return dataset


def check_environment(dataset: Any) -> None:
    """Refuse a dataset if its environment is not a registered one as it is registered: `DataFileError`.
    Otherwise the name of code in the dataset would be imported."""
    spec = dataset.spec.env_spec
    known = gym.registry.get(spec.id)
    task = str(spec.kwargs.get("task", ""))
    registered = known.kwargs.get("task") if known else None
    # The id alone proves nothing: an entry point or a wrapper in the dataset may be any code
    is_registered = (
        known is not None and spec.entry_point == known.entry_point and not spec.additional_wrappers
    )
    if not is_registered or (":" in task and task != registered):
        raise DataFileError(
            f"dataset {dataset.spec.dataset_id}: expected the id of an environment that is registered here, "
            f"got {spec.id!r} at {spec.entry_point!r}; a dataset must not import a module: import yours first"
        )


def check_fit(dataset: Any, env: Any) -> None:
    """Refuse a dataset, to read it or to add to it, if its actions are not of the form that the environment
    takes, or its observations have other names or scales: `DataFileError`. Warn of other settings, as they
    were recorded; an older dataset has its actions' form only."""
    here, there = describe(env), dataset.storage.metadata
    unlike = misfits(there, {key: here[key] for key in OBSERVED if key in here})
    if there.get(ACTIONS) != here.get(ACTIONS):
        unlike.append(f"{ACTIONS} {there.get(ACTIONS)}, expected {here.get(ACTIONS)}")
    name = dataset.spec.dataset_id
    if unlike:
        raise DataFileError(f"dataset {name}: made with {'; '.join(unlike)}; make it again by agents.dataset")
    if "settings" in there and (other := other_settings(there, env)):
        warnings.warn(bounded(f"dataset {name}: made with {'; '.join(other)}"), stacklevel=2)


def _check_policies(policies: Sequence[str], level: str | None) -> None:
    """Check that there is a policy or a level, and none twice."""
    if level and policies:
        raise ParameterError(
            f"policies: expected none together with a level, got {', '.join(policies)} and {level}"
        )
    if not policies and not level:
        raise ParameterError("policies: expected at least one, or a --level, got none")
    for name, times in Counter(policies).items():
        if times > 1:
            raise ParameterError(f"policies: expected each one once, got {name} {times} times")


def check_id(dataset_id: str) -> str:
    """Return the id; `ParameterError` if Minari does not take it, before anything is played."""
    if not ID.fullmatch(dataset_id):
        raise ParameterError(
            "dataset_id: expected NAMESPACE/NAME-vK of letters, digits, _ and -, the namespace of two or "
            f"more, got {dataset_id!r}"
        )
    return dataset_id


def default_id(env_id: str, policies: Sequence[str]) -> str:
    """Return an id for policies on an environment; characters that an id cannot hold, as the points of
    numbers, become _."""
    short = env_id.rpartition("/")[2].removesuffix("-v0")
    names = [Path(name).stem if Path(name).exists() else name for name in policies]
    plain = [re.sub(r"[^\w-]+", "_", part) for part in (short, "-".join(names))]
    return f"hoof_env/{plain[0]}/{plain[1]}-v0"


def policy_files(name: str, env_id: str) -> list[Path]:
    """Return the files of a trained policy or a gait, none for a scripted policy; "shipped" is the
    policy that ships for `env_id`."""
    if name == "shipped" or name in shipped_ids():
        path = SHIPPED / own_id(env_id if name == "shipped" else name).rpartition("/")[2]
    else:
        path = Path(name)
    if name.endswith(".json"):
        return [path]
    if not (is_model(str(path)) or path.is_dir()):
        return []
    model = find_saved(path).path
    neighbours = () if model.suffix == ".onnx" else (ABOUT, WEIGHTS, STATISTICS)
    files = [model, *(model.with_name(neighbour) for neighbour in neighbours)]
    return [file for file in files if file.is_file()]


def plain_start(policy: Any) -> dict[str, Any]:
    """Return the reset options that episodes of a policy begin with, as data that files can hold."""
    start = start_of(policy)
    return {
        key: asdict(value) if isinstance(value, GaitParameters) else value for key, value in start.items()
    }


def _collect(minari: Any, env: Any, args: Args, episodes: int, dataset_id: str) -> dict[str, Any]:
    """Play all episodes, have Minari write them, and return the figures of each policy for the manifest."""
    from tqdm import tqdm

    levels = Levels(env, args.env_id, parse_pairs("--env-kwargs", args.env_kwargs)) if args.level else None
    policies = _policies(env, args, levels)
    # A level has as many episodes as one policy: its parts share them.
    each = episodes // len(policies) if levels else episodes
    files = {
        name: {file.name: _sha256(file) for file in policy_files(name, args.env_id)} for name in args.policies
    }
    collector = minari.DataCollector(env)
    returns = {}
    seed = args.seed
    with tqdm(total=len(policies) * each, unit=" episodes", leave=False, disable=None) as bar:
        for name, policy in policies.items():
            totals = []
            actor = Actor(policy, env)
            options = plain_start(policy)
            # One environment for all episodes, so that a seed alone decides how an episode goes
            for k in range(each):
                observation, _ = collector.reset(seed=seed + k, options=options)
                actor.begin()
                total = 0.0
                ended = False
                while not ended:
                    observation, reward, terminated, truncated, _ = collector.step(actor.act(observation))
                    total += float(np.asarray(reward).sum())
                    ended = terminated or truncated
                totals.append(total)
                bar.update()
            returns[name] = {
                "episodes": each,
                "first_seed": seed,
                "mean_return": float(np.mean(totals)),
                "sd_return": float(np.std(totals)),
                **({"normalised_score": levels.scale.score(float(np.mean(totals)))} if levels else {}),
                **({"random_share": policy.share} if isinstance(policy, Partly) else {}),
                **({"start": options} if options else {}),
                **({"sha256": files[name]} if files.get(name) else {}),
            }
            # Parts of a level have starts of their own
            seed += each if levels else 0
    dataset = collector.create_dataset(
        dataset_id,
        algorithm_name=", ".join(
            f"shipped, {value['random_share']:.3f} random" if "random_share" in value else name
            for name, value in returns.items()
        ),
        description=f"{each} episodes of each of {', '.join(returns)} on {args.env_id}",
        requirements=[f"hoof-env=={hoof_env.__version__}"],
        **_described(args),
    )
    here = describe(env)
    metadata: dict[str, Any] = {key: here[key] for key in (ACTIONS, *OBSERVED) if key in here}
    metadata["settings"] = settings_of(env)
    if levels:
        # Minari's names for the ends of the normalised score
        metadata |= {"ref_min_score": levels.scale.random, "ref_max_score": levels.scale.shipped}
    dataset.storage.update_metadata(metadata)
    return returns


def _policies(env: Any, args: Args, levels: Levels | None) -> dict[str, Any]:
    """Return the policies that the arguments ask for, by name."""
    if levels and args.level:
        return levels.policies(args.level)
    return {name: find_policy(name, env, args.env_id) for name in args.policies}


def _described(args: Args) -> dict[str, str]:
    """Return Minari's descriptive fields that are known."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    authors = project.get("authors", [])
    known = {
        "author": args.author or ", ".join(author["name"] for author in authors if "name" in author),
        "author_email": args.author_email
        or ", ".join(author["email"] for author in authors if "email" in author),
        "code_permalink": args.code_permalink or project.get("urls", {}).get("Repository", ""),
    }
    return {name: value for name, value in known.items() if value}


def _write_manifest(folder: Path, args: Args, returns: dict[str, Any]) -> None:
    """Write the manifest of a dataset, with the digests of all its files."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    about = {
        "env_id": args.env_id,
        "env_kwargs": parse_pairs("--env-kwargs", args.env_kwargs),
        "policies": returns,
        "licence": tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["license"],
        "command": runs.command(),
        "versions": runs.versions(),
        "sha256": {file.relative_to(folder).as_posix(): _sha256(file) for file in files},
    }
    runs.write_text(folder / MANIFEST, json.dumps(about, indent=1) + "\n")


def _sha256(file: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


if __name__ == "__main__":
    run(main)

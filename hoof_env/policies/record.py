"""Record of a saved policy: for which environment it was trained, and whether it fits the one at hand.

A record is the content of run.json in a run folder, or the metadata of an .onnx file. The other
modules of this package find and play the policies themselves.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import MISSING, asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym

from hoof_env._input import as_path, read_text
from hoof_env._version import __version__
from hoof_env.errors import DataFileError, bounded, brief, parse_json

RECORD = {
    "env_kwargs": dict,
    "observation_names": list,
    "observation_scales": dict,
    "settings": dict,
    "args": dict,
    "versions": dict,
    "finished": dict,
    "resumed": list,
}
"""Types of the optional entries of run.json that are checked; env_id and algo are required."""


def describe_spaces(env: Any) -> dict[str, Any]:
    """Return both spaces of an environment or a model as text, to be saved with a policy and compared."""
    return {"observation_space": str(env.observation_space), "action_space": str(env.action_space)}


SCALES = "observation_scales"
"""Entry of a record with the formulas of the scales of what a policy sees, by name."""

SHOWN = 4
"""Number of scales that a message names."""


def describe(env: Any) -> dict[str, Any]:
    """Return the spaces of an environment, names and scales of its observations, names of its actions, and
    their form; entries that the environment lacks are left out."""
    description = describe_spaces(env)
    for key in ("observation_names", "action_names"):
        if names := getattr(env.unwrapped, key, None):
            description[key] = list(names)
    if scales := getattr(env.unwrapped, SCALES, None):
        description[SCALES] = dict(scales)
    return description | describe_actions(env)


def describe_actions(env: Any) -> dict[str, str]:
    """Return the form of the actions of an environment of this package, to be saved with a policy; empty for
    another package's environment."""
    form = getattr(env.unwrapped, "action_form", None)
    return {"actions": form} if form else {}


def describe_env(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """Return the entries of run.json about an environment: those of `describe` and all settings."""
    settings = settings_of(env)
    return describe(env) | ({"settings": settings} if settings else {})


def settings_of(env: Any) -> dict[str, Any]:
    """Return all settings of an environment of this package with the types that JSON has; empty for another
    package's environment."""
    settings = getattr(env.unwrapped, "settings", None)
    if not is_dataclass(settings) or isinstance(settings, type):
        return {}
    # Through JSON and back, because they are compared with what was read from a file: tuples become lists.
    plain: dict[str, Any] = json.loads(json.dumps(asdict(settings), default=str))
    return plain


def default_settings_of(env: Any) -> dict[str, Any]:
    """Return the defaults of the settings of an environment of this package that have one, as `settings_of`
    has them."""
    defaults = {each.name: each.default for each in fields(env.unwrapped.settings)}
    found = {name: value for name, value in defaults.items() if value is not MISSING}
    plain: dict[str, Any] = json.loads(json.dumps(found, default=str))
    return plain


def about(env: Any, env_id: str, env_kwargs: dict[str, Any], record: dict[str, Any]) -> dict[str, Any]:
    """Return the metadata of a policy for an environment; `record` is the run.json of its training, or
    empty."""
    known = {key: str(record[key]) for key in ("algo", "seed") if key in record}
    settings = record.get("settings") or settings_of(env)
    made_with = record.get("versions", {}).get("hoof-env", __version__)
    environment = {"env_id": env_id, "env_kwargs": env_kwargs, "settings": settings, "hoof_env": made_with}
    here = describe(env)
    # A policy may be older than the entry, and of other scales than today's
    if record and SCALES not in record:
        here.pop(SCALES, None)
    return environment | here | known


def environment_of(
    path: Path | str, record: dict[str, Any], env_id: str | None = None
) -> tuple[str | None, dict[str, Any]]:
    """Return the id of the environment for a saved policy, and the arguments for it from the policy's record.

    A file cannot cause an import: its id is looked up among the registered ones, without the module in front.

    Args:
        path: the policy's file, for error messages.
        record: record of the policy.
        env_id: the user's choice; None takes the record's id.

    Returns:
        The id, None if neither `env_id` nor the record has one; and the arguments, empty if the record is for
        another environment than `env_id`.

    Raises:
        DataFileError: the record's id is not registered, or one of its arguments needs an import.
    """
    trained_id = record.get("env_id")
    if trained_id is None or (env_id is not None and not same_id(env_id, trained_id)):
        return env_id, {}  # arguments of another environment would not fit
    kwargs: dict[str, Any] = record.get("env_kwargs", {})
    if not isinstance(kwargs, dict):
        raise DataFileError(f"{path}: env_kwargs: expected arguments by name, got {brief(kwargs)}")
    # Ids that the file alone asks for. An `env_id` of the user is trusted and may import its module.
    asks = {"env_id": trained_id} if env_id is None else {}
    asks |= {"task": kwargs["task"]} if ":" in str(kwargs.get("task", "")) else {}
    for name, asked in asks.items():
        if own_id(asked) not in gym.registry:
            module = "" if ":" in asked else "MODULE:"
            option = (
                f"--env-id {module}{asked}" if name == "env_id" else "--env-id, with the task as its argument"
            )
            raise DataFileError(
                f"{path}: expected the id of an environment that is registered here, got {name} {asked!r}; a"
                f" file must not import a module. If you trust it, name it yourself: {option}"
            )
    if "task" in asks:
        kwargs = kwargs | {"task": registered_task(asks["task"])}
    return (own_id(trained_id) if env_id is None else env_id), kwargs


def own_id(env_id: Any) -> str:
    """Return an id "module:id" without the module, which `gymnasium.make` would import."""
    return str(env_id).rpartition(":")[2]


def same_id(one: Any, other: Any) -> bool:
    """Return True if two ids name one environment; the module in front of an id does not count."""
    return own_id(one) == own_id(other)


def registered_task(task: str) -> str:
    """Return the name under which `registry.task_of` finds a registered task without importing its module."""
    return str(gym.registry[own_id(task)].kwargs.get("task", own_id(task)))


def refuse_misfit(path: Path, there: dict[str, Any], here: dict[str, Any]) -> None:
    """Raise `DataFileError` if a policy was trained for another environment.

    Args:
        path: the policy's file, for error messages.
        there: description of the environment in which it was trained; entries that it lacks are not compared.
        here: description of the environment in which it is to play, as `describe` returns it.
    """
    if unlike := misfits(there, here):
        name_there, _, version_there = str(there.get("env_id")).rpartition("-v")
        name_here, _, version_here = str(here.get("env_id")).rpartition("-v")
        if name_there == name_here != "" and version_there != version_here:
            unlike.append("another version of an id is another task")
        if "env_id" not in there:
            unlike.append("the file names no id; give the one of its training")
        advice = ""
        if any(words.startswith(SCALES) for words in unlike):
            commit = there.get("versions", {}).get("commit")
            code = f"commit {commit}" if commit else "the commit"
            advice = f". Train it again, or check out {code} of its training"
        raise DataFileError(f"policy {path}: trained for {'; '.join(unlike)}{advice}")


def misfits(there: dict[str, Any], here: dict[str, Any]) -> list[str]:
    """Return in words how descriptions of two environments differ, as far as both have an entry; see
    `refuse_misfit`."""
    unlike = []
    for key, expected in here.items():
        trained = there.get(key, expected)
        if trained != expected and not (key == "env_id" and same_id(trained, expected)):
            unlike += _differences(key, trained, expected)
        # What follows from another environment is not told
        if key == "env_id" and unlike:
            break
    return unlike


def _differences(key: str, trained: Any, expected: Any) -> list[str]:
    """Write how an entry differs: of names those that are more or fewer, of scales those of the same name."""
    if isinstance(trained, dict) and isinstance(expected, dict):
        other = [name for name in expected if trained.get(name, expected[name]) != expected[name]]
        words = [f"{name}: {brief(trained[name])}, expected {expected[name]!r}" for name in other[:SHOWN]]
        words += [f"{len(other) - SHOWN} more"] if len(other) > SHOWN else []
        return [f"{key}, {'; '.join(words)}"] if words else []
    if not (isinstance(trained, list) and isinstance(expected, list)):
        return [f"{key} {trained}, expected {expected}"]
    more = [str(name) for name in trained if name not in expected]
    fewer = [str(name) for name in expected if name not in trained]
    words = [f"{word} {', '.join(names)}" for word, names in (("with", more), ("without", fewer)) if names]
    how = " and ".join(words) or "in another order"
    return [f"{key} {how}, expected {len(expected)} of this environment"]


def check_record(path: Path, record: dict[str, Any], env: Any, env_id: str) -> None:
    """Raise `DataFileError` if the record of a policy does not fit an environment; warn if the policy was
    trained with other settings or another version of hoof-env.

    Args:
        path: the policy's file, for messages.
        record: record of the policy.
        env: the environment in which it is to play.
        env_id: the id of `env`.
    """
    refuse_misfit(path, record, {"env_id": env_id, **describe(env)})
    unlike = other_settings(record, env)
    made_with = record.get("hoof_env", record.get("versions", {}).get("hoof-env", __version__))
    if made_with != __version__:
        unlike.append(f"hoof-env {made_with}, here {__version__}")
    if unlike:
        warnings.warn(bounded(f"policy {path}: trained with {'; '.join(unlike)}"), stacklevel=3)


def other_settings(record: dict[str, Any], env: Any) -> list[str]:
    """Return in words which settings of a record an environment has not, its control step among them."""
    here = settings_of(env)
    # A record without settings has the arguments only; the settings that they do not set count as equal. One
    # that its settings lack is newer than the policy, which was trained as the default has it.
    there = record.get("settings", here | record.get("env_kwargs", {}))
    there = default_settings_of(env) | there if here else there
    # Environments of other packages have no settings to compare.
    names = sorted({*here, *record.get("settings", {})}) if here else []
    return [
        f"{key}={brief(there.get(key))}, here {brief(here.get(key))}"
        for key in names
        if there.get(key) != here.get(key)
    ]


def read_record(folder: Path | str) -> dict[str, Any]:
    """Return the content of run.json in `folder`, empty if the file is missing; raise `DataFileError` if it
    cannot be read."""
    folder = as_path("folder", folder)
    path = folder / "run.json"
    if not path.is_file():
        return {}
    try:
        record: dict[str, Any] = parse_json(read_text(path))
        kinds = {"env_id": str, "algo": str} | {key: kind for key, kind in RECORD.items() if key in record}
        if unlike := [key for key, kind in kinds.items() if not isinstance(record[key], kind)]:
            raise TypeError(f"{unlike[0]}: {record[unlike[0]]!r}")
        if "finished" in record:
            steps = record["finished"]["steps"]
            seconds = record["finished"]["seconds"]
            record["finished"] |= {"steps": int(steps), "seconds": float(seconds)}
        return record
    except (OSError, ValueError, TypeError, KeyError, OverflowError) as error:
        raise DataFileError(
            f"{path}: expected the JSON object of agents.train with env_id and algo: {error!r}"
        ) from None

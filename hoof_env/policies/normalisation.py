"""Statistics of observations beside a model of Stable-Baselines3, in the layouts of those who write them:
agents.train, rl_zoo3, `CheckpointCallback` and the hub."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, bounded

STATISTICS = "vecnormalize.pkl"
NAMES = (STATISTICS, "vec_normalize.pkl")
"""Names of a file of statistics: the first from rl_zoo3 and agents.train, the second from huggingface_sb3."""

MISSING = (
    "trained under VecNormalize, whose statistics are missing: unless only rewards were normalised, its"
    " actions here mean nothing"
)
"""What is wrong with a model without its statistics."""


def own_places(model: Path) -> list[Path]:
    """Return the places of statistics that belong to one model file alone."""
    folder, stem = model.parent, model.stem
    # rl_zoo3 has a folder for each model.
    places = [folder / stem / name for name in NAMES]
    places += [folder / f"{stem}_{name}" for name in NAMES]
    if match := re.fullmatch(r"(.*)_(\d+)_steps", stem):
        places.insert(0, folder / f"{match[1]}_vecnormalize_{match[2]}_steps.pkl")
    # agents.train has a folder for each run.
    if model.name == "model.zip":
        places += [folder / name for name in NAMES]
    return places


def shared_places(model: Path) -> list[Path]:
    """Return the places of statistics that several models of a folder may share."""
    folder = model.parent
    return [*(folder / name for name in NAMES), *sorted(folder.glob(f"*/{STATISTICS}"))]


def find_statistics(model: Path) -> Path | None:
    """Return the statistics of a model file, None if there are none, or if several may be meant."""
    own = [place for place in own_places(model) if place.is_file()]
    shared = [place for place in shared_places(model) if place.is_file()]
    is_clear = len(shared) == 1 or (shared and shared[0].parent == model.parent)
    return own[0] if own else shared[0] if is_clear else None


def has_missing_statistics(model: Any) -> bool:
    """Return True if a model of Stable-Baselines3 was trained under `VecNormalize` and has none."""
    # It keeps the last observations before normalisation, which are None without it.
    raw = getattr(model, "_last_original_obs", None)
    return raw is not None and model.get_vec_normalize_env() is None


def normaliser_of(model: Any, path: Path, env: Any) -> Callable[[Any], Any] | None:
    """Return the function that normalises observations of a model that was read from a .zip, None where they
    are taken as they are; warn where statistics are missing, or lie beside a model that has none. Reading
    statistics runs code that they hold.

    Args:
        model: model of Stable-Baselines3.
        path: its file.
        env: environment in which it plays.

    Raises:
        DataFileError: the statistics cannot be read, or are of other observations.
    """
    file = find_statistics(path)
    lacks = has_missing_statistics(model)
    is_trained = model.num_timesteps > 0
    if not lacks and is_trained and file in shared_places(path) and file not in own_places(path):
        _warn(path, f"played without {file}, for its training normalised nothing")
        return None
    if file is not None:
        return _read(file, model, env)
    if lacks:
        found = ", ".join(str(place) for place in shared_places(path) if place.is_file()) or "none"
        _warn(
            path,
            f"{MISSING}; expected {path.with_name(STATISTICS)}, found {found}",
        )
    return None


def _warn(path: Path, words: str) -> None:
    """Warn of a policy, with the place where it is loaded."""
    warnings.warn(bounded(f"policy {path}: {words}"), stacklevel=5)


def _read(file: Path, model: Any, env: Any) -> Callable[[Any], Any] | None:
    """Return the function of `normaliser_of` from a file of statistics."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    warnings.warn(f"{file} is a pickle, which can run any code: trusted?", stacklevel=5)
    try:
        statistics: Any = VecNormalize.load(str(file), DummyVecEnv([lambda: env]))
        if not statistics.norm_obs:
            return None
        shape = statistics.obs_rms.mean.shape
        if shape != model.observation_space.shape:
            raise ValueError(f"they are of observations of shape {shape}")
    # Damaged files raise exceptions of any type.
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise DataFileError(
            f"statistics {file}: expected statistics of VecNormalize for the model beside them ({reason})"
        ) from None
    normalise: Callable[[Any], Any] = statistics.normalize_obs
    return normalise

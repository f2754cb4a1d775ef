"""Episodes of any policy, one after the other or as rows of the native vector environment.

A row is the episode that `play` gives with the same seed, to the bit where the policy acts in a batch as
alone: scripted policies do, but for "random", which draws for all rows at once; a network does to its last
bits. The loading rate of an episode, after its first seconds, is the steepest rise of the force at impact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents import runs
from hoof_env import records
from hoof_env.envs.policies import open_loop_record
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import ParameterError
from hoof_env.saved_policy import find_saved

Floats = NDArray[np.float64]

ROWS = 1024  # episodes side by side at most; more are played one batch after the other

CURVE_SEEDS = range(1000, 1020)
"""Episodes of the learning curves; training starts its own from other seeds."""

FINAL_SEEDS = range(1_000_000, 1_000_100)
"""Episodes of the final scores, on which nothing else is played: no training, curve, tuning or search."""

FIGURES = (
    "return", "speed_m_s", "peak_grf_n", "stance_peak_n", "cost_of_transport", "weight_share", "failed",
)  # fmt: skip
"""Figures whose means `mean_figures` gives."""

TRANSPORT = ("distance_m", "drive_work_j", "mean_grf_n", "weight_share")
"""What a cost of transport over several episodes is made of; the force by the share is the weight."""


SETTLED = 3.0  # seconds of an episode that are left out, where it is at least twice as long
WINDOW = 0.005  # the loading rate is the steepest rise of the force over so many seconds

FORCES = ("toe_normal", "heel_normal", "toe_friction", "heel_friction")


def play(
    env: gym.Env[Any, Any],
    policy: Any,
    seeds: Sequence[int],
    tick: Any = lambda: None,
    *,
    loading_rate: bool = False,
) -> list[dict[str, float]]:
    """One episode per seed; its return and its summary. `tick` is called after each. The loading rate needs
    an environment of this package, whose substeps it records."""
    episodes = []
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        rate = LoadingRate(env) if loading_rate else None
        total, start, done = 0.0, np.ones(1, bool), False
        while not done:
            action, _ = policy.predict(observation, episode_start=start, deterministic=True)
            observation, reward, terminated, truncated, info = env.step(action)
            total += float(np.asarray(reward).sum())  # of a vector, all objectives
            if rate:
                rate.add()
            start, done = np.zeros(1, bool), terminated or truncated
        episodes.append({"return": total, **_with_stance_peak(info.get("episode_summary", {}))})
        if rate:
            episodes[-1]["loading_rate_n_s"] = rate.mean()
        tick()
    return episodes


def score_vector(policy: Any, env_id: str, seeds: Sequence[int], **env_kwargs: Any) -> list[dict[str, float]]:
    """One episode per seed, as `play` gives it, in batches of the native vector environment where the id has
    one. The policy, or the name or path of one as `find_policy` takes them, has Stable-Baselines3's `predict`
    for many observations, shape (n, k), and `episode_start`, shape (n,). `ParameterError`, `DataFileError`:
    unknown environment or policy, or one that does not fit."""
    with runs.make_env(env_id, **env_kwargs) as env:
        if isinstance(policy, str):
            policy = find_policy(policy, env, env_id)
        if not hasattr(policy, "predict"):
            raise ParameterError(f"policy: expected one with predict, or its name, got {policy!r}")
        episodes: list[dict[str, float]] = []
        envs = None
        for first in range(0, len(seeds), ROWS):
            batch = list(seeds[first : first + ROWS])
            if envs is None or envs.num_envs != len(batch):
                envs = make_rows(env_id, len(batch), **env_kwargs)
            episodes += play(env, policy, batch) if envs is None else play_rows(envs, policy, batch)
    return episodes


def make_rows(env_id: str, num_envs: int, **env_kwargs: Any) -> HorseLegVectorEnv | None:
    """The native vector environment of an id; None where there is none."""
    with suppress(gym.error.Error):
        many: dict[str, Any] = {"num_envs": num_envs, "vectorization_mode": "vector_entry_point"}
        envs = gym.make_vec(env_id, **many, **env_kwargs).unwrapped
        if isinstance(envs, HorseLegVectorEnv):
            return envs
    return None


def play_rows(envs: HorseLegVectorEnv, policy: Any, seeds: Sequence[int]) -> list[dict[str, float]]:
    """`score_vector` with an environment that is there already, one row for each seed."""
    observation, _ = envs.reset(seed=list(seeds))
    start, going = np.ones(envs.num_envs, bool), np.ones(envs.num_envs, bool)
    total, state = np.zeros(envs.num_envs), None
    episodes: list[dict[str, float]] = [{} for _ in seeds]
    while going.any():
        actions, state = policy.predict(observation, state, episode_start=start, deterministic=True)
        observation, rewards, terminated, truncated, infos = envs.step(actions)
        total += np.where(going, rewards, 0.0)  # a row that is over starts again; that is not counted
        ended = going & (terminated | truncated)
        for row in np.flatnonzero(ended):
            columns = infos["episode_summary"]
            summary = {key: float(x[row]) for key, x in columns.items() if not key.startswith("_")}
            episodes[row] = {"return": float(total[row]), **_with_stance_peak(summary)}
        going &= ~ended
        start = terminated | truncated
    return episodes


def _with_stance_peak(summary: Mapping[str, float]) -> dict[str, float]:
    if "stances" not in summary:
        return dict(summary)
    return {**summary, "stance_peak_n": summary["stance_peak_sum_n"] / max(summary["stances"], 1.0)}


def mean_figures(episodes: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Means over episodes of `FIGURES`, those that an id has; the cost of transport is that of the distance
    and work of all of them, NaN if they do not get forward."""
    means = {name: float(np.mean([one[name] for one in episodes])) for name in FIGURES if name in episodes[0]}
    if "cost_of_transport" in means:
        distance, work, force, share = (sum(one[name] for one in episodes) for name in TRANSPORT)
        moved = share and distance > 0
        means["cost_of_transport"] = work * share / (force * distance) if moved else float("nan")
    return means


def is_model(name: str) -> bool:
    """Whether a policy's name is the path of a model rather than that of a scripted policy or of a gait."""
    is_path = (
        name.lower().endswith((".zip", ".onnx"))
        or Path(name).name != name
        or Path(name, runs.MODEL).is_file()
    )
    return is_path and not name.endswith(".json")


def read_policy_record(name: str) -> dict[str, Any]:
    """What a policy's file says of itself, env_id and env_kwargs among it; empty for a scripted policy.
    `DataFileError`: no such model or gait."""
    if name.endswith(".json"):
        return open_loop_record(Path(name))
    return find_saved(Path(name)).record if is_model(name) else {}


def find_policy(name: str, env: gym.Env[Any, Any], env_id: str) -> Any:
    """A policy as `hoof_env.records.find_policy` takes it, or a model of any environment by its path.
    `ParameterError`: unknown name. `DataFileError`: no such model or gait, or one that does not fit."""
    if is_model(name):
        return find_saved(Path(name)).load(env, env_id)
    if not hasattr(env.unwrapped, "gaits"):
        raise ParameterError(
            f"policy: expected the path of a trained model, for none is scripted for {env_id}, got {name!r}"
        )
    return records.find_policy(name, env, env_id)


class LoadingRate:
    """The mean loading rate of an episode, from the substeps that an environment of this package, just reset,
    records. Call `add` after each step."""

    def __init__(self, env: Any) -> None:
        self._leg, self._setting = env.unwrapped, records.setting(env)
        self._parts: list[dict[str, Floats]] = []
        self._leg.record()  # substeps are kept from here on

    def add(self) -> None:
        record = self._leg.record()
        self._parts.append({name: record[name].ravel() for name in ("time", *FORCES)})

    def mean(self) -> float:
        """Mean over the whole stances of the episode [N/s], 0 without a stance."""
        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        is_long = self._leg.settings.episode_seconds >= 2 * SETTLED
        late = columns["time"] > (SETTLED if is_long else 0.0)
        toe, heel, toe_friction, heel_friction = (columns[name][late] for name in FORCES)
        friction = toe_friction + heel_friction
        rates = loading_rates(toe + heel, friction, self._setting.lift_off_n, self._setting.sim_dt)
        return float(rates.mean()) if len(rates) else 0.0


def loading_rates(normal: Floats, friction: Floats, lift_off: float, dt: float) -> Floats:
    """Loading rate of each whole stance [N/s], shape (stances,): the steepest rise of the normal force from
    touch-down to the highest ground reaction force. Forces on the hoof, shape (substeps,) [N], are `dt` [s]
    apart; a normal force above `lift_off` [N] is stance."""
    grf = np.hypot(normal, friction)
    rates = []
    for first, end in stances(normal, lift_off):
        top = first + int(np.argmax(grf[first:end]))
        rates.append(steepest(normal[max(first - 1, 0) : top + 1], dt))
    return np.array(rates)


def stances(normal: Floats, lift_off: float) -> NDArray[np.int64]:
    """First substep of each whole stance and the first after it, shape (stances, 2)."""
    loaded = np.concatenate([[True], normal > lift_off, [True]])
    down, up = (np.flatnonzero(np.diff(loaded.astype(int)) == sign) for sign in (1, -1))
    return np.stack([down[:-1], up[1:]], 1) if len(down) > 1 else np.zeros((0, 2), np.int64)


def steepest(force: Floats, dt: float) -> float:
    """Steepest rise [N/s] of a force, shape (n,) [N], over `WINDOW`, or all of it where that is shorter."""
    width = min(max(1, round(WINDOW / dt)), len(force) - 1)
    return float((force[width:] - force[:-width]).max() / (width * dt)) if width > 0 else 0.0

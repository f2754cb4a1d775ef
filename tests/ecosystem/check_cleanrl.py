"""CleanRL's single-file PPO and SAC as they are released, unmodified, from the wheel of PyPI.

They were written for Gymnasium 0.28 and gym 0.23; what is here gives them today's Gymnasium by those names.
"""

from __future__ import annotations

import faulthandler
import subprocess
import sys
import zipfile
from pathlib import Path
from runpy import run_path
from types import ModuleType, SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
import torch

from hoof_env.envs.open_loop import GAITS, open_loop_record

RELEASE = "cleanrl==1.2.0"
ENV_ID = "hoof_env/HorseLeg-v0"
EPISODES = 20


class OldVectorEnv(gym.vector.SyncVectorEnv):
    """Vector environment of Gymnasium 0.28: an episode that ends restarts in the same step, and `final_info`
    is a list."""

    def __init__(self, makers):
        super().__init__(makers, autoreset_mode=gym.vector.AutoresetMode.SAME_STEP)

    def step(self, actions):
        *told, infos = super().step(actions)
        if "final_info" in infos:
            episode = infos["final_info"]["episode"]
            infos["final_info"] = [
                {"episode": {key: episode[key][row] for key in "rl"}} if ended else None
                for row, ended in enumerate(infos["_final_info"])
            ]
        return *told, infos

    def close_extras(self, **kwargs):
        """Leave the environments open: the policy is scored in them."""


class OlderVectorEnv(OldVectorEnv):
    """Vector environment of gym 0.23: a step gives four things, the last of them a list."""

    def reset(self):
        return super().reset()[0]

    def step(self, actions):
        observations, rewards, terminated, truncated, infos = super().step(actions)
        each = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated):
            late = bool(truncated[row] and not terminated[row])
            each[row] = {"terminal_observation": infos["final_obs"][row], "TimeLimit.truncated": late}
            each[row] |= infos["final_info"][row]
        return observations, rewards, terminated | truncated, each


class OlderStatistics(gym.wrappers.RecordEpisodeStatistics):
    """With the method `seed` that gym 0.23 has."""

    def seed(self, seed):
        self.reset(seed=seed)


class OldTransform(gym.wrappers.TransformObservation):
    """Without the space, which Gymnasium 0.28 does not ask for."""

    def __init__(self, env, function):
        super().__init__(env, function, env.observation_space)


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """Folder of the scripts."""
    folder = tmp_path_factory.mktemp("cleanrl")
    asked = ("--no-deps", "--ignore-requires-python", "--only-binary", ":all:", "--quiet", "-d", str(folder))
    subprocess.run([sys.executable, "-m", "pip", "download", *asked, RELEASE], check=True)
    (wheel,) = folder.glob("cleanrl-*.whl")
    with zipfile.ZipFile(wheel) as files:
        files.extractall(folder)
    return folder / "cleanrl"


@pytest.fixture
def old_names(monkeypatch, tmp_path):
    """What the scripts import, by the names that it had."""
    older, distutils = ModuleType("gym"), ModuleType("distutils.util")
    older.make, older.spaces = gym.make, gym.spaces
    older.wrappers = SimpleNamespace(RecordEpisodeStatistics=OlderStatistics)
    older.vector = SimpleNamespace(SyncVectorEnv=OlderVectorEnv)
    distutils.strtobool = lambda text: text.lower() in ("1", "true", "yes")
    monkeypatch.setitem(sys.modules, "gym", older)
    monkeypatch.setitem(sys.modules, "distutils", ModuleType("distutils"))
    monkeypatch.setitem(sys.modules, "distutils.util", distutils)
    monkeypatch.setattr(gym.vector, "SyncVectorEnv", OldVectorEnv)
    monkeypatch.setattr(gym.wrappers, "TransformObservation", OldTransform)
    monkeypatch.chdir(tmp_path)  # where they write


def trained(script: Path, steps: int, monkeypatch, env_id: str = ENV_ID):
    """What a script leaves behind, run with its defaults for so many steps."""
    # SAC may take longer than a test is allowed to.
    faulthandler.cancel_dump_traceback_later()
    given = ["--env-id", env_id, "--total-timesteps", str(steps), "--cuda", "False"]
    monkeypatch.setattr(sys, "argv", [str(script), *given])
    return SimpleNamespace(**run_path(str(script), run_name="__main__"))


def score(env, act):
    """Mean return of a policy, through the wrappers that it was trained with."""
    layer = env
    while isinstance(layer, gym.Wrapper):
        if isinstance(layer, gym.wrappers.NormalizeObservation):
            layer.update_running_mean = False
        layer = layer.env
    returns = []
    for seed in range(1000, 1000 + EPISODES):
        (seen, _), ended = env.reset(seed=seed), False
        while not ended:
            with torch.no_grad():
                action = act(torch.as_tensor(np.asarray(seen, np.float32))[None])[0].numpy()
            seen, _, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
        returns.append(float(np.asarray(info["episode"]["r"]).item()))
    print(
        f"mean return of {EPISODES} episodes: {np.mean(returns):.1f},"
        f" best constant gait: {best_constant_gait():.1f}"
    )
    return np.mean(returns)


def best_constant_gait():
    file = GAITS / f"{ENV_ID.rpartition('/')[2]}-constant.json"
    return open_loop_record(file)["score"]["mean"]["return"]


@pytest.mark.usefixtures("old_names")
def test_ppo(scripts, monkeypatch):
    """`ppo_continuous_action.py` of the release: after 200,000 steps above the best constant gait."""
    left = trained(scripts / "ppo_continuous_action.py", 200_000, monkeypatch)
    assert score(left.envs.envs[0], left.agent.actor_mean) > best_constant_gait()


@pytest.mark.usefixtures("old_names")
def test_sac(scripts, monkeypatch):
    """`sac_continuous_action.py` of the release: after 60,000 steps above the best constant gait."""
    left = trained(scripts / "sac_continuous_action.py", 60_000, monkeypatch)
    assert score(left.envs.envs[0], lambda seen: left.actor.get_action(seen)[2]) > best_constant_gait()

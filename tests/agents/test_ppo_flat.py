"""The flat PPO: its arithmetic over time limits, that it learns, repeats and refuses what misfits."""

import csv
import errno
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch

from agents import ppo_flat
from agents.ppo_flat import Args, estimate_advantages, learn
from hoof_env.errors import HoofEnvError, OutputError, ParameterError

GAMMA, LAMBDA = 0.9, 0.8


class Guess(gym.Env):
    """Pays 1 less the squared distance of the action from 0.5, five steps long, then cut short or over."""

    observation_space = gym.spaces.Box(-1, 1, (2,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def __init__(self, ends: str = "truncated"):
        self.ends = ends

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 5
        return np.ones(2, np.float32), {}

    def step(self, action):
        self.left -= 1
        over = self.left == 0
        ended = over and self.ends == "terminated", over and self.ends == "truncated"
        return np.ones(2, np.float32), 1.0 - float(action[0] - 0.5) ** 2, *ended, {}


@pytest.fixture(autouse=True)
def guess(monkeypatch):
    spec = gym.envs.registration.EnvSpec("Guess-v0", Guess)
    monkeypatch.setitem(gym.registry, "Guess-v0", spec)


def guessing(**changes) -> Args:
    usual = {"env_id": "Guess-v0", "n_envs": 8, "n_steps": 32, "batch_size": 64, "net_arch": (8,)}
    return Args(**{**usual, "gamma": GAMMA, "log_std_init": -2.0, "learning_rate": 0.01, **changes})


def test_advantages_are_those_of_every_episode_alone():
    generator = torch.Generator().manual_seed(0)
    rewards, values = torch.rand(40, 3, generator=generator), torch.rand(41, 3, generator=generator)
    terminated = torch.rand(40, 3, generator=generator) < 0.1
    truncated = (torch.rand(40, 3, generator=generator) < 0.1) & ~terminated
    found = estimate_advantages(rewards, values, terminated, truncated, GAMMA, LAMBDA)
    for env in range(3):
        for start in range(40):
            expected, weight = 0.0, 1.0
            for t in range(start, 40):
                future = 0.0 if terminated[t, env] else GAMMA * values[t + 1, env]
                expected += weight * (rewards[t, env] + future - values[t, env])
                weight *= GAMMA * LAMBDA
                if terminated[t, env] or truncated[t, env]:
                    break
            assert found[start, env] == pytest.approx(float(expected), abs=1e-5)


FOR_EVER = 1 / (1 - GAMMA)
UNTIL_THE_END = np.mean([(1 - GAMMA**left) / (1 - GAMMA) for left in range(1, 6)])


@pytest.mark.parametrize(("ends", "value"), [("truncated", FOR_EVER), ("terminated", UNTIL_THE_END)])
def test_a_time_limit_is_not_the_end_but_a_termination_is(ends, value):
    """At a reward of 1; the observation does not tell the time, so that the value is a mean over it."""
    learned = learn(guessing(steps=10_000, learning_rate=0.03, env_kwargs=(f"ends={ends}",)))
    with torch.no_grad():
        assert float(learned.agent.value(torch.ones(2))) == pytest.approx(value, rel=0.1)


def test_learns_the_action_that_pays():
    learned = learn(guessing(steps=8_000))
    with torch.no_grad():
        assert float(learned.agent.policy(torch.ones(2)).mean) == pytest.approx(0.5, abs=0.1)
    assert learned.progress[-1]["episodic_return"] > learned.progress[0]["episodic_return"] + 0.5
    assert learned.progress[-1]["steps"] >= 8_000


@pytest.fixture
def sizes(monkeypatch):
    """Of all batches that are learnt from."""
    found, loss = [], ppo_flat._loss

    def note(agent, batch, args):
        found.append(len(batch["target"]))
        return loss(agent, batch, args)

    monkeypatch.setattr(ppo_flat, "_loss", note)
    return found


@pytest.mark.parametrize(
    ("steps", "n_steps", "left"),
    [(24, 12, [20]), (20, 5, [10, 8])],  # five steps, a restart, five steps, a restart
    ids=["in a rollout", "from one to the next"],
)
def test_steps_that_restart_are_left_out(sizes, steps, n_steps, left):
    learn(guessing(steps=steps, n_envs=2, n_steps=n_steps, n_epochs=1))
    assert sizes == left


def test_same_arguments_same_agent():
    one, two, other = (learn(guessing(steps=512, seed=seed)).agent.state_dict() for seed in (3, 3, 4))
    assert all(torch.equal(one[key], two[key]) for key in one)
    assert any(not torch.equal(one[key], other[key]) for key in one)


def test_leg_writes_its_folder_and_says_how_it_goes(tmp_path, capsys):
    arguments = ["--n-envs", "2", "--n-steps", "64", "--steps", "256", "--env-kwargs", "episode_seconds=0.4"]
    ppo_flat.main([*arguments, "--out", str(tmp_path / "run")])
    assert "SPS" in capsys.readouterr().out
    rows = list(csv.DictReader((tmp_path / "run" / "progress.csv").open()))
    assert [row["steps"] for row in rows] == ["128", "256"]
    assert np.isfinite(float(rows[-1]["episodic_return"]))
    agent = ppo_flat.Agent(24, 4, (64, 64), 0.0)
    agent.load_state_dict(torch.load(tmp_path / "run" / "model.pt", weights_only=True))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"env_id": "hoof_env/None-v0"}, "hoof_env/None-v0"),
        ({"env_id": "CartPole-v1", "vectorization": "sync"}, "expected boxes of one dimension, got Discrete"),
        ({"env_kwargs": ("hooves=4",)}, "hooves"),
        ({"vectorization": "vector_entry_point"}, "Guess-v0"),
        ({"n_envs": 0}, "n_envs"),
        ({"steps": 0}, "steps"),
        ({"batch_size": 1}, "batch_size"),
        ({"seed": -1}, "seed"),
        ({"seed": 10**20}, "seed"),
        ({"torch_threads": 10**10}, "torch_threads"),
        ({"torch_threads": 0}, "torch_threads"),
        ({"learning_rate": np.nan}, "learning_rate"),
        ({"learning_rate": 1e6}, "learning_rate"),
        ({"learning_rate": -1.0}, "learning_rate"),
        ({"gamma": 5.0}, "gamma"),
        ({"net_arch": (8, 0)}, "net_arch"),
        ({"device": "foo"}, "device: expected one that torch has, got 'foo'"),
        ({"device": "meta"}, "device: expected one that torch has, got 'meta'"),
    ],
)
def test_refuses(changes, said):
    with pytest.raises(ParameterError, match=said):
        learn(guessing(**{"steps": 256, **changes}))


def test_refuses_environments_that_restart_at_once(monkeypatch):
    same_step = gym.vector.AutoresetMode.SAME_STEP
    sync = lambda **_: gym.vector.SyncVectorEnv([Guess], autoreset_mode=same_step)  # noqa: E731
    spec = gym.envs.registration.EnvSpec("Hasty-v0", Guess, vector_entry_point=sync)
    monkeypatch.setitem(gym.registry, "Hasty-v0", spec)
    with pytest.raises(ParameterError, match="next step"):
        learn(guessing(env_id="Hasty-v0"))


@pytest.mark.parametrize(
    "changes", [{"steps": 1_000}, {"steps": 1, "n_steps": 1, "n_epochs": 1}], ids=["at once", "at the last"]
)
def test_a_training_that_diverges_leaves_nothing(tmp_path, changes):
    with pytest.raises(HoofEnvError, match="diverged"):
        learn(guessing(vf_coef=1e38, out=tmp_path, **changes))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("log_std", [np.nan, -1e6])
def test_a_policy_that_diverged_says_so(log_std):
    with pytest.raises(HoofEnvError, match="diverged"):
        ppo_flat.Agent(2, 1, (8,), log_std).policy(torch.ones(2))


def test_a_model_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    learn(guessing(steps=1, n_steps=1, out=tmp_path))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    write = Path.write_bytes

    def half(path, data):
        write(path, data[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises(OutputError, match="No space left"):
        learn(guessing(steps=1, n_steps=1, seed=1, out=tmp_path))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_refuses_a_file_for_a_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError):
        learn(guessing(out=tmp_path / "file"))

"""Exported policies act as their models do, fit what they are for, and play without a learning library."""

import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

if not os.environ.get("CI"):  # which installs them, so that nothing may be left out there
    pytest.importorskip("onnxruntime", reason='needs pip install "hoof-env[onnx]"')
    pytest.importorskip("onnxscript", reason='needs pip install "hoof-env[onnx]"')

from agents import export
from agents.export import main, write_policy
from agents.ppo_flat import FlatPPO
from agents.runs import SavedModel, TrainedPolicy, make_env
from hoof_env.errors import DataFileError, OutputError
from hoof_env.evaluation.episodes import play
from hoof_env.policies.onnx_file import OnnxPolicy
from hoof_env.policies.record import check_record, describe
from hoof_env.records import find_policy
from tests.agents.conftest import ENV_ID, KWARGS

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def exported(trained, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("exported") / "policy.onnx"
    main([str(trained.folder), "--out", str(path)])
    return path


def untrained(algorithm, normalized: bool) -> TrainedPolicy:
    """A policy for actions from -2 to 2, seldom within them, and statistics far from 0 and 1."""
    envs = DummyVecEnv([lambda: gym.make("Pendulum-v1")])
    arguments = {"policy_kwargs": {"net_arch": [8]}, "seed": 0, "device": "cpu"}
    model = algorithm("MlpPolicy", envs, **arguments)
    if algorithm in (PPO, FlatPPO):
        model.policy.action_net.weight.data *= 300
    if not normalized:
        return TrainedPolicy(model, None)
    statistics = VecNormalize(envs, clip_obs=1.5)
    statistics.obs_rms.mean[:], statistics.obs_rms.var[:] = (0.3, -0.2, 2.0), (0.04, 0.5, 9.0)
    return TrainedPolicy(model, statistics.normalize_obs)


@pytest.mark.parametrize("normalized", [True, False])
@pytest.mark.parametrize("algorithm", [PPO, FlatPPO, SAC, TD3, TQC])
def test_an_exported_policy_acts_as_the_model(algorithm, normalized):
    policy = untrained(algorithm, normalized)
    rows = np.random.default_rng(1).normal(0, 3, (50, 3)).astype(np.float32)
    with torch.no_grad():
        actions = export.module_of(policy)(torch.as_tensor(rows)).numpy()
    wanted, _ = policy.predict(rows)
    np.testing.assert_allclose(actions, wanted, atol=2e-5)
    assert np.ptp(wanted) > 0.1
    assert np.abs(actions).max() <= 2


def test_onnx_acts_as_the_model(tmp_path):
    policy = untrained(SAC, normalized=True)  # PPO is `exported`
    assert write_policy(policy, tmp_path / "policy.onnx", {"env_id": "Pendulum-v1"}) < 1e-5
    rows = np.random.default_rng(1).normal(0, 3, (5, 10, 3)).astype(np.float32)
    actions, state = OnnxPolicy(tmp_path / "policy.onnx").predict(rows, "state")
    wanted, _ = policy.predict(rows.reshape(-1, 3))
    np.testing.assert_allclose(actions.reshape(-1, 1), wanted, atol=2e-5)
    assert (actions.shape, state) == ((5, 10, 1), "state")


def test_an_exported_policy_plays_the_model_s_episode(env, trained, exported):
    def rewards_of(policy):
        observation, _ = env.reset(seed=5)
        rewards, done = [], False
        while not done:
            observation, reward, terminated, truncated, _ = env.step(policy.predict(observation)[0])
            rewards.append(reward)
            done = terminated or truncated
        return rewards

    ours = rewards_of(find_policy(str(exported), env, ENV_ID))
    assert ours == rewards_of(find_policy(str(exported.parent), env, ENV_ID))
    assert ours == pytest.approx(rewards_of(SavedModel.find(trained.folder).load(env, ENV_ID)), abs=1e-4)


def test_metadata(env, exported):
    record = OnnxPolicy(exported).record
    assert record["observation_names"] == list(env.unwrapped.observation_names)
    assert record["env_id"] == ENV_ID
    assert record["env_kwargs"] == KWARGS
    assert (record["algo"], record["seed"]) == ("ppo", "0")
    assert record["action_names"] == list(env.unwrapped.action_names)
    assert record["observation_scales"] == env.unwrapped.observation_scales
    assert record["observation_scales"]["forward speed"] == "tanh(x / 5)"
    assert record["actions"] == "rates"
    with make_env("hoof_env/Horse-v0") as horse:
        names = describe(horse)["action_names"]
        assert describe(horse)["actions"] == "offsets of 0.4 and 0.04 rad"
    assert len(names) == 16
    assert (names[0], names[-1]) == ("left_fore_crank_speed", "right_hind_swing_cos")
    assert str(ROOT).encode() not in exported.read_bytes()


def test_other_settings_and_another_version_are_reported(env, exported, trained, tmp_path, monkeypatch):
    import onnx

    old = tmp_path / "old.ONNX"  # of before the settings were kept
    graph = onnx.load(exported)
    kept = [entry for entry in graph.metadata_props if entry.key != "settings"]
    del graph.metadata_props[:]
    graph.metadata_props.extend(kept)
    onnx.save(graph, old)
    record = OnnxPolicy(exported).record
    monkeypatch.setattr("hoof_env.policies.record.__version__", record["hoof_env"])
    assert record["settings"] == json.loads((trained.folder / "run.json").read_text())["settings"]
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for path in (exported, old):
            find_policy(str(path), env, ENV_ID)
    with (
        make_env(ENV_ID, **KWARGS, target_speed=[1, 1]) as other,
        pytest.warns(UserWarning, match=r"trained with target_speed=\[2.5, 2.5\], here \[1, 1\]$"),
    ):
        find_policy(str(exported), other, ENV_ID)
    with make_env(ENV_ID, **KWARGS, dt=0.01) as other:
        for path in (exported, trained.folder):
            with pytest.warns(UserWarning, match=r"trained with dt=0\.02, here 0\.01$"):
                find_policy(str(path), other, ENV_ID)
    with make_env(ENV_ID) as other, pytest.warns(UserWarning, match=r"episode_seconds=0\.4, here 10\.0$"):
        find_policy(str(old), other, ENV_ID)
    with pytest.warns(UserWarning, match="trained with gone=1, here None$"):
        check_record(exported, {**record, "settings": {**record["settings"], "gone": 1}}, env, ENV_ID)
    newer = {key: value for key, value in record["settings"].items() if key != "action_delay"}
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_record(exported, {**record, "settings": newer}, env, ENV_ID)
    with (
        make_env(ENV_ID, **KWARGS, action_delay=1.0) as other,
        pytest.warns(UserWarning, match=r"trained with action_delay=0\.0, here 1\.0$"),
    ):
        check_record(exported, {**record, "settings": newer}, other, ENV_ID)
    monkeypatch.setattr("hoof_env.policies.record.__version__", "9.9.9")
    with pytest.warns(UserWarning, match=r"trained with hoof-env \d\S*, here 9\.9\.9$"):
        find_policy(str(exported), env, ENV_ID)


def test_a_file_names_the_version_that_trained(env):
    there = {"versions": {"hoof-env": "0.0.1"}, "settings": {"dt": 0.5}}
    about = export.about(env, ENV_ID, KWARGS, there)
    assert (about["hoof_env"], about["settings"]) == ("0.0.1", {"dt": 0.5})
    assert export.about(env, ENV_ID, KWARGS, {})["settings"]["episode_seconds"] == 0.4


def test_an_export_knows_no_more_scales_than_its_run(env):
    there = {"algo": "ppo", "observation_scales": {"height": "tanh(x / 9)"}}
    assert "observation_scales" not in export.about(env, ENV_ID, KWARGS, {"algo": "ppo"})
    for record in ({}, there):
        assert export.about(env, ENV_ID, KWARGS, record)["observation_scales"]["height"].startswith("tanh((x")


def test_a_file_that_acts_otherwise_is_not_written(tmp_path, monkeypatch):
    right = export.Deterministic.forward
    monkeypatch.setattr(export.Deterministic, "forward", lambda self, rows: right(self, rows) + 1e-4)
    path = tmp_path / "policy.onnx"
    path.write_text("older")
    with pytest.raises(DataFileError, match="within 1e-05 of the model's, got 5e-05"):
        write_policy(untrained(TD3, normalized=False), path, {"env_id": "Pendulum-v1"}, overwrite=True)
    assert [one.name for one in tmp_path.iterdir()] == ["policy.onnx"]
    assert path.read_text() == "older"


def test_a_file_is_replaced_on_request_alone(trained, tmp_path):
    path = tmp_path / "policy.onnx"
    path.write_text("older")
    with pytest.raises(OutputError, match="exists already; name another file, or add --overwrite"):
        export.export(trained.folder, path)
    assert path.read_text() == "older"
    main([str(trained.folder), "--out", str(path), "--overwrite"])
    OnnxPolicy(path)


@pytest.mark.parametrize("entry", ["env_id", "env_kwargs"])
def test_the_example_imports_nothing_that_a_file_names(exported, tmp_path, entry):
    import onnx

    model = onnx.load(exported)
    asked = {"env_id": "payload:hoof_env/HorseLeg-v0", "env_kwargs": json.dumps({"task": "payload:x/Y-v0"})}
    for prop in model.metadata_props:
        prop.value = asked[entry] if prop.key == entry else prop.value
    onnx.save(model, tmp_path / "policy.onnx")
    (tmp_path / "payload.py").write_text("open('ran', 'w')\n")
    command = [sys.executable, ROOT / "examples" / "run_policy.py", "policy.onnx"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert not (tmp_path / "ran").exists()
    if entry == "env_kwargs":
        assert "a file must not import a module" in done.stderr


def test_the_example_plays_a_policy_without_a_learning_library(env, trained, exported):
    script = ROOT / "examples" / "run_policy.py"
    after = (
        "import runpy, sys; runpy.run_path(sys.argv.pop(1), run_name='__main__');"
        "assert not {'torch', 'stable_baselines3'} & {*sys.modules}"
    )
    done = subprocess.run(
        [sys.executable, "-c", after, str(script), str(exported)], capture_output=True, text=True, cwd=ROOT
    )
    assert not done.stderr
    found = [float(value) for value in re.findall(r"return (\S+)", done.stdout)]
    episodes = play(env, SavedModel.find(trained.folder).load(env, ENV_ID), range(1000, 1003))
    assert found == pytest.approx([one["return"] for one in episodes], abs=0.01)
    bare = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, cwd=ROOT)
    assert bare.returncode == 1
    assert re.fullmatch(r".*python examples/run_policy\.py POLICY\.onnx\n", bare.stderr)

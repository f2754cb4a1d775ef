"""Datasets for offline learning: what is in them is what a replay gives, and nothing half-made stays."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest

from hoof_env.errors import OutputError, ParameterError

minari = pytest.importorskip("minari", reason='needs pip install "hoof-env[minari]"')

from agents import dataset  # noqa: E402

SHORT = ("--env-kwargs", "episode_seconds=0.4", "--episodes", "2")


@pytest.fixture(autouse=True)
def shelf(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def written(shelf, *arguments):
    dataset.main([*arguments, *SHORT, "--out", str(shelf), "--dataset-id", "hoof_env/some-v0"])
    return minari.load_dataset("hoof_env/some-v0"), shelf / "hoof_env" / "some-v0"


@pytest.mark.parametrize(
    ("env_id", "policies"),
    [
        ("hoof_env/HorseLeg-v0", ("run", "random")),
        ("hoof_env/HorseLegFixed-v0", ("walk",)),
        ("hoof_env/Horse-v0", ("reference", "agents/policies/Horse-v0")),
    ],
)
def test_a_replay_gives_the_same_bits(shelf, env_id, policies):
    data, _ = written(shelf, *policies, "--env-id", env_id, "--seed", "7")
    env = data.recover_environment()
    assert (env.spec.id, env.spec.kwargs["episode_seconds"]) == (env_id, 0.4)
    assert data.total_episodes == 2 * len(policies)
    for k, episode in enumerate(data.iterate_episodes()):
        seen, _ = env.reset(seed=7 + k % 2)
        np.testing.assert_array_equal(seen, episode.observations[0])
        for step, action in enumerate(episode.actions):
            seen, reward, terminated, truncated, _ = env.step(action)
            np.testing.assert_array_equal(seen, episode.observations[step + 1])
            assert reward == episode.rewards[step]
            assert (terminated, truncated) == (episode.terminations[step], episode.truncations[step])
        assert terminated or truncated


def test_the_manifest_has_hashes_licence_and_returns(shelf):
    data, folder = written(shelf, "run")
    about = json.loads((folder / dataset.MANIFEST).read_text())
    assert about["licence"] == "MIT"
    found = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert set(about["sha256"]) == found - {dataset.MANIFEST}
    for name, digest in about["sha256"].items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    totals = [float(episode.rewards.sum()) for episode in data.iterate_episodes()]
    assert about["policies"]["run"]["mean_return"] == pytest.approx(np.mean(totals))


def test_two_runs_have_the_same_data(tmp_path, monkeypatch):
    found = []
    for name in ("one", "two"):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / name))
        data, _ = written(tmp_path / name, "random")
        found.append([(e.observations, e.actions, e.rewards) for e in data.iterate_episodes()])
    for one, two in zip(*found, strict=True):
        for a, b in zip(one, two, strict=True):
            np.testing.assert_array_equal(a, b)


def test_nothing_half_made_stays(shelf, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(dataset, "_write_manifest", stop)
    with pytest.raises(KeyboardInterrupt):
        written(shelf, "run")
    assert list(shelf.iterdir()) == []


def test_bad_arguments(shelf):
    with pytest.raises(ParameterError, match="policies: expected at least one"):
        dataset.main(["--out", str(shelf)])
    with pytest.raises(ParameterError, match="episodes: expected a whole number"):
        dataset.main(["run", "--episodes", "0", "--out", str(shelf)])
    with pytest.raises(ParameterError, match="hoof_env/Cow-v0"):
        dataset.main(["run", "--env-id", "hoof_env/Cow-v0", "--out", str(shelf)])
    written(shelf, "run")
    with pytest.raises(OutputError, match="expected no dataset there"):
        written(shelf, "run")

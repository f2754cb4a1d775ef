"""Datasets for offline learning: what is in them is what a replay gives, and nothing half-made stays."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.errors import DataFileError, ParameterError

minari = pytest.importorskip("minari", reason='needs pip install "hoof-env[minari]"')

from agents import dataset  # noqa: E402

LEG = "hoof_env/HorseLeg-v0"
TRAINED = "agents/policies/Horse-v0"
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
        ("hoof_env/Horse-v0", ("reference", TRAINED)),
    ],
)
def test_a_replay_gives_the_same_bits(shelf, env_id, policies):
    if TRAINED in policies:
        pytest.importorskip("onnxruntime", reason='needs pip install "hoof-env[onnx]"')
    data, folder = written(shelf, *policies, "--env-id", env_id, "--seed", "7")
    about = json.loads((folder / dataset.MANIFEST).read_text())["policies"]
    env = data.recover_environment()
    assert (env.spec.id, env.spec.kwargs["episode_seconds"]) == (env_id, 0.4)
    assert data.total_episodes == 2 * len(policies)
    for k, episode in enumerate(data.iterate_episodes()):
        start = about[policies[k // 2]].get("start")
        assert bool(start) == (policies[k // 2] in ("run", "walk"))
        seen, _ = env.reset(seed=7 + k % 2, options=start)
        np.testing.assert_array_equal(seen, episode.observations[0])
        for step, action in enumerate(episode.actions):
            seen, reward, terminated, truncated, _ = env.step(action)
            np.testing.assert_array_equal(seen, episode.observations[step + 1])
            assert reward == episode.rewards[step]
            assert (terminated, truncated) == (episode.terminations[step], episode.truncations[step])
        assert terminated or truncated


def test_a_dataset_says_what_its_actions_are(shelf):
    data, _ = written(shelf, "run")
    assert dataset.load("hoof_env/some-v0").total_episodes == 2
    for form, said in (
        ("offsets", "actions offsets, expected rates"),
        (None, "actions None, expected rates"),
    ):
        data.storage.update_metadata({"actions": form})
        with pytest.raises(DataFileError, match=f"some-v0: made with {said}; make it again"):
            dataset.load("hoof_env/some-v0")


@pytest.mark.parametrize(
    ("entry", "value", "said"),
    [
        ("observation_names", ["pitch"], "observation_names with pitch and without sin"),
        (
            "observation_scales",
            {"forward speed": "tanh(x / 9)"},
            r"observation_scales, forward speed: 'tanh\(x / 9\)', expected 'tanh\(x / 5\)'; make it again",
        ),
    ],
)
def test_a_dataset_says_what_its_observations_are(shelf, entry, value, said):
    data, _ = written(shelf, "run")
    data.storage.update_metadata({entry: value})
    with pytest.raises(DataFileError, match=f"some-v0: made with {said}"):
        dataset.load("hoof_env/some-v0")


def test_other_settings_of_a_dataset_are_reported(shelf):
    """As those of an id of which the control step has changed."""
    data, _ = written(shelf, "run")
    settings = data.storage.metadata["settings"]
    data.storage.update_metadata({"settings": settings | {"dt": 0.04}})
    with pytest.warns(UserWarning, match=r"some-v0: made with dt=0\.04, here 0\.02$"):
        dataset.load("hoof_env/some-v0")


def test_a_dataset_without_a_tag_is_neither_read_nor_added_to(shelf):
    """As Minari writes it."""
    env = gym.make("hoof_env/HorseLeg-v0", episode_seconds=0.1)
    collector = minari.DataCollector(env)
    collector.reset(seed=0)
    for _ in range(5):
        collector.step(np.zeros(4, np.float32))
    old = collector.create_dataset("hoof_env/old-v0")
    with pytest.raises(DataFileError, match="actions None"):
        dataset.load("hoof_env/old-v0")
    with pytest.raises(DataFileError, match="actions None"):
        dataset.check_fit(old, env)


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


def test_the_manifest_names_the_files_of_a_trained_policy(shelf):
    pytest.importorskip("onnxruntime", reason='needs pip install "hoof-env[onnx]"')
    _, folder = written(shelf, "reference", TRAINED, "--env-id", "hoof_env/Horse-v0")
    policies = json.loads((folder / dataset.MANIFEST).read_text())["policies"]
    assert "sha256" not in policies["reference"]
    digest = hashlib.sha256(Path(TRAINED, "policy.onnx").read_bytes()).hexdigest()
    assert policies[TRAINED]["sha256"] == {"policy.onnx": digest}


def test_the_licence_is_the_checkout_s_which_need_not_be_installed(shelf, monkeypatch):
    project = shelf / "pyproject.toml"
    project.write_text('[project]\nlicense = "ISC"\n')
    monkeypatch.setattr(dataset, "PROJECT", project)
    _, folder = written(shelf, "run")
    assert json.loads((folder / dataset.MANIFEST).read_text())["licence"] == "ISC"


def test_the_files_of_policies(tmp_path):
    assert dataset.policy_files("run", LEG) == dataset.policy_files("6.28,0.7,-0.2,-0.3", LEG) == []
    assert dataset.policy_files("gait.json", LEG) == [Path("gait.json")]
    for name in ("model.zip", "vecnormalize.pkl", "other.txt"):
        (tmp_path / name).touch()
    (tmp_path / "run.json").write_text('{"env_id": "hoof_env/HorseLeg-v0", "algo": "ppo"}')
    for name, folder in (("shipped", "HorseLeg-v0"), ("hoof_env/Horse-v0", "Horse-v0")):
        files = dataset.policy_files(name, LEG)
        assert [file.name for file in files] == ["policy.json", "policy.safetensors"]
        assert {file.parent.name for file in files} == {folder}
    assert [file.name for file in dataset.policy_files(str(tmp_path), LEG)] == [
        "model.zip",
        "vecnormalize.pkl",
    ]


def test_default_ids_are_ids():
    numbers = dataset.default_id("hoof_env/HorseLeg-v0", ["6.28,0.7,-0.2,-0.3", "run"])
    assert numbers == "hoof_env/HorseLeg/6_28_0_7_-0_2_-0_3-run-v0"
    assert dataset.check_id(numbers) == numbers
    assert dataset.default_id("hoof_env/Horse-v0", [TRAINED]) == "hoof_env/Horse/Horse-v0-v0"


def test_ids_that_are_taken_are_minari_s():
    from minari.dataset.minari_dataset import parse_dataset_id

    for name in ("foo-v0", "ab/foo-v12", "ab/c/foo_1-x-v0"):
        assert parse_dataset_id(dataset.check_id(name))


def test_two_runs_have_the_same_data(tmp_path, monkeypatch):
    found = []
    for name in ("one", "two"):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / name))
        data, _ = written(tmp_path / name, "random")
        found.append([(e.observations, e.actions, e.rewards) for e in data.iterate_episodes()])
    for one, two in zip(*found, strict=True):
        for a, b in zip(one, two, strict=True):
            np.testing.assert_array_equal(a, b)


def levelled(shelf, level, *more):
    arguments = ("--level", level, "--out", str(shelf), "--env-kwargs", "episode_seconds=1.0", *more)
    dataset.main([*arguments])
    name = f"hoof_env/HorseLeg/{level}-v0"
    return minari.load_dataset(name), json.loads((shelf / name / dataset.MANIFEST).read_text())


def test_a_level_has_the_fields_of_minari_and_its_score(shelf):
    author = (
        "--author",
        "A. Horse",
        "--author-email",
        "a@horse.example",
        "--code-permalink",
        "https://x.example",
    )
    data, about = levelled(shelf, "medium", "--episodes", "6", *author)
    stored = data.storage.metadata
    assert (stored["author"], stored["author_email"]) == ({"A. Horse"}, {"a@horse.example"})
    assert stored["code_permalink"] == "https://x.example"
    assert stored["algorithm_name"].startswith("shipped, 0.")
    assert "6 episodes of each of medium" in stored["description"]
    assert any("hoof-env==" in requirement for requirement in stored["requirements"])
    # By Minari's own function, which has 1 for the upper reference
    returns = np.array([episode.rewards.sum() for episode in data.iterate_episodes()])
    scores = 100 * minari.get_normalized_score(data, returns)
    assert scores.mean() == pytest.approx(about["policies"]["medium"]["normalised_score"])
    assert 0 < about["policies"]["medium"]["random_share"] < 1


def test_a_mixed_level_has_equal_parts_with_starts_of_their_own(shelf):
    data, about = levelled(shelf, "mixed", "--episodes", "8", "--seed", "3")
    parts = about["policies"]
    assert [*parts] == ["random", "simple", "medium", "expert"]
    assert [part["episodes"] for part in parts.values()] == [2] * 4
    assert [part["first_seed"] for part in parts.values()] == [3, 5, 7, 9]
    assert parts["simple"]["random_share"] > parts["medium"]["random_share"]
    env = data.recover_environment()
    for k, episode in enumerate(data.iterate_episodes()):
        np.testing.assert_array_equal(env.reset(seed=3 + k)[0], episode.observations[0])
        for action, reward in zip(episode.actions, episode.rewards, strict=True):
            assert env.step(action)[1] == reward


def test_bad_levels_are_refused(shelf):
    for words, *arguments in (
        ("policies: expected none together with a level, got run and expert", "run", "--level", "expert"),
        ("expected a multiple of 4", "--level", "mixed", "--episodes", "6"),
        ("policies: expected at least one, or a --level", "--episodes", "4"),
    ):
        with pytest.raises(ParameterError, match=words):
            dataset.main([*arguments, "--out", str(shelf)])
    assert list(shelf.iterdir()) == []


def test_nothing_half_made_stays(shelf, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(dataset, "_write_manifest", stop)
    with pytest.raises(KeyboardInterrupt):
        written(shelf, "run")
    assert list(shelf.iterdir()) == []

"""Every shipped policy fits its id, still returns what its card says, and is what the command makes."""

import json
import os
import re
import shutil
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

if not os.environ.get("CI"):  # which installs it, so that nothing may be left out there
    pytest.importorskip("onnxruntime", reason='needs pip install "hoof-env[onnx]"')

from agents import cards, ship
from agents.runs import SavedModel, make_env
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.evaluation.episodes import score_vector
from hoof_env.policies.catalogue import SHIPPED as DATA
from hoof_env.policies.find import find_policy
from hoof_env.policies.onnx_file import OnnxPolicy
from hoof_env.policies.record import describe
from tests.agents.conftest import train_tiny

FOLDERS = sorted(path.parent for path in ship.POLICIES.glob("*/card.md"))
SHIPPED = pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)


def read(path: Path) -> dict:
    return json.loads(path.read_text())


def data_of(folder: Path) -> Path:
    """The folder with what plays: in the package, where the policy ships."""
    return DATA / folder.name if folder.parent == ship.POLICIES else folder


def checked_mean(policy, score: dict) -> float:
    """Mean return of the episodes by which a score is checked."""
    first = score["seeds"][0]
    episodes = score_vector(policy, score["played_on"], range(first, first + score["check"]["episodes"]))
    return float(np.mean([episode["return"] for episode in episodes]))


def test_every_id_has_a_policy():
    ids = {name.removeprefix("hoof_env/") for name in gym.registry if name.startswith("hoof_env/")}
    assert {path.name for path in FOLDERS} == ids
    index = (ship.POLICIES / "README.md").read_text()
    assert all(f"({path.name}/card.md)" in index for path in FOLDERS)


def rows(page):
    """Lines of the tables of a page."""
    return [line for line in page.read_text().splitlines() if line.startswith("|")]


def test_the_tables_of_the_index_are_those_that_the_command_writes(tmp_path):
    for folder in FOLDERS:
        (tmp_path / folder.name).mkdir()
        for name in ("score.json", "run.json"):
            shutil.copy(data_of(folder) / name, tmp_path / folder.name)
    ship.write_index(tmp_path, tmp_path)
    assert rows(tmp_path / "README.md") == rows(ship.POLICIES / "README.md")
    assert len(rows(ship.POLICIES / "README.md")) > len(FOLDERS)


def test_the_tables_of_the_cards_are_those_that_the_command_writes(tmp_path):
    cards.main(["--out", str(tmp_path)])
    written = {path.parent.name: rows(path) for path in tmp_path.glob("*/card.md")}
    assert all(written.values())
    assert written == {path.name: rows(path / "card.md") for path in FOLDERS}


def test_a_figure_that_is_infinite_or_without_interval_is_read_back():
    policy = {"mean": {"a": None, "b": 1.0}, "interval95": {"a": [None, None], "b": [0.5, 2.0]}}
    found = cards.estimates_of(policy)
    assert found["a"].text() == "∞"
    assert found["b"].text() == "1.0 [0.5, 2.0]"


@SHIPPED
def test_score(folder):
    score = read(data_of(folder) / "score.json")
    with make_env(score["env_id"]) as env, warnings.catch_warnings():
        # No word of settings that are newer than the policy
        warnings.simplefilter("error", UserWarning)
        policy = OnnxPolicy(folder).load(env, score["env_id"])
        costs = env.unwrapped.costs
    recorded = np.mean(score["returns"][: score["check"]["episodes"]])
    allowed = score["check"]["tolerance"]
    assert checked_mean(policy, score) == pytest.approx(recorded, abs=allowed)
    assert allowed < 0.2 * recorded  # so that it can fail
    gaits = [name for name in ("run", "walk", "reference") if name in score["policies"]]
    if costs:
        assert_undominated(score, costs, ["policy", *gaits, "zero"])
        return
    assert recorded > max(score["policies"][name]["mean"]["return"] for name in gaits)


def assert_undominated(score, costs, names):
    """No gait returns as much at no more cost: with a limit in place of a price a return is not all."""
    env_id = score["env_id"]
    found = {}
    with make_env(env_id) as env:
        for name in names:
            policy = find_policy("shipped" if name == "policy" else name, env, env_id)
            episodes = score_vector(policy, env_id, range(score["seeds"][0], score["seeds"][0] + 40))
            cost = np.mean([sum(episode[key] for key in costs) for episode in episodes])
            found[name] = np.mean([episode["return"] for episode in episodes]), cost
    returned, cost = found.pop("policy")
    assert all(of_gait < returned or of_cost > cost for of_gait, of_cost in found.values()), found


@SHIPPED
def test_records_have_the_names_and_scales_of_the_id(folder):
    saved = SavedModel.find(data_of(folder))
    with make_env(saved.record["env_id"]) as env:
        here = describe(env)
    for record in (saved.record, OnnxPolicy(folder).record):
        assert {key: record.get(key) for key in here} == here


@SHIPPED
def test_weights_act_as_the_exported_policy(folder):
    saved = SavedModel.find(data_of(folder))
    assert saved.is_plain
    env_id = read(data_of(folder) / "score.json")["env_id"]
    with make_env(env_id) as env:
        weights, onnx = saved.load(env, env_id), OnnxPolicy(folder).load(env, env_id)
        env.observation_space.seed(1)
        seen = np.stack([env.observation_space.sample() for _ in range(50)])
    actions = onnx.predict(seen)[0]
    assert np.ptp(actions, axis=0).max() > 0.1
    np.testing.assert_allclose(weights.predict(seen)[0], actions, atol=1e-5)


@SHIPPED
def test_folder(folder):
    files = {path.name: path.stat().st_size for each in (folder, data_of(folder)) for path in each.iterdir()}
    assert {"policy.onnx", "run.json", "config.yml", "score.json", "card.md", "curve.png"} <= {*files}
    assert sum(files.values()) <= ship.LIMIT
    score, card = read(data_of(folder) / "score.json"), (folder / "card.md").read_text()
    assert score["env_id"].endswith(f"/{folder.name}")
    assert np.mean(score["returns"]) == pytest.approx(score["policies"]["policy"]["mean"]["return"], abs=1e-3)
    is_one = np.ptp(score["returns"]) == 0.0
    spread = "" if is_one else f" +/- {np.std(score['returns']):.2f}"
    assert f"value: {np.mean(score['returns']):.2f}{spread}, name" in card
    assert ("one deterministic episode" in card) == (folder.name == "HorseLegFixed-v0") == is_one
    assert ("There was one training" in card) == (score["runs"] == 1 and "chosen" not in score)
    assert score.get("chosen", "") in card
    assert ("the best of" in card) == (score["runs"] > 1)
    film = "../HorseLeg-v0/film.gif" if folder.name == "HorseLegMO-v0" else "film.gif"
    assert f"![{folder.name}]({film})" in card
    assert (folder / film).is_file()
    assert ("film.gif" in files) == (film == "film.gif")
    for name in ("card.md", "run.json", "score.json", "policy.onnx"):
        path = next(each / name for each in (folder, data_of(folder)) if (each / name).is_file())
        assert not re.search(rb"/(home|work|root|tmp|Users)/", path.read_bytes()), name


def test_the_multi_objective_policy_returns_the_same_in_sum():
    folder = ship.POLICIES / "HorseLegMO-v0"
    score, total, done = read(data_of(folder) / "score.json"), 0.0, False
    seed, policy = score["seeds"][0], OnnxPolicy(folder)
    with make_env(score["env_id"]) as env:
        observation, _ = env.reset(seed=seed)
        while not done:
            observation, reward, terminated, truncated, _ = env.step(policy.predict(observation)[0])
            total, done = total + reward.sum(), terminated or truncated
    (alone,) = score_vector(policy, score["played_on"], [seed])
    # Alone and as a row of many a network's last bits may differ, and so do chaotic episodes
    assert total == pytest.approx(alone["return"], abs=1e-3)


def test_a_run_is_shipped_by_one_command(tmp_path, monkeypatch, capsys):
    # The card has the command, and a folder in which pytest writes has no place in a card.
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "agents.train"])
    monkeypatch.setattr(ship, "SCORE_SEEDS", range(1_000_000, 1_000_003))
    monkeypatch.setattr(ship, "CHOOSING_SEEDS", range(500_000, 500_002))
    monkeypatch.setattr(ship, "FILM_SECONDS", 0.1)
    ship.gaits.cache_clear()
    for seed in (0, 1):
        train_tiny(tmp_path / "runs" / f"s{seed}", env_kwargs=(), steps=2048, seed=seed)
    (tmp_path / "runs" / "unfinished").mkdir()
    (tmp_path / "runs" / "unfinished" / "run.json").write_text("{}")
    command = [str(tmp_path / "runs"), "--out", str(tmp_path / "out"), "--env-id"]
    with pytest.raises(ParameterError, match="env_id"):
        ship.main([*command, "hoof_env/HorseLegRail-v0"])
    ship.main([*command, "hoof_env/HorseLeg-v0", "hoof_env/HorseLegMO-v0"])
    folders = sorted((tmp_path / "out").glob("HorseLeg*"))
    assert [path.name for path in folders] == ["HorseLeg-v0", "HorseLegMO-v0"]
    for folder in folders:
        test_folder(folder)
    folder = folders[0]
    score = read(data_of(folder) / "score.json")
    assert checked_mean(OnnxPolicy(folder), {**score, "check": {"episodes": 3}}) == pytest.approx(
        np.mean(score["returns"]), abs=1
    )
    assert {"policy", "run", "walk"} <= {*score["policies"]}
    assert "the best of 2 runs" in (folder / "card.md").read_text()
    said = capsys.readouterr().out
    assert "passed over" in said
    assert f"policy {np.mean(score['returns']):.2f}" in said
    ship.gaits.cache_clear()


@pytest.mark.parametrize("missing", ["policy.safetensors", "config.yml", "monitor.csv"])
def test_half_a_run_is_refused_in_one_line_and_leaves_nothing(tmp_path, trained, missing):
    run = tmp_path / "run"
    shutil.copytree(trained.folder, run)
    (run / "model.zip").unlink()
    (run / missing).unlink()
    with pytest.raises(DataFileError, match=rf"run {run}: expected .* found no {missing}$"):
        ship.main([str(run), "--out", str(tmp_path / "out")])
    assert [*tmp_path.iterdir()] == [run]


def test_a_refusal_on_the_way_leaves_nothing(tmp_path, trained, monkeypatch):
    def refuse(*_):
        raise DataFileError("no")

    monkeypatch.setattr(ship, "write_policy", refuse)
    choice = ship.Choice(SavedModel.find(trained.folder))
    choice.saved.record["env_kwargs"] = {}
    monkeypatch.setattr(SavedModel, "load", lambda *_: None)
    with pytest.raises(DataFileError, match="no"):
        ship.ship(choice, "hoof_env/HorseLeg-v0", tmp_path / "out")
    assert not [*tmp_path.iterdir()]


def test_commands_name_no_folder_of_a_machine():
    given = "python -m agents.train --hyperparams /srv/a/ppo.yml --out runs/x"
    assert ship.shown_command(given) == "python -m agents.train --hyperparams ppo.yml"
    assert ship.shown_command("") == ""

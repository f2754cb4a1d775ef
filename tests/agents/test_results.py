"""Rows of the tables: files that a replay confirms, and pages that are made of them."""

import json
import math
import shutil
from dataclasses import replace

import pytest
import torch
from stable_baselines3 import PPO

from agents import results
from agents.results import Row, check_replay, filled, make_row, read_row
from agents.runs import make_env
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.policies.saved import save_policy

LEG = "hoof_env/HorseLeg-v0"
FILES = sorted(results.RESULTS.glob("*.json"))


@pytest.fixture(scope="module")
def row():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(results, "FINAL_SEEDS", range(1_000_000, 1_000_006))
        patch.setattr(results, "_FINAL", (1_000_000, 1_000_006))
        return make_row(LEG, "constant")


def test_a_row_is_what_its_file_says(row, tmp_path):
    path = row.write(tmp_path)
    assert path.name == "HorseLeg-v0-constant.json"
    again = read_row(path)
    assert again.mean == row.mean
    assert again.seeds == (1_000_000, 1_000_006)
    assert {"python", "numpy", "hoof-env"} <= set(again.versions)
    assert "recorded" in check_replay(again)


DAMAGES = [
    ("not JSON", lambda data: "{", "expected one as agents.results writes it"),
    ("a list", lambda data: [], "not an object"),
    ("no mean", lambda data: {k: v for k, v in data.items() if k != "mean"}, "mean"),
    ("another kind", lambda data: data | {"kind": "best"}, "kind: expected one of"),
    ("seeds backwards", lambda data: data | {"seeds": [5, 3]}, r"seeds \(5, 3\)"),
    ("a return that is none", lambda data: data | {"mean": {"return": math.nan}}, "returns nan|NaN"),
    ("an unknown entry", lambda data: data | {"secret": 1}, "secret"),
    ("a policy that is no text", lambda data: data | {"policy": 3}, "must be strings"),
    ("a number too large", lambda data: data | {"mean": {"return": 10**400}}, "OverflowError"),
    (
        "a figure that is no number",
        lambda data: data | {"mean": data["mean"] | {"slip_m": "3"}},
        "mean .*'3'",
    ),
    ("an interval of one", lambda data: data | {"interval95": {"return": [1.0]}}, r"interval95 .*\[1\.0\]"),
    ("an interval that is a list", lambda data: data | {"interval95": [1]}, "values"),
    ("an effort in words", lambda data: data | {"effort": {"steps": "many"}}, "effort .*many"),
    ("seeds that are none", lambda data: data | {"seeds": [False, True]}, "seeds"),
    ("another package's id", lambda data: data | {"env_id": "CartPole-v1"}, "env_id: expected one of"),
    ("an id that imports", lambda data: data | {"env_id": f"spy:{LEG}"}, "env_id: expected one of"),
]


@pytest.mark.parametrize(("change", "words"), [pair[1:] for pair in DAMAGES], ids=[one[0] for one in DAMAGES])
def test_a_damaged_row_is_refused(row, tmp_path, change, words):
    path = row.write(tmp_path)
    content = change(json.loads(path.read_text()))
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(DataFileError, match=words):
        read_row(path)
    with pytest.raises(DataFileError, match=r"HorseLeg-v0-constant\.json"):
        results.main(["add", str(path)])


def test_a_row_that_does_not_replay_is_refused(row):
    with pytest.raises(DataFileError, match=r"expected return .* replayed 1[34]\d"):
        check_replay(replace(row, mean=row.mean | {"return": 500.0}))
    with pytest.raises(DataFileError, match="has other numbers than when it was scored"):
        check_replay(replace(row, digest="0" * 64))
    with pytest.raises(DataFileError, match="best of its runs is not the policy"):
        check_replay(replace(row, runs={"0": 500.0, "1": 3.0}))


def test_a_row_does_not_choose_how_well_it_must_agree(row):
    wide = {"return": (-1e4, 1e4)}
    with pytest.raises(DataFileError, match=r"expected return 500 .*interval \(-10000"):
        check_replay(replace(row, mean={"return": 500.0}, interval95=wide))
    with pytest.raises(DataFileError, match=r"expected return 139|expected return 14"):
        check_replay(replace(row, interval95=wide))


def test_a_row_imports_no_module_and_runs_no_pickle(row, tmp_path, monkeypatch):
    (tmp_path / "spy.py").write_text("raise SystemExit('imported')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    run = tmp_path / "run"
    shutil.copytree(results.ROOT / "results" / "policies" / "HorseLeg-v0-blind", run)
    (run / "policy.json").rename(run / "model.zip")  # what plays where plain data are incomplete
    for kind, policy in (
        ("run", "spy:act"), ("shipped", "spy:act"), ("blind", "spy:act"), ("blind", str(run)),
        ("blind", "results/../../elsewhere"), ("zero", "constant"), ("blind", "missing.json"),
    ):  # fmt: skip
        with pytest.raises(DataFileError, match=r"policy .* of a row"):
            check_replay(replace(row, kind=kind, policy=policy, digest=""))
        with pytest.raises(DataFileError, match=r"policy .* of a row"):
            make_row(LEG, kind, policy)


@pytest.mark.parametrize(
    "change", [{"episode_seconds": 30.0}, {"friction": 0.3}, {"drive": "motor"}], ids=str
)
def test_a_policy_of_another_world_is_refused(tmp_path, change):
    run = tmp_path / "run"
    shutil.copytree(results.ROOT / "results" / "policies" / "HorseLeg-v0-blind", run)
    record = json.loads((run / "run.json").read_text())
    record["env_kwargs"] |= change
    (run / "run.json").write_text(json.dumps(record))
    with pytest.raises(DataFileError, match=f"its record has {next(iter(change))}"):
        make_row(LEG, "blind", str(run))


def test_a_blind_agent_observes_nothing_of_the_ground_however_seldom_it_looks(tmp_path):
    """A policy whose replay cannot differ, for it ignores what it observes."""
    run = tmp_path / "run"
    run.mkdir()
    with make_env(LEG) as env:
        model = PPO("MlpPolicy", env, n_steps=8, batch_size=8)
        torch.nn.init.zeros_(model.policy.action_net.weight)
        assert save_policy(model, run)
    (run / "run.json").write_text(json.dumps({"env_id": LEG, "algo": "ppo", "actions": "rates"}))
    with pytest.raises(ParameterError, match=r"depend on no force.* got trunk, hoof"):
        make_row(LEG, "blind", str(run))


def test_runs_that_are_not_there_are_reported(tmp_path):
    for place in (tmp_path / "nowhere", results.CURVES):
        with pytest.raises(DataFileError, match=r"runs .*found none"):
            results.returns_of_runs(place, LEG)


def test_only_rows_of_the_published_episodes_are_taken(row, tmp_path, monkeypatch):
    monkeypatch.setattr(results, "check_replay", lambda row: "not played")
    with pytest.raises(DataFileError, match=r"expected the episodes of the tables.*1000006"):
        results.main(["add", str(row.write(tmp_path))])
    away = replace(row, seeds=results._FINAL, policy=str(tmp_path / "gait.json"))
    with pytest.raises(DataFileError, match="expected a policy within the repository"):
        results.main(["add", str(away.write(tmp_path))])


def test_a_file_of_another_row_is_reported(row, tmp_path):
    row.write(tmp_path).rename(tmp_path / "HorseLegRail-v0-zero.json")
    with pytest.raises(
        DataFileError, match=r"expected hoof_env/HorseLegRail-v0, zero; got hoof_env/HorseLeg"
    ):
        results.rows_of("hoof_env/HorseLegRail-v0", tmp_path)


def test_a_row_that_claims_to_see_nothing_must_see_nothing(row):
    with pytest.raises(DataFileError, match="do not depend on the ground"):
        make_row(LEG, "open-loop", "shipped")
    with pytest.raises(ParameterError, match="kind: expected one of"):
        make_row(LEG, "best")


def made(kind, value, **more):
    return Row(LEG, kind, kind, "", (0, 2), {"return": value}, {"return": None}, **more)


def test_a_table_has_the_best_blind_policy_in_bold_and_the_spread_over_runs(tmp_path):
    for each in (
        made("zero", 70.0),
        made("constant", 139.7),
        made("open-loop", 179.4, effort={"episodes": 90_000}),
        made("blind", 173.0, runs={"0": 173.0, "1": 162.0, "2": 159.0}, effort={"steps": 3_000_000}),
        made("shipped", 183.2, runs={"0": 183.2}),
    ):
        each.write(tmp_path)
    page = "text\n<!-- results: HorseLeg-v0 return -->\nold\n<!-- end of results -->\nmore"
    text = filled(page, tmp_path)
    assert text.startswith("text\n")
    assert text.endswith("\nmore")
    assert "old" not in text
    lines = text.splitlines()
    (bold,) = [line for line in lines if "best without feedback" in line]
    assert "| 90,000 episodes | 179.4 |" in bold
    assert any(
        "blind agents, best run" in line and "median 162.0 of 3 (159.0 to 173.0)" in line for line in lines
    )
    assert any("shipped agent |" in line and "one run" in line for line in lines)
    assert filled(text, tmp_path) == text
    with pytest.raises(DataFileError, match=r"expected columns of return.*got retrun"):
        filled(page.replace("return", "retrun"), tmp_path)
    overview = filled("<!-- results: all -->\n<!-- end of results -->", tmp_path)
    assert "**179.4** (best gait locked to the crank)" in overview


@pytest.mark.parametrize("page", results.pages(), ids=lambda path: path.name)
def test_tables_on_pages_are_made_of_the_rows(page):
    text = page.read_text(encoding="utf-8")
    assert filled(text) == text, "run `python -m agents.results pages`"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_rows_have_their_policies(path):
    row = read_row(path)
    assert path.stem == row.name
    if row.kind == "stock":
        check_replay(row)
    else:
        assert row.digest == results.digest_of(row.policy, row.env_id)
    assert row.kind in ("zero", "run") or row.digest
    if row.runs and row.kind != "stock":
        assert max(row.runs.values()) >= row.mean["return"] - 0.05  # a table has one decimal


def test_a_row_of_the_repository_replays():
    check_replay(read_row(results.RESULTS / "HorseLeg-v0-open-loop.json"))

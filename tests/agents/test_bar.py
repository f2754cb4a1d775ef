"""The bar of an id: policies without feedback are proved blind, found by one command, and go on."""

import json

import numpy as np
import pytest

from agents import bar, open_loop, results, train
from agents.blindness import prove
from agents.runs import make_env
from hoof_env.envs.policies import Scripted
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.policies.find import find_policy

LEG = "hoof_env/HorseLeg-v0"
SHORT = {"episode_seconds": 2.0}
SEEDS = range(100, 108)


def policy_of(name, env_id=LEG, **kwargs):
    with make_env(env_id, **kwargs) as env:
        return find_policy(name, env, env_id)


@pytest.mark.parametrize(
    ("env_id", "name"),
    [
        (LEG, "run"),
        (LEG, "constant"),
        (LEG, "zero"),
        ("hoof_env/HorseLegRail-v0", "open-loop"),
        ("hoof_env/Horse-v0", "zero"),
    ],
)
def test_actions_of_another_ground_return_the_same_without_feedback(env_id, name):
    proof = prove(policy_of(name, env_id), env_id, SEEDS, SHORT)
    assert proof.difference == 0.0
    assert proof.elsewhere > 1.0  # the ground is another one indeed
    assert 2 * proof.episodes >= proof.of == 8


def test_a_policy_that_sees_the_ground_is_reported():
    with pytest.raises(DataFileError, match=r"actions that do not depend on the ground.*differ by up"):
        prove(policy_of("shipped"), LEG, SEEDS, SHORT)


def test_even_a_little_of_the_ground_is_found():
    """A load on the toe changes one of the actions by a thousandth."""
    with make_env(LEG) as env:
        place = env.unwrapped.observation_names.index("toe load")
    weak = Scripted(lambda seen, time: 1e-3 * seen[..., [place] * 4], 0.02)
    with pytest.raises(DataFileError, match="do not depend on the ground"):
        prove(weak, LEG, SEEDS, SHORT)


def test_a_glance_that_changes_no_whole_episode_is_found():
    """A policy that sees a load once, in a step of its own: its actions differ where the loads do."""
    with make_env(LEG) as env:
        place = env.unwrapped.observation_names.index("running peak force")
    glance = Scripted(lambda seen, time: (seen[..., [place] * 4] > 0.3) * (time == 0.6)[..., None], 0.02)
    with pytest.raises(DataFileError, match=r"with friction .* they differ by up to 1"):
        prove(glance, LEG, SEEDS, SHORT)


def test_ground_that_changes_nothing_proves_nothing():
    """A leg that never touches the ground."""
    with pytest.raises(DataFileError, match="expected episodes on other ground that prove something"):
        prove(policy_of("zero"), LEG, SEEDS, SHORT | {"hip_height": 3.0})


def test_blind_groups_are_all_that_depend_on_no_force():
    assert bar.blind_groups(LEG) == ["crank", "gait"]
    assert bar.blind_groups("hoof_env/HorseLegSpeed-v0") == ["crank", "gait", "target"]
    assert bar.blind_groups("hoof_env/HorseRough-v0") == ["target", "crank", "offset"]


def test_a_bar_that_sees_the_ground_is_refused(tmp_path):
    args = ["--env-id", LEG, "--observation", "crank", "gait", "trunk", "--out", str(tmp_path)]
    with pytest.raises(ParameterError, match=r"depend on no force, some of crank, gait.* got trunk"):
        bar.main(args)
    with pytest.raises(
        ParameterError, match=r"env_id: expected one of .*HorseLeg-v0.*got 'hoof_env/HorseLegs-v0'"
    ):
        bar.main(["--env-id", "hoof_env/HorseLegs-v0"])
    for seeds in ("0", "-1"):
        with pytest.raises(ParameterError, match=f"seeds: .*got {seeds}"):
            bar.main(["--seeds", seeds])
    assert not list(tmp_path.iterdir())


@pytest.fixture
def small(monkeypatch):
    """Searches of 16 candidates with 4 starts, and scores of few episodes."""
    monkeypatch.setattr(open_loop, "POPULATION", 16)
    monkeypatch.setattr(open_loop, "STARTS", 4)
    monkeypatch.setattr(open_loop, "ROWS", 64)
    monkeypatch.setattr(open_loop, "MOST", 1)
    monkeypatch.setattr(bar, "CHOOSING_SEEDS", range(500_000, 500_004))
    monkeypatch.setattr(bar, "FINAL_SEEDS", range(1_000_000, 1_000_004))
    monkeypatch.setattr(results, "FINAL_SEEDS", range(1_000_000, 1_000_004))


def test_one_command_finds_a_bar_and_goes_on_where_it_ended(small, tmp_path, monkeypatch):
    name = "HorseLegFixed-v0"
    args = ["--env-id", f"hoof_env/{name}", "--seeds", "2", "--steps", "2048", "--episodes", "192"]
    args += ["--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "rows")]
    bar.main(args)
    rows = {
        kind: results.read_row(tmp_path / "rows" / f"{name}-{kind}.json") for kind in ("open-loop", "blind")
    }
    assert set(rows["blind"].runs) == {"0", "1"}
    assert rows["blind"].effort == {"steps": 2048}
    assert rows["open-loop"].effort["episodes"] >= 3 * 192
    for row in rows.values():
        assert row.commit
        assert row.command.startswith("python")
        assert results.check_replay(row)
    record = json.loads((tmp_path / "rows" / "policies" / f"{name}-blind" / "run.json").read_text())
    assert record["env_kwargs"] == {"observation": ["crank", "gait"]}

    def again(*_):
        raise AssertionError("made again")

    monkeypatch.setattr(train, "main", again)
    monkeypatch.setattr(open_loop, "search_once", again)
    bar.main(args)
    assert results.read_row(tmp_path / "rows" / f"{name}-blind.json").mean == rows["blind"].mean


def test_a_replay_of_a_gait_is_the_gait(tmp_path):
    """In the real world the replayed actions give what the policy itself gets, step by step the same."""
    from agents.blindness import replay
    from hoof_env.evaluation.episodes import make_rows, play_rows

    policy = policy_of("run")
    real, other = (make_rows(LEG, 8, **SHORT, **ground) for ground in ({}, {"friction": 0.1}))
    own, here, there, whole, actions = replay(policy, real, other, SEEDS)
    assert whole.all()
    assert actions == 0.0
    np.testing.assert_array_equal(own, here)
    np.testing.assert_array_equal(own, [one["return"] for one in play_rows(real, policy, SEEDS)])
    assert (there != here).all()

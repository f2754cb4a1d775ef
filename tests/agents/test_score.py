"""Episodes as rows are the episodes one by one: returns and summaries, whatever the policy; and the command
that scores anybody's policy."""

import csv
import json
import shutil
import sys

import numpy as np
import pytest

from agents.runs import make_env
from hoof_env import cli
from hoof_env.envs.open_loop import open_loop
from hoof_env.envs.policies import Scripted
from hoof_env.errors import DataFileError
from hoof_env.evaluation import episodes as played
from hoof_env.evaluation import scores
from hoof_env.evaluation.episodes import play, score_vector
from hoof_env.policies.find import find_policy
from hoof_env.policies.record import environment_of
from hoof_env.tasks.observation import HIGH, LOW
from tests.agents.conftest import ENV_ID, KWARGS, SHORT

SEEDS = [7, 3, 4, 11, 12]
FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}


def one_by_one(name, env_id, seeds, **kwargs):
    with make_env(env_id, **kwargs) as env:
        return play(env, find_policy(name, env, env_id) if isinstance(name, str) else name, seeds)


@pytest.mark.parametrize("name", ["run", "idle", "bang-bang", "drag"])
def test_a_scripted_policy_to_the_bit(name, monkeypatch):
    monkeypatch.setattr(played, "ROWS", 3)  # two batches
    kwargs = {"episode_seconds": 0.8}
    assert score_vector(name, ENV_ID, SEEDS, **kwargs) == one_by_one(name, ENV_ID, SEEDS, **kwargs)


def test_episodes_that_fail_count_once_and_only_up_to_their_end():
    rows = score_vector("run", ENV_ID, SEEDS, **FALLS)
    assert len({one["seconds"] for one in rows}) > 1  # some went on while others were over
    assert all(one["failed"] for one in rows)
    assert rows == one_by_one("run", ENV_ID, SEEDS, **FALLS)


def test_a_trained_policy(trained):
    rows, alone = (
        found(str(trained.folder), ENV_ID, SEEDS, **KWARGS) for found in (score_vector, one_by_one)
    )
    for one, other in zip(rows, alone, strict=True):
        assert one == pytest.approx(other, rel=1e-3)


def test_held_gaits_for_all_or_for_each(env):
    gaits = np.random.default_rng(0).uniform(LOW, HIGH, (len(SEEDS), 4))
    rows = score_vector(open_loop({"constant": gaits}, env), ENV_ID, SEEDS, **KWARGS)
    for seed, gait, row in zip(SEEDS, gaits, rows, strict=True):
        assert one_by_one(open_loop({"constant": gait}, env), ENV_ID, [seed], **KWARGS) == [row]
        assert score_vector(open_loop({"constant": gait}, env), ENV_ID, [seed], **KWARGS) == [row]


def test_episodes_of_a_gait_start_in_it(env):
    """Its actions are zero from the first to the last, so it is the zero action that starts there, too."""
    zero = Scripted(lambda observation, time: np.zeros(4), 1.0, start={"gait": "run"})
    for policy in ("run", zero):
        rows = score_vector(policy, ENV_ID, SEEDS, **KWARGS)
        assert rows == one_by_one(policy, ENV_ID, SEEDS, **KWARGS)
        for seed, row in zip(SEEDS, rows, strict=True):
            env.reset(seed=seed, options={"gait": "run"})
            total, ended = 0.0, False
            while not ended:
                _, reward, failed, through, _ = env.step(np.zeros(4, np.float32))
                total, ended = total + reward, failed or through
            assert row["return"] == pytest.approx(total, abs=1e-9)


def test_an_environment_without_rows_is_played_one_by_one(monkeypatch):
    rows = score_vector("run", ENV_ID, SEEDS, **KWARGS)
    monkeypatch.setattr(played, "make_rows", lambda *_, **__: None)
    assert score_vector("run", ENV_ID, SEEDS, **KWARGS) == rows


# The command


def act(observations):
    """A policy that somebody wrote: pulls harder the slower it is."""
    return np.repeat(-0.1 * observations[:, :1], 4, axis=1)


def test_each_policy_gets_the_line_of_the_table(capsys, tmp_path, monkeypatch, trained):
    monkeypatch.setattr(scores, "FINAL_SEEDS", range(1_000_000, 1_000_005))
    other = shutil.copytree(trained.folder, tmp_path / "other")
    given = ["run", f"{__name__}:act", str(trained.folder), str(other)]
    options = ["--published", "--out", str(tmp_path / "all.csv"), "--env-kwargs", *SHORT]
    assert cli.main(["evaluate", *given, *options]) == 0
    where, _, head, _, *table = capsys.readouterr().out.splitlines()
    assert where == f"{ENV_ID} with {KWARGS}, episodes 1,000,000 to 1,000,004"
    assert [cell.strip() for cell in head.split("|")[1:4]] == ["policy", "return", "speed m/s"]
    assert [line.split("|")[1].strip() for line in table[:5]] == [*given[:4], "IQM of 2"]
    assert cli.main(["evaluate", *given[:3], "--published", "--env-kwargs", *SHORT]) == 0
    assert "IQM" not in capsys.readouterr().out
    episodes = score_vector("run", ENV_ID, range(1_000_000, 1_000_005), **KWARGS)
    mean = np.mean([one["return"] for one in episodes])
    assert f"| run | {mean:.1f} [" in table[0]
    with (tmp_path / "all.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 5
    assert [float(row["return"]) for row in rows[:5]] == [one["return"] for one in episodes]


def test_a_model_without_a_record_is_reported(trained, tmp_path, monkeypatch):
    monkeypatch.setattr(scores, "score_vector", lambda *_, **__: [])
    bare = shutil.copy(trained.folder / "model.zip", tmp_path / "bare.zip")
    shutil.copy(trained.folder / "vecnormalize.pkl", tmp_path)
    with pytest.warns(UserWarning, match=r"bare.zip: nothing says what it was trained for"):
        scores.evaluate([str(bare)], env_kwargs=KWARGS, published=True)


class TestIdsOfFiles:
    """No file makes a module be imported."""

    @pytest.fixture
    def gift(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "payload_of_a_gift", raising=False)
        (tmp_path / "payload_of_a_gift.py").write_text("import pathlib; pathlib.Path('ran').touch()\n")
        return "payload_of_a_gift"

    @pytest.mark.parametrize(
        "record",
        [
            {"env_id": "{}:strange/Id-v0"},
            {"env_id": "strange/Id-v0"},
            {"env_id": ENV_ID, "env_kwargs": {"task": "{}:strange/Id-v0"}},
            {"env_id": ENV_ID, "env_kwargs": []},
        ],
    )
    def test_one_that_is_not_registered_is_refused(self, gift, record):
        given = json.loads(json.dumps(record).replace("{}", gift))
        with pytest.raises(DataFileError, match=r"a\.onnx: .*(--env-id|arguments by name)"):
            environment_of("a.onnx", given)
        assert gift not in sys.modules

    def test_a_registered_one_is_found_without_the_module(self, gift):
        assert environment_of("a", {"env_id": f"{gift}:{ENV_ID}"}) == (ENV_ID, {})
        kwargs = {"task": f"{gift}:CartPole-v1"}
        asked = environment_of("a", {"env_id": ENV_ID, "env_kwargs": kwargs})
        assert asked == (ENV_ID, {"task": "CartPole-v1"})
        assert gift not in sys.modules

    def test_a_user_may_name_a_module(self):
        record = {"env_id": "mine:own/A-v0", "env_kwargs": {"dt": 0.02}}
        assert environment_of("a", record, "mine:own/A-v0") == ("mine:own/A-v0", {"dt": 0.02})
        assert environment_of("a", record, "own/A-v0") == ("own/A-v0", {"dt": 0.02})
        assert environment_of("a", record, "own/B-v0") == ("own/B-v0", {})
        assert environment_of("a", {}, None) == (None, {})

"""Force records: what a file says is what happened, and every bad request is one clear error."""

from __future__ import annotations

import json
import math
import sys

import gymnasium as gym
import numpy as np
import pytest

from hoof_env import __version__, cli, records
from hoof_env.constants import GRAVITY
from hoof_env.dynamics.layout import TRUNK_STATE
from hoof_env.envs.open_loop import GAITS, open_loop_record
from hoof_env.envs.policies import make_policy, start_of
from hoof_env.errors import parse_pairs
from hoof_env.gait import PARAMETERS, load_gait
from hoof_env.lab.opensim import MOT_COLUMNS
from hoof_env.lab.read import read_record
from hoof_env.leg.geometry import load_geometry
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.records import (
    RECORD,
    default_policy,
    describe,
    export_episode,
    find_policy,
    make_env,
    record_episode,
    write,
)
from tests.legs import FIRST_FIT, OLD_HORSE

LEG, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"
LOOSE = OLD_HORSE | {"trunk_drag": 0.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}
"""Its run bears the trunk alone."""


@pytest.fixture(scope="module")
def episode():
    with make_env(LEG, LOOSE) as env:
        record = record_episode(env, make_policy("run", env), seed=3, seconds=2.0, options={"gait": "run"})
        return record, describe(env, environment=LEG, policy="run", seed=3)


def read_mot(path) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Header and columns, as the format is described: key=value lines, endheader, names, rows."""
    lines = path.read_text(encoding="utf-8").splitlines()
    end = lines.index("endheader")
    header = dict(line.split("=") for line in lines[1:end])
    table = np.array([[float(cell) for cell in line.split("\t")] for line in lines[end + 2 :]])
    return header, dict(zip(lines[end + 1].split("\t"), table.T, strict=True))


def test_a_record_has_every_substep_and_every_column(episode):
    record, about = episode
    assert set(record) == set(RECORD) == set(about["units"])
    np.testing.assert_allclose(record["time"], np.arange(2001) / 1000, atol=1e-9)
    assert all(column.shape == (2001,) and np.isfinite(column).all() for column in record.values())
    json.dumps(about, allow_nan=False)


def test_csv_has_units_in_its_header_and_keeps_every_bit(episode, tmp_path):
    record, about = episode
    path = write(record, about, tmp_path / "new" / "run.csv")
    header = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    assert header == [f"{name} [{RECORD[name]}]" for name in record]
    assert "force_y [N]" in header
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    for name, column in zip(record, table.T, strict=True):
        np.testing.assert_array_equal(column, record[name], err_msg=name)


def test_parquet_has_units_version_and_geometry(episode, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    record, about = episode
    table = parquet.read_table(write(record, about, tmp_path / "run.parquet"))
    assert table.column_names == list(record)
    for name in record:
        np.testing.assert_array_equal(table[name].to_numpy(), record[name])
        assert table.schema.field(name).metadata == {b"unit": RECORD[name].encode()}
    said = json.loads(table.schema.metadata[b"hoof_env"])
    assert said["hoof_env"] == __version__
    assert said["geometry"] == load_geometry(FIRST_FIT).to_dict()
    assert (said["environment"], said["policy"], said["seed"]) == (LEG, "run", 3)


def test_opensim_reads_mot(episode, tmp_path):
    record, about = episode
    header, columns = read_mot(write(record, about, tmp_path / "run.mot"))
    own = {"version": "1", "nRows": "2001", "nColumns": "10", "inDegrees": "yes"}
    assert header == own | {"weight_n": f"{about['weight_n']:.10g}"}
    assert [*columns] == ["time", *MOT_COLUMNS]
    for name, source in (("vx", "force_x"), ("vy", "force_y"), ("px", "cop_x"), ("py", "cop_y")):
        np.testing.assert_allclose(columns[f"ground_force_{name}"], record[source], rtol=1e-9)
    np.testing.assert_allclose(columns["time"], record["time"], rtol=1e-9)
    for name in ("force_vz", "force_pz", "torque_x", "torque_y", "torque_z"):
        assert not columns[f"ground_{name}"].any()


def test_the_header_of_mot_states_weight_and_threshold(episode, tmp_path):
    record, about = episode
    path = write(record, about | {"threshold_n": 50.0}, tmp_path / "run.mot")
    header, _ = read_mot(path)
    assert float(header["threshold_n"]) == 50.0
    assert read_record(path).weight == pytest.approx(about["weight_n"])


def test_csv_in_body_weights_keeps_the_weight(tmp_path):
    out = tmp_path / "run.csv"
    _, weight = export_episode(out, "run", LEG, seconds=0.4, units="BW")
    found = read_record(out)
    assert (found.unit, found.weight) == ("BW", weight)


def test_in_swing_force_and_its_place_are_zero(episode):
    record, _ = episode
    swing = record["toe_normal"] + record["heel_normal"] == 0
    assert 0.2 < swing.mean() < 0.9
    for name in ("force_x", "force_y", "cop_x", "cop_y"):
        assert not record[name][swing].any()
        assert record[name][~swing].any()
    under = np.abs(record["cop_x"] - record["x"])[~swing]
    assert under.max() < 2.0  # the foot is where the animal is


def test_the_impulse_in_the_file_is_the_change_of_momentum(episode, tmp_path):
    """Over one turn of the crank the leg comes back to where it was, so all of it has sped up by as much."""
    record, about = episode
    _, columns = read_mot(write(record, about, tmp_path / "run.mot"))
    mass = LOOSE["trunk_mass"] + load_geometry(FIRST_FIT).mass
    first, last = 700, 1700  # the run's crank turns once a second
    turn = record["crank_angle"][last] - record["crank_angle"][first]
    assert turn == pytest.approx(2 * math.pi, abs=1e-6)
    step = np.diff(columns["time"][first : last + 1])
    for name, speed, other in (("vx", "vx", 0.0), ("vy", "vy", -0.8 * mass * GRAVITY)):
        impulse = (step * columns[f"ground_force_{name}"][first:last]).sum() + other
        change = mass * (record[speed][last] - record[speed][first])
        assert abs(change) > 5
        assert impulse == pytest.approx(change, abs=0.02 * abs(change) + 0.5)


@pytest.mark.parametrize("solver", ["exact", "paper"])
def test_the_fixed_leg_is_recorded_too(solver, tmp_path):
    out = tmp_path / "walk.csv"
    assert cli.main(
        ["export", "--out", str(out), "--env-id", FIXED, "--env-kwargs", f"solver={solver}",
         "--policy", "walk", "--seconds", "0.1"]
    ) == 0  # fmt: skip
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    assert len(table) == (101 if solver == "paper" else 1001)


def test_an_episode_that_ends_early_ends_its_record(tmp_path):
    for name in ("one.csv", "two.csv"):
        assert export_episode(tmp_path / name, "run", LEG, ["episode_seconds=0.1"])[0] == 101
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()


def test_a_step_that_failed_is_not_recorded():
    """The environment keeps its last good state and shows it again; a record must not say it twice."""
    with make_env(LEG) as env:
        run = make_policy("run", env)

        class Breaks:
            steps = 0

            def predict(self, observation, **options):
                self.steps += 1
                if self.steps == 4:
                    state = env.unwrapped.get_state()
                    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
                    env.unwrapped.set_state(state)
                return run.predict(observation, **options)

        record = record_episode(env, Breaks(), 0)
    assert len(record["time"]) == 61
    assert (np.diff(record["time"]) > 0).all()


def test_policies_by_name_and_by_four_numbers():
    with make_env(LEG) as env:
        constant = find_policy("6.0,0.7,-0.2,-0.3", env, LEG)
        record = record_episode(env, constant, 0, 0.2)
        for name, value in zip(PARAMETERS, (6.0, 0.7, -0.2, -0.3), strict=True):
            assert (record[f"command_{name}"] == value).all(), name
        assert (record["crank_angle_rate"] == 6.0).all()
        seen, _ = env.reset(seed=0)
        assert find_policy("idle", env, LEG).predict(seen)[0].shape == (4,)


def column_of(table, name):
    """Of a .csv, whose header has the units."""
    return next(table[key] for key in table.dtype.names if key.startswith(f"{name}_["))


@pytest.mark.parametrize(
    ("env_id", "given", "name"),
    [(LEG, {}, "run"), (LEG, {"preset": "klann"}, "run"), ("hoof_env/Horse-v0", {}, "reference")],
)
def test_the_policy_that_plays_if_none_is_named(env_id, given, name):
    with make_env(env_id, given) as env:
        assert default_policy(env) == name
        played = [find_policy(each, env, env_id) for each in (None, name)]
        assert start_of(played[0]) == start_of(played[1])
        seen, _ = env.reset(seed=0, options=start_of(played[0]))
        np.testing.assert_array_equal(*(policy.predict(seen)[0] for policy in played))


@pytest.mark.parametrize("env_id", [LEG, FIXED])
@pytest.mark.parametrize("name", ["run", "walk", "carrying_walk"])
def test_the_commands_start_in_the_gait_that_they_name(tmp_path, env_id, name):
    """And keep it, also where episodes start in another one: no gait is clipped."""
    out = tmp_path / "x.csv"
    command = ["export", "--out", str(out), "--env-id", env_id, "--policy", name, "--seconds", "0.1"]
    assert cli.main(command) == 0
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    for parameter, value in vars(load_gait(name)).items():
        np.testing.assert_array_equal(column_of(table, f"command_{parameter}"), value)
    np.testing.assert_array_equal(column_of(table, "crank_angle_rate"), load_gait(name).crank_speed)


def test_the_run_on_the_fixed_trunk_is_the_papers(tmp_path):
    """Peak and mean of the normal force, by the exact solver, over the stride that an episode lasts."""
    out = tmp_path / "run.csv"
    assert cli.main(["export", "--out", str(out), "--env-id", FIXED, "--policy", "run"]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    normal = column_of(table, "toe_normal") + column_of(table, "heel_normal")
    assert round(normal.max()) == 5697
    assert round(normal[1:].mean()) == 809  # the first row is the start


def test_a_gait_of_a_file_is_gone_to(tmp_path):
    """From the gait that the episode starts in, and not begun with."""
    path = tmp_path / "gait.json"
    wanted = [4.0, 0.6, -0.1, 0.1]
    path.write_text(json.dumps({"env_id": LEG, "form": "gait", "parameters": {"constant": wanted}}))
    with make_env(LEG) as env:
        record = record_episode(env, find_policy(str(path), env, LEG), 0, 2.0)
    for name, value in zip(PARAMETERS, wanted, strict=True):
        assert abs(record[f"command_{name}"][0] - value) > 0.01
        assert record[f"command_{name}"][-1] == pytest.approx(value, abs=1e-4)


def test_the_commands_play_the_gait_of_a_file_and_the_best_of_the_repository(tmp_path):
    best = max(
        GAITS.glob("HorseLeg-v0-*.json"), key=lambda path: open_loop_record(path)["score"]["mean"]["return"]
    )
    for name, policy in (("file", str(best)), ("name", "open-loop")):
        out = str(tmp_path / f"{name}.csv")
        assert cli.main(["export", "--out", out, "--policy", policy, "--seconds", "0.1"]) == 0
    assert (tmp_path / "file.csv").read_bytes() == (tmp_path / "name.csv").read_bytes()


def test_a_trained_model_without_its_library(tmp_path, capsys, monkeypatch):
    """A .zip needs it, in one line; plain data are played by NumPy."""
    run = tmp_path / "run"
    run.mkdir()
    for name in ("policy.json", "policy.safetensors", "run.json"):
        (run / name).write_bytes((SHIPPED / "HorseLeg-v0" / name).read_bytes())
    (run / "model.zip").touch()  # beside which the plain data are read
    (tmp_path / "alone.zip").touch()
    command = ["export", "--seconds", "0.1", "--policy"]
    for library in ("stable_baselines3", "safetensors", "safetensors.torch"):
        monkeypatch.setitem(sys.modules, library, None)
    assert cli.main([*command, str(tmp_path / "alone.zip"), "--out", str(tmp_path / "x.csv")]) == 2
    said = capsys.readouterr().err
    assert 'reading it needs pip install "hoof-env[train]"' in said
    assert said.count("\n") == 1
    for name, policy in (("a.csv", str(run)), ("b.csv", "shipped")):
        assert cli.main([*command, policy, "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_arguments_are_pairs_or_objects():
    assert parse_pairs("--env-kwargs", ["trunk=rail", "dt=0.01", '{"preset": null}']) == {
        "trunk": "rail", "dt": 0.01, "preset": None,
    }  # fmt: skip


def test_a_wrapped_environment_is_recorded_alike(episode):
    with gym.make(LEG, **LOOSE) as env:
        wrapped = gym.wrappers.RecordEpisodeStatistics(env)
        again = record_episode(wrapped, make_policy("run", wrapped), 3, 0.5, {"gait": "run"})
    for name, column in again.items():
        np.testing.assert_array_equal(column, episode[0][name][: len(column)], err_msg=name)


def test_a_long_one_says_how_far_it_is(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(records, "TELL_SECONDS", 0.0)
    export_episode(tmp_path / "a.csv", "idle", "hoof_env/HorseLeg-v0", seconds=0.06)
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if "of at most 0.06 s" in line][-1].startswith("0.1 of")

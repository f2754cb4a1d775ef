"""Agents that choose their footfall: what they pay, with which gaits they begin, and what the page says."""

import json

import numpy as np
import pytest
from foreign import CUT, FOREIGN

import hoof_env
from agents import gait_agents, gait_task
from agents import gait_agents_page as page
from agents.gait_agents import CONTROL, NONE, Agent, Herd
from agents.gait_map import OBJECTIVES, SCALES, Map, jumps_between
from agents.gait_rig import Rig
from agents.horse_gaits import speed_of
from agents.searched_horse import FOUND, SEED, WalkingHorse, searched
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.evaluation.episodes import make_rows

NUMBERS = ("peak", "loading", "transport", "lag", "duty_fore", "stride_over_hip")


def test_a_horse_that_has_learnt_nothing_plays_the_searched_gaits():
    rig = Rig(gait_agents.CHECKED, gait_task.id_of("walk"), num_threads=1)
    row = next(
        row
        for row in Map(FOUND).rows
        if (row["kind"], row["froude"], row["seed"], row["objective"]) == ("walk", 0.35, SEED, "mixture")
    )
    speed = speed_of(0.35)
    gait = rig.envs.body.reference(np.array([speed]))
    zero = hoof_env.load_policy(lambda seen: np.zeros((len(seen), 16)), single())
    figures = rig.play(gait, speed, gait_agents.FIRST_START, gait_agents.CHECKED, policy=zero)
    for name in NUMBERS:
        assert figures[name][0] == pytest.approx(row[name], rel=0.02)


def single():
    """An environment of the task."""
    import gymnasium as gym

    return gym.make(gait_task.id_of("walk")).unwrapped


def test_strides_of_searched_gaits_are_kept_between_their_speeds():
    horse = single().body
    assert isinstance(horse, WalkingHorse)
    speeds, gaits = searched("walk")
    np.testing.assert_allclose(horse.reference(speeds), gaits)
    near = horse.reference(speeds * 1.03)
    np.testing.assert_allclose(near[:, 0] / gaits[:, 0], 1.03)
    np.testing.assert_array_equal(near[:, 1:], gaits[:, 1:])


def test_what_is_charged_is_what_is_measured():
    n, seconds = 8, 4.0
    envs = make_rows(gait_task.id_of("trot"), n, num_threads=1, target_speed=2.0)
    envs.reset(seed=0)
    names = {"stance_peaks": "peak", "steepest_rises": "loading"}
    charged = dict.fromkeys(names, 0.0)
    sums = {"peak_grf_increase": 0.0, "loading_rate_increase": 0.0, "stances": 0.0}
    for _ in range(round(seconds / envs.dt)):
        _, _, failed, _, infos = envs.step(np.zeros((n, 16), np.float32))
        assert not failed.any()
        for name in names:
            charged[name] -= infos["unweighted"][name].mean() / seconds
        for name in sums:
            sums[name] += np.mean(
                [infos["measured"][f"{leg}_{name}"] for leg in gait_task.LEGS], axis=1
            ).sum()
    mean = {name: sums[name] / sums["stances"] / envs.weight[0] for name in [*sums][:2]}
    # A stance may be cut off at the ends
    assert charged["stance_peaks"] == pytest.approx(mean["peak_grf_increase"], rel=0.1)
    assert charged["steepest_rises"] == pytest.approx(mean["loading_rate_increase"], rel=0.1)


def test_an_objective_is_charged_over_its_scales():
    for objective, figures in OBJECTIVES.items():
        weights = gait_task.weights_of(objective)
        for figure, term in gait_task.TERMS.items():
            share = 1 / len(figures) / SCALES[figure] if figure in figures else 0.0
            assert weights[term] == pytest.approx(gait_task.SPARED * share)


def test_a_body_must_be_a_function():
    with pytest.raises(ParameterError, match="body: expected a function of settings, got 3"):
        hoof_env.register("mine/Bad-v0", base="horse", body=3)


def rows_of(agent, lags, **changed):
    """Rows of an agent that counts, with lags at all speeds."""
    figures = {
        "reached": 1.0, "fell": 0.0, "speed_ratio": 1.0, "slip_fore": 0.05, "slip_hind": 0.05,
        "stances_per_turn_fore": 1.0, "stances_per_turn_hind": 1.0, "stride_over_hip": 1.3,
        "duty_fore": 0.5, "duty_hind": 0.5, "transport": 1.0, "peak": 1.0, "loading": 30.0,
    } | changed  # fmt: skip
    return [
        agent._asdict() | {"froude": froude} | figures | {"lag": lag, "commit": "1"}
        for froude, lag in zip(gait_agents.FROUDES, lags, strict=True)
    ]


def made():
    """Rows of two agents for each objective: walks that change to a trot at 0.35 to 0.45, and trots."""
    count = len(gait_agents.FROUDES)
    changing = [0.25 if froude < 0.4 else 0.01 for froude in gait_agents.FROUDES]
    rows = []
    for objective in (NONE, CONTROL, *OBJECTIVES):
        walk = [0.25] * count if objective == NONE else changing
        rows += rows_of(Agent("walk", objective, 0), walk)
        rows += rows_of(Agent("trot", objective, 0), [0.49] * count, transport=2.0)
    return rows


def test_every_objective_has_the_same_seeds_from_walks_and_from_trots():
    agents = gait_agents.all_agents()
    for start in gait_task.STARTS:
        for objective in OBJECTIVES:
            own = [agent.seed for agent in agents if agent[:2] == (start, objective)]
            assert own == [*range(gait_agents.SEEDS)]
    assert len({agent.folder for agent in agents}) == len(agents)


def test_jumps_and_what_is_inherited_are_told():
    rows = made()
    agent = Agent("walk", "work", 0)
    (jump,) = jumps_between(page.lags_of(rows, agent))
    assert jump == pytest.approx((0.35, 0.45, 0.25, 0.01))
    assert page.between_starts(rows, NONE) == pytest.approx(0.24)
    assert page.between_starts(rows, "work") == pytest.approx((5 * 0.24 + 4 * 0.02) / 9)
    assert page.moved(rows, "work", CONTROL) == pytest.approx(0.0)
    assert page.moved(rows, CONTROL, NONE) == pytest.approx(4 * 0.24 / 9 / 2)
    assert page.best_at(rows, "work", 0.2) == "walk"
    assert page.best_at(rows, "peak", 0.2) == "equal"
    text = page.told(rows)
    assert "The lag of an agent jumps somewhere in 1 of 2 by mixture, 1 of 2 by work" in text
    assert "touch 0.35 to 0.5, where horses change, in 1 by mixture, 1 by work" in text
    assert "from walks to trots and between speeds that touch 0.35 to 0.5, by nothing over all seeds" in text
    assert "less than agents that spare nothing by 0 % mixture, 0 % work" in text
    # The other gait pays from 0.45 on
    for row in rows:
        if row["objective"] == "work" and row["start"] == "trot" and row["froude"] > 0.4:
            row["transport"] = 0.5
    assert page.beginning_changes_as_horses(rows, "work")
    assert page.steps_of(rows, "walk", "work") == pytest.approx([-0.24])
    assert "null" not in text
    # What does not count is no gait
    for row in rows:
        row["slip_hind"] = 0.2
    assert page.lags_of(rows, agent) == []
    assert page.best_at(rows, "work", 0.2) == "none"


def test_agents_are_trained_once_and_their_page_is_written(tmp_path, monkeypatch, capsys):
    tiny = gait_agents.settings() | {"n_envs": 8, "n_steps": 16, "n_timesteps": 128, "batch_size": 64}
    monkeypatch.setattr(gait_agents, "settings", lambda: tiny)
    monkeypatch.setattr(gait_agents, "FROUDES", (0.2, 0.35, 0.45, 0.6))
    monkeypatch.setattr(page, "FROUDES", (0.2, 0.35, 0.45, 0.6))
    few = [Agent(start, objective, 0) for objective in (NONE, "peak") for start in gait_task.STARTS]
    monkeypatch.setattr(gait_agents, "all_agents", lambda: few)
    monkeypatch.setattr(gait_agents, "RUNS", tmp_path / "runs")
    monkeypatch.setattr(gait_agents, "CHECKED", 2)
    path = tmp_path / "agents.json"
    herd = gait_agents.complete(path)
    assert len(herd.rows) == 4 * len(few)
    text = path.read_text()
    capsys.readouterr()
    again = gait_agents.complete(path)
    assert capsys.readouterr().out == f"{path}: has 4 of 4 agents\n"
    assert path.read_text() == text
    assert again.rows == herd.rows
    assert again.steps == 128
    written = page.section(again, "gait_change", tmp_path)
    assert "128 steps each" in written
    assert "nan" not in written
    assert (tmp_path / "agents.png").stat().st_size > 5000
    assert page.section(Herd(tmp_path / "none.json"), "gait_change", tmp_path) == ""


def content(**changes):
    """Content of a file of agents."""
    rows = made()
    whole = {"versions": {}, "steps": 1, "columns": [*rows[0]], "rows": [[*row.values()] for row in rows]}
    return json.dumps(whole | changes)


@pytest.mark.parametrize("text", [CUT, *FOREIGN, content(columns=["froude"]), content(steps="many")])
def test_other_files_are_refused(text, tmp_path):
    path = tmp_path / "agents.json"
    path.write_text(text)
    with pytest.raises(DataFileError, match=r"agents\.json: expected "):
        Herd(path)
    assert path.read_text() == text

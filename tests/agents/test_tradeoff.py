"""The trade-off: the sweep is what environments take, fronts and stances are what they are said to be."""

import csv
import json
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml

from agents import impact, runs, tradeoff, tradeoff_front, tradeoff_gait, tradeoff_impact
from agents.baselines_plan import LEG, Run, runs_of
from agents.baselines_results import wanted
from agents.baselines_run import FINAL
from agents.command import parse_pairs
from agents.impact import Episode, steepest, watch
from agents.tradeoff_front import LEARNED, Point, best, not_dominated
from agents.tradeoff_impact import Frozen
from agents.tradeoff_plan import DEFAULT, FULL, QUICK, SLOW
from hoof_env.envs.reward import RewardWeights
from hoof_env.errors import DataFileError

SHIPPED = Path("agents/policies")

# The plan


@pytest.mark.parametrize("plan", [FULL, QUICK], ids=["full", "quick"])
def test_every_reward_is_one_that_the_environment_takes(plan):
    every = list(runs_of((*plan.entries, plan.commanded)))
    assert len({one.name for one in every}) == len(every)
    for entry in plan.entries:
        kwargs = parse_pairs("", entry.env_kwargs)
        runs.make_env(entry.env_id, **kwargs).close()
        assert (RewardWeights.of(kwargs.get("reward_weights")) == RewardWeights()) == (entry.label == DEFAULT)
    assert {plan.entry(SLOW), plan.entry(DEFAULT)} <= set(plan.entries)


# Fronts


def test_what_no_other_row_beats():
    costs = [[1, 3], [2, 2], [2, 3], [3, 1], [3, 1], [0, np.nan]]
    assert not_dominated(costs).tolist() == [True, True, False, True, True, False]


def test_the_best_is_as_fast_as_asked():
    slow, fast, unknown = (
        Point(LEARNED, "", 0, {"speed_m_s": v, "stance_peak_n": f})
        for v, f in ((2.96, 1.0), (3.5, 2.0), (9.0, np.nan))
    )
    points = [fast, unknown, slow]
    assert best(points, "stance_peak_n", 3.0) is slow  # but for so little that it does not count
    assert best(points, "stance_peak_n", 3.1) is fast
    assert best(points, "stance_peak_n", 4.0) is None


# Stances


def test_the_steepest_rise_is_over_five_milliseconds():
    force = np.r_[np.zeros(10), np.arange(1.0, 11.0) * 20, np.full(10, 200.0)]
    assert steepest(force, 1e-3) == pytest.approx(20e3)
    assert steepest(np.r_[0.0, 0.0, 50.0, 50.0, 50.0, 50.0], 1e-3) == pytest.approx(10e3)  # a jump
    assert steepest(force[:1], 1e-3) == 0


def flat_episode(normal) -> Episode:
    """An episode of one force on the toe, in which all else stands still."""
    n = len(normal)
    names = ("heel_normal", "toe_friction", "heel_friction", "toe_y", "heel_y", "heel_x", "toe_slide",
             "heel_slide", "toe_rate", "heel_rate", "toe_slowness", "heel_slowness")  # fmt: skip
    record = {name: np.zeros(n) for name in names}
    record |= {
        "toe_normal": np.asarray(normal, float),
        "toe_x": np.ones(n),
        "theta_rate": np.arange(float(n)),
    }
    return Episode(record, weight=1000.0, dt=1e-3, failed=False)


def test_whole_stances_alone_count():
    force = np.zeros(100)
    force[:5] = force[95:] = 500.0  # began before, ends after
    force[20:30] = 300.0
    force[40] = 40.0  # grazes, less than 5 % of the weight
    force[60:80], force[65] = 200.0, 900.0
    found = flat_episode(force)
    assert found.stances.tolist() == [[20, 30], [60, 80]]
    figures = found.per_stance()
    assert figures["peak"] == pytest.approx([300, 900])
    assert figures["to_peak"] == pytest.approx([0, 5e-3])
    assert figures["duration"] == pytest.approx([10e-3, 20e-3])
    assert figures["crank_down"] == pytest.approx([20, 60])
    assert figures["crank_highest"] == pytest.approx([29, 79])


def test_the_run_meets_the_ground_as_its_record_says():
    (run,) = watch("run", LEG, [1000], episode_seconds=6.0)
    figures = run.figures()
    assert len(run.stances) >= 2
    assert [figures["crank_stance"], figures["crank_swing"]] == pytest.approx([2 * np.pi] * 2)
    first = run.stances[0, 0]
    assert figures["hoof_angle"] > 0.1  # toe first
    falling = -np.diff(run.record["toe_y"])[first - 20 : first] / run.dt
    assert falling.min() < run.per_stance()["approach"][0] < falling.max()
    seen = run.curves()["force"]
    assert seen[:, -round(impact.AROUND[0] / run.dt)] == pytest.approx(0.05, abs=0.02)


def test_a_harder_ground_loads_faster():
    rates = [
        impact.mean_figures(watch("run", LEG, [1000], episode_seconds=5.0, stiffness=by * 2e4))[
            "loading_rate"
        ]
        for by in (0.25, 4.0)
    ]
    assert rates[1] > 1.5 * rates[0]


def test_what_is_held_does_not_follow_the_policy():
    class Counting:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.full((*np.shape(observation)[:-1], 4), 0.5, np.float32), 7

    held = Frozen(Counting(), np.full(4, -1, np.float32), np.array([True, False, False, False]))
    action, state = held.predict(np.zeros((3, 5)))
    assert action.tolist() == [[-1, 0.5, 0.5, 0.5]] * 3
    assert state == 7


# The page


@pytest.fixture
def plan(tmp_path):
    """Trainings that are done, as far as the page can tell: shipped policies under their names."""
    made = replace(
        QUICK, folder=tmp_path / "runs", page=tmp_path / "page.md", speeds=(2.0,), factors=(1.0, 2.0)
    )  # fmt: skip
    one = {"return": 1.0, "speed_m_s": 3.0, "peak_grf_n": 4e3, "stance_peak_n": 3e3, "weight_share": 0.5,
           "failed": 0.0, "cost_of_transport": 0.5, "distance_m": 30.0, "drive_work_j": 12855.0,
           "mean_grf_n": 428.5, "stance_peak_sum_n": 36e3}  # fmt: skip
    for entry in (*made.entries, made.commanded):
        folder = made.folder / Run(entry, 0).name
        shutil.copytree(SHIPPED / entry.env_id.rpartition("/")[2], folder)
        (folder / "config.yml").write_text(yaml.safe_dump({entry.env_id: wanted(entry)}))
        final = {"seed": 0, "steps": 5, "cpu_s": 1.0, "episodes": [one],
                 "env_kwargs": parse_pairs("", entry.env_kwargs)}  # fmt: skip
        (folder / FINAL).write_text(json.dumps(final))
    return made


def test_the_page_says_what_was_done(plan, monkeypatch):
    short = partial(watch, episode_seconds=2.0)
    monkeypatch.setattr(tradeoff_gait, "watch", short)
    monkeypatch.setattr(tradeoff_impact, "watch", short)
    for module in (tradeoff_front, tradeoff_impact):
        monkeypatch.setattr(module, "FINAL_SEEDS", range(2))
    text = tradeoff.report(plan).read_text()
    assert "| learned cheap-4 | 3.00 | 3.00 | 4.00 | 1.20 | 0.500 | 0.50 |" in text
    assert "| learned | 2 |" in text.partition("<!-- stiffness -->")[2]
    assert "is no result" in text
    beside = plan.page.with_suffix("")
    assert {path.name for path in beside.glob("*.png")} == {
        "front.png",
        "speed.png",
        "stiffness.png",
        "impact.png",
    }
    with (beside / "front.csv").open() as file:
        rows = {(row["kind"], row["name"]): row for row in csv.DictReader(file)}
    assert float(rows["learned", DEFAULT]["weight_share"]) == 0.5
    assert rows["paper", "walk"]["cost_of_transport"] == ""  # it goes backward
    assert {"learned", "paper", "open-loop"} == {kind for kind, _ in rows}
    with (beside / "stiffness.csv").open() as file:
        assert [row["stiffness"] for row in csv.DictReader(file)] == ["1", "2"] * 3


def test_what_is_missing_is_named(plan):
    (plan.folder / Run(plan.commanded, 0).name / FINAL).unlink()
    with pytest.raises(DataFileError, match=r"ppo-HorseLegSpeed-v0: .*found none"):
        tradeoff.report(plan)


def test_a_training_of_another_reward_is_refused(plan):
    path = plan.folder / Run(plan.entry(SLOW), 0).name / FINAL
    path.write_text(json.dumps(json.loads(path.read_text()) | {"env_kwargs": {}}))
    with pytest.raises(DataFileError, match="outdated"):
        tradeoff.report(plan)

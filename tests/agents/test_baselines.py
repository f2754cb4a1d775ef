"""The baselines: the plan is what is asked, trainings go on where they stopped, the page says so."""

import csv
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import yaml

import hoof_env  # noqa: F401  registers the ids
from agents import baselines, baselines_report, baselines_results, baselines_run
from agents.baselines_results import (
    MATCHED_SPEED,
    Scored,
    dominates,
    expected_settings,
    iqm,
    over_episodes,
    read_results,
    references,
    scaled_runs,
    seeds_that_dominate,
    verdict,
)
from agents.baselines_run import (
    CURVE,
    FINAL,
    LEG,
    PLANS,
    Args,
    Entry,
    Run,
    load_plan,
    read_curve,
    runs_of,
    train_one,
)
from agents.evaluate import Interval
from agents.score import CURVE_SEEDS, FINAL_SEEDS, mean_figures, score_vector
from agents.settings import FOLDER, load_settings
from hoof_env.errors import DataFileError, ParameterError
from tests.agents.conftest import SHORT, TINY

ROOT = Path(__file__).resolve().parents[2]

# The plan


def test_the_full_plan_is_what_is_asked():
    counted = {(one.algo, one.env_id): one.seeds for one in load_plan("full") if not one.label}
    assert {key: n for key, n in counted.items() if key[1] == LEG} == {
        (algo, LEG): 10 for algo in ("ppo", "sac", "td3", "tqc")
    }
    single = {name for name in gym.registry if name.startswith("hoof_env/") and "MO" not in name}
    assert {env_id for algo, env_id in counted if algo == "ppo"} == single
    assert all(counted["ppo", env_id] == 5 for env_id in single - {LEG})


@pytest.mark.parametrize("plan", [load_plan(path.stem) for path in PLANS.glob("*.yml")])
def test_no_training_starts_from_a_scored_seed_or_shares_a_folder(plan):
    every = list(runs_of(plan))
    assert len({one.name for one in every}) == len(every) == sum(entry.seeds for entry in plan)
    for one in every:
        rows = load_settings(FOLDER / f"{one.entry.algo}.yml", one.entry.env_id)["n_envs"]
        assert one.seed + rows <= CURVE_SEEDS.start < CURVE_SEEDS.stop <= FINAL_SEEDS.start


def test_the_matched_speed_is_the_runs_and_no_less():
    speed = references(LEG)["run"].intervals["speed_m_s"]
    assert speed.high < MATCHED_SPEED < 1.1 * speed.mean
    for plan in ("full", "nightly"):
        (entry,) = (one for one in load_plan(plan) if one.label == "matched")
        assert entry.env_kwargs == {"target_speed": [MATCHED_SPEED, MATCHED_SPEED]}


def test_a_plan_that_is_none(tmp_path, monkeypatch):
    monkeypatch.setattr(baselines_run, "PLANS", tmp_path)
    for text in ("- {algo: ppo}", "3", "- {"):
        (tmp_path / "full.yml").write_text(text)
        with pytest.raises(DataFileError, match=r"full\.yml: expected a list of entries"):
            load_plan("full")


def test_a_training_is_told_its_arguments_as_the_command_takes_them():
    entry = Entry("ppo", LEG, 1, env_kwargs={"target_speed": [2.1, 2.1]}, label="matched")
    words = Run(entry, 3).command(Path("out"))
    assert words[words.index("--out") + 1] == str(Path("out", "ppo-HorseLeg-v0-matched-s3"))
    assert words[-2:] == ["--env-kwargs", "target_speed=[2.1, 2.1]"]


def test_the_cost_of_transport_is_that_of_the_whole():
    one = {"distance_m": 10.0, "drive_work_j": 800.0, "mean_grf_n": 400.0, "weight_share": 0.5,
           "return": 1.0, "cost_of_transport": 0.1}  # fmt: skip
    back = {**one, "distance_m": -5.0, "cost_of_transport": np.inf}
    assert mean_figures([one])["cost_of_transport"] == pytest.approx(0.1)
    assert mean_figures([one, back])["cost_of_transport"] == pytest.approx(1600 / 800 / 5)
    assert np.isnan(mean_figures([back])["cost_of_transport"])


# One training


def tiny(folder, **changes):
    given = {"steps": 512, "points": 4, "env_kwargs": SHORT, "params": ("n_envs=4", *TINY), "out": folder}
    return Args(**given | changes)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("baselines") / "one"
    assert train_one(tiny(folder))
    return folder


def test_a_training_leaves_its_curve_and_its_score(done):
    curve, final = read_curve(done / CURVE), json.loads((done / FINAL).read_text())
    assert [row["steps"] for row in curve] == [0, 128, 256, 384, 512]
    assert all(a["wall_s"] < b["wall_s"] for a, b in pairwise(curve))
    assert final["steps"] == 512
    kept = score_vector(str(done), LEG, CURVE_SEEDS, episode_seconds=0.4)
    assert curve[-1]["return"] == pytest.approx(np.mean([one["return"] for one in kept]))
    assert len(final["episodes"]) == len(FINAL_SEEDS)


def test_what_is_done_is_not_done_again(done, monkeypatch):
    monkeypatch.setattr(baselines_run, "train", lambda *_: pytest.fail("was trained"))
    assert train_one(tiny(done))


def test_an_orphan_stops_and_goes_on_to_the_same_curve(done, tmp_path, monkeypatch):
    calls = iter(range(10**6))
    monkeypatch.setattr(os, "getppid", lambda: 1 if next(calls) > 70 else 2)
    assert not train_one(tiny(tmp_path / "one"))
    assert not (tmp_path / "one" / FINAL).exists()
    stopped = read_curve(tmp_path / "one" / CURVE)[-1]["steps"]
    assert 0 < stopped < 512
    monkeypatch.undo()
    assert train_one(tiny(tmp_path / "one"))
    again = {row["steps"]: row["return"] for row in read_curve(tmp_path / "one" / CURVE)}
    whole = {row["steps"]: row["return"] for row in read_curve(done / CURVE)}
    assert {steps: again[steps] for steps in whole} == whole
    assert (
        json.loads((tmp_path / "one" / FINAL).read_text())["episodes"]
        == json.loads((done / FINAL).read_text())["episodes"]
    )


# Many trainings

PLAN = [Run(Entry("ppo", LEG, 3), seed) for seed in range(3)]


def pretend(monkeypatch, program):
    """Trainings that are `program` in the folder given to it; returns how many ran at once, each time."""
    counts, alive = [], []

    def start(one, folder):
        (folder / one.name).mkdir(parents=True, exist_ok=True)
        (folder / one.name / "log.txt").write_text("it was odd\n")
        alive[:] = [process for process in alive if process.poll() is None]
        alive.append(subprocess.Popen([sys.executable, "-c", program, str(folder / one.name)]))
        counts.append(len(alive))
        return alive[-1]

    monkeypatch.setattr(baselines, "start", start)
    return counts, alive


FINISH = (
    "import sys, pathlib; p = pathlib.Path(sys.argv[1]); 's1' in p.name or (p / 'final.json').write_text('')"
)


def test_all_are_trained_once_and_failures_are_told(tmp_path, monkeypatch, capsys):
    counts, _ = pretend(monkeypatch, FINISH)
    assert baselines.work_off(PLAN, tmp_path, workers=2) == [PLAN[1]]
    assert len(counts) == 3
    assert max(counts) <= 2
    assert f"{PLAN[1].name} failed: it was odd" in capsys.readouterr().out
    assert baselines.work_off(PLAN, tmp_path, workers=1) == [PLAN[1]]  # the failed one alone is tried again
    assert len(counts) == 4


def test_an_interrupt_ends_what_runs(tmp_path, monkeypatch):
    _, alive = pretend(monkeypatch, "import time; time.sleep(60)")
    monkeypatch.setattr(
        baselines.tqdm, "set_postfix_str", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        baselines.work_off(PLAN, tmp_path, workers=2)
    assert time.monotonic() - began < 30
    assert len(alive) == 2
    assert all(process.poll() is not None for process in alive)


def test_a_name_that_nothing_has(tmp_path):
    with pytest.raises(ParameterError, match="gallop"):
        baselines.train_all(baselines.Args(only=("gallop",), out=tmp_path))


# Statistics


RLIABLE = {
    "PPO": (53.6193, 52.8315, 53.9700),
    "SAC": (38.7032, 35.0864, 41.5955),
    "TD3": (32.0399, 29.2091, 36.9014),
    "TQC": (31.0671, 24.7334, 34.1725),
}
"""IQM, low and high of the returns of HorseLeg-v0 in docs/baselines/runs.csv, by rliable 1.2.0 (arch 7.2.0):
its `get_interval_estimates` with 50,000 draws of NumPy's global generator after `seed(0)`, rounded."""


@pytest.mark.parametrize("algo", RLIABLE)
def test_the_statistics_are_those_of_rliable(algo):
    """Bounds within a tenth of the interval: other seeds move them by 0.075 of it at most."""
    with open(ROOT / "docs" / "baselines" / "runs.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if (row["policy"], row["env_id"]) == (algo, LEG)]
    mean, *bounds = RLIABLE[algo]
    found = iqm([float(row["return"]) for row in rows])
    assert found[0] == pytest.approx(mean, abs=1e-4)
    assert found[1:] == pytest.approx(bounds, abs=0.1 * (bounds[1] - bounds[0]))


def test_several_numbers_of_each_seed():
    sample = np.random.default_rng(0).normal(40, 2, 10)
    several = iqm(np.stack([sample, sample + 1], axis=1))
    assert several[:, 0] == pytest.approx(iqm(sample))
    assert several[:, 1] - several[:, 0] == pytest.approx(1.0)
    assert several[0, 0] == pytest.approx(np.sort(sample)[2:8].mean())


def test_one_seed_has_no_interval():
    found = iqm([3.0])
    assert found[0] == 3.0
    assert np.isnan(found[1:]).all()
    assert Interval(*found).text() == "3.0"
    assert not Interval(*found).above(Interval(1.0, 1.0, 1.0))


# Matched speed


def scored(speed, *lower):
    keys = ("peak_grf_n", "stance_peak_n", "cost_of_transport")
    around = {key: Interval(x, x - 0.1, x + 0.1) for key, x in zip(keys, lower, strict=True)}
    return Scored("", {"speed_m_s": Interval(speed, speed, speed), **around})


def test_the_interval_of_the_cost_of_transport_is_around_the_whole():
    """Far and cheap, or short and dear: the mean of the costs of episodes is far from the cost of all."""
    far = {"distance_m": 90.0, "drive_work_j": 90.0, "mean_grf_n": 1.0, "weight_share": 1.0,
           "return": 1.0, "cost_of_transport": 1.0}  # fmt: skip
    short = {**far, "distance_m": 1.0, "drive_work_j": 10.0, "cost_of_transport": 10.0}
    episodes = [far, short] * 20
    cost = over_episodes(episodes)["cost_of_transport"]
    assert cost.low < cost.mean == mean_figures(episodes)["cost_of_transport"] < cost.high < 2
    back = over_episodes([{**far, "distance_m": -1.0, "cost_of_transport": np.inf}] * 2)
    assert np.isnan(back["cost_of_transport"].low)
    assert back["return"].low == 1.0


def test_seeds_are_counted_one_by_one():
    slow, soft, hard = ({"speed_m_s": v, "peak_grf_n": f, "stance_peak_n": f, "cost_of_transport": f}
                        for v, f in ((1.0, 1.0), (3.0, 1.0), (3.0, 5.0)))  # fmt: skip
    agent = replace(scored(2.0, 1.0, 1.0, 1.0), seeds=(slow, soft, soft, hard))
    assert seeds_that_dominate(agent, scored(2.0, 2.0, 2.0, 2.0)) == "2/4"


@pytest.mark.parametrize(
    ("agent", "is_better"),
    [
        (scored(2.0, 1.0, 1.0, 1.0), True),
        (scored(1.9, 1.0, 1.0, 1.0), False),  # slower
        (scored(2.0, 1.0, 1.0, 1.9), False),  # intervals meet
        (scored(2.0, 3.0, 1.0, 1.0), False),
    ],
)
def test_dominance(agent, is_better):
    assert dominates(agent, scored(2.0, 2.0, 2.0, 2.0)) == is_better


def test_who_bears_less_is_named():
    light, heavy = (Interval(x, x - 0.01, x + 0.01) for x in (0.2, 0.7))
    agent, run = scored(2.0, 1.0, 1.0, 1.0), scored(2.0, 2.0, 2.0, 2.0)
    agent, run = (
        replace(one, intervals={**one.intervals, "weight_share": share})
        for one, share in ((agent, light), (run, heavy))
    )
    assert verdict(agent, run) == "yes, bearing less of the weight"
    assert verdict(replace(agent, intervals={**agent.intervals, "weight_share": heavy}), run) == "yes"
    assert verdict(run, agent) == "no"


def test_scaled_runs_begin_with_the_run_and_stay_what_they_are():
    factors, actions = scaled_runs()
    assert factors[0] == (1.0, 1.0)
    assert (np.abs(actions) <= 1).all()
    with gym.make(LEG) as env:
        leg = env.unwrapped
        run, last = leg.gaits["run"], factors[-1]
        assert actions[0] == pytest.approx(leg.action_for(run))
        swung = replace(run, crank_speed=last[0] * run.crank_speed, swing_sin=last[1] * run.swing_sin,
                        swing_cos=last[1] * run.swing_cos)  # fmt: skip
        assert leg.batch.command_of(actions[-1]) == pytest.approx(swung.to_array(), abs=1e-5)


# The page

SMALL = (
    Entry("ppo", LEG, 3),
    Entry("sac", LEG, 2),
    Entry("ppo", LEG, 2, label="matched", paid="paid little"),
)


def pretend_results(folder, done):
    """Folders as trainings leave them, with returns of seeds that are known."""
    final = json.loads((done / FINAL).read_text())
    for one in runs_of(SMALL):
        here = folder / one.name
        here.mkdir(parents=True)
        for name in ("run.json", CURVE):
            (here / name).write_text((done / name).read_text())
        (here / "config.yml").write_text(yaml.safe_dump({one.entry.env_id: expected_settings(one.entry)}))
        level = 40.0 + one.seed if one.entry.algo == "ppo" else 1.0
        episodes = [{**episode, "return": level} for episode in final["episodes"]]
        (here / FINAL).write_text(
            json.dumps({**final, "env_kwargs": {}, "seed": one.seed, "episodes": episodes})
        )


@pytest.fixture
def page(done, tmp_path, monkeypatch):
    pretend_results(tmp_path / "runs", done)
    point = {key: Interval(x, x, x) for key, x in (
        ("return", 6.0), ("speed_m_s", 2.0), ("peak_grf_n", 4e3), ("stance_peak_n", 3500.0),
        ("cost_of_transport", 1.3), ("weight_share", 0.7))}  # fmt: skip
    known = {name: Scored(name, point) for name in ("run", "walk", "open-loop")}
    monkeypatch.setattr(baselines_report, "references", lambda env_id: known)
    monkeypatch.setattr(baselines_results, "sped_up", lambda speed: [])
    monkeypatch.setattr(baselines_results, "REPS", 100)
    monkeypatch.setattr(baselines_report, "load_plan", lambda name: SMALL)
    args = baselines_report.Args("nightly", tmp_path / "runs")
    return baselines_report.report(args)


def test_the_page_says_what_the_runs_say(page, tmp_path):
    assert page == tmp_path / "runs" / "report.md"
    text = page.read_text()
    (line,) = (line for line in text.splitlines() if line.startswith(f"| `{LEG}` | PPO | 3 |"))
    assert "| 41.0 [40" in line  # the IQM of 40, 41 and 42
    assert "| 40.0 to 42.0 | 3/3 | 3/3 |" in line
    assert "| SAC | 2 |" in text
    assert "| PPO, paid little |" in text
    assert "python -m agents.baselines_run --algo sac" in text
    with (page.with_suffix("") / "curves.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 5 * 7
    assert (page.with_suffix("") / "HorseLeg-v0.png").stat().st_size > 10_000


def test_what_the_plan_does_not_ask_for_is_not_shown(page, tmp_path):
    folder = tmp_path / "runs" / "ppo-HorseLeg-v0-s1"
    asked = (folder / "config.yml").read_text()
    (folder / "config.yml").write_text(asked.replace("n_timesteps: 5000000", "n_timesteps: 64000"))
    with pytest.raises(DataFileError, match=r"-s1: expected .*'n_timesteps': 5000000.*got .*64000"):
        read_results(SMALL, tmp_path / "runs")
    (folder / "config.yml").write_text(asked)
    final = json.loads((folder / FINAL).read_text())
    (folder / FINAL).write_text(json.dumps({**final, "env_kwargs": {"friction": 0.1}}))
    with pytest.raises(DataFileError, match=r"-s1: expected .*'friction': None.*got .*0.1"):
        read_results(SMALL, tmp_path / "runs")


def test_nothing_done(tmp_path):
    with pytest.raises(DataFileError, match="found none"):
        read_results(SMALL, tmp_path)

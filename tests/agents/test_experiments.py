"""Experiments: plans are what is asked, trainings go on where they stopped, the page says so."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import yaml
from stable_baselines3 import PPO

import hoof_env  # noqa: F401  registers the ids
from agents import runs
from agents.experiments import __main__ as command
from agents.experiments import baselines_page, runner, training
from agents.experiments.baselines_page import following, settled_speeds
from agents.experiments.curves import CURVES, read_curves
from agents.experiments.outcomes import Outcome, Row, read_rows, seconds_to
from agents.experiments.plans import LEG, PLANS, Entry, Run, load_plan, runs_of
from agents.experiments.training import CURVE, FINAL, Args, read_curve, train_one
from agents.settings import FOLDER
from agents.statistics import LOWER, compare, dominates, dominates_with_confidence
from hoof_env.envs.open_loop import open_loop
from hoof_env.errors import DataFileError
from hoof_env.evaluation import statistics
from hoof_env.evaluation.episodes import CURVE_SEEDS, FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import Interval, Scored, iqm, mean_figures, over_episodes
from tests.agents.conftest import SHORT, TINY

ROOT = Path(__file__).parents[2]
RAIL = "hoof_env/HorseLegRail-v0"

# The plan


def test_the_full_plan_trains_ten_seeds_of_each_learner():
    counted = {(one.algo, one.env_id): one.seeds for one in load_plan("full")}
    assert {key: n for key, n in counted.items() if key[1] == LEG} == {
        (algo, LEG): 10 for algo in ("ppo", "sac", "td3", "tqc")
    }
    # Rough ground has a page of falls and not of returns; ids with costs and legs that carry themselves have
    # plans of their own.
    others = {
        "hoof_env/HorseLegMO-v0",
        "hoof_env/HorseRough-v0",
        "hoof_env/HorseLegSafe-v0",
        "hoof_env/HorseSafe-v0",
        "hoof_env/HorseLegHop-v0",
        "hoof_env/HorseLegBalance-v0",
        "hoof_env/HorseLegBalanceSpeed-v0",
    }
    single = {name for name in gym.registry if name.startswith("hoof_env/") and name not in others}
    assert {env_id for algo, env_id in counted if algo == "ppo"} == single
    assert all(counted["ppo", env_id] == 10 for env_id in single)


@pytest.mark.parametrize("plan", [load_plan(path.stem) for path in PLANS.glob("*.yml")])
def test_no_training_starts_from_a_scored_seed_or_shares_a_folder(plan):
    every = list(runs_of(plan))
    assert len({one.name for one in every}) == len(every) == sum(entry.seeds for entry in plan)
    for one in every:
        rows = one.entry.settings["n_envs"]
        assert one.seed + rows <= CURVE_SEEDS.start < CURVE_SEEDS.stop <= FINAL_SEEDS.start


def test_a_training_is_reported_its_arguments_as_the_command_takes_them():
    entry = Entry("ppo", LEG, 1, env_kwargs={"target_speed": [2.1, 2.1]})
    words = Run(entry, 3).command(Path("out"))
    assert words[words.index("--out") + 1] == str(Path("out", "ppo-HorseLeg-v0-s3"))
    assert words[-2:] == ["--env-kwargs", "target_speed=[2.1, 2.1]"]


def test_a_variant_has_a_name_and_hyperparameters_of_its_own():
    entry = Entry("ppo_flat", LEG, 1, params={"n_epochs": 2}, variant="2 epochs")
    assert (entry.title, Run(entry, 0).name) == ("PPO_FLAT 2 epochs", "ppo_flat-2-epochs-HorseLeg-v0-s0")
    assert Run(entry, 0).command()[-2:] == ["--params", "n_epochs=2"]
    assert entry.settings["n_epochs"] == 2


def test_the_time_to_a_return_ends_at_the_first_crossing(tmp_path):
    rows = [(0.0, -5.0), (10.0, 10.0), (20.0, 30.0), (30.0, 5.0), (40.0, 90.0)]
    (tmp_path / CURVE).write_text("wall_s,return\n" + "".join(f"{t},{r}\n" for t, r in rows))
    one = Outcome(tmp_path, {})
    assert seconds_to(20.0, one) == pytest.approx(15.0)
    assert seconds_to(60.0, one) == pytest.approx(30.0 + 10 * 55 / 85)
    assert seconds_to(91.0, one) == np.inf


def test_the_cost_of_transport_is_work_over_distance_of_all_episodes():
    one = {"distance_m": 10.0, "positive_work_j": 800.0, "mean_normal_n": 400.0, "weight_share": 0.5,
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


def test_finished_trainings_are_not_repeated(done, monkeypatch):
    monkeypatch.setattr(training, "train", lambda *_: pytest.fail("was trained"))
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


def test_a_stock_learner_is_the_one_that_its_library_makes(tmp_path):
    """And it is scored at its very steps: before the first, within a rollout, and at the end."""
    stock = FOLDER / "stock.yml"
    assert train_one(
        Args(env_id=RAIL, env_kwargs=SHORT, steps=2048, every=1500, hyperparams=stock, out=tmp_path / "one")
    )
    model = PPO("MlpPolicy", gym.make(RAIL, episode_seconds=0.4), seed=0, device="cpu")
    model.learn(2048)
    ours = PPO.load(tmp_path / "one" / "model.zip").policy.state_dict()
    assert all((ours[name] == value).all() for name, value in model.policy.state_dict().items())
    curve = read_curve(tmp_path / "one" / CURVE)
    assert [row["steps"] for row in curve] == [0, 1500, 2048]
    # The policy of a rollout does not change within it
    assert curve[0]["return"] == curve[1]["return"] == curve[2]["return"]
    final = json.loads((tmp_path / "one" / FINAL).read_text())
    assert mean_figures(final["episodes"])["return"] != curve[2]["return"]


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

    monkeypatch.setattr(runner, "start", start)
    return counts, alive


FINISH = (
    "import sys, pathlib; p = pathlib.Path(sys.argv[1]); 's1' in p.name or (p / 'final.json').write_text('')"
)


def test_all_are_trained_once_and_failures_are_reported(tmp_path, monkeypatch, capsys):
    counts, _ = pretend(monkeypatch, FINISH)
    assert runner.train_all(PLAN, tmp_path, workers=2) == [PLAN[1]]
    assert len(counts) == 3
    assert max(counts) <= 2
    assert f"{PLAN[1].name} failed: it was odd" in capsys.readouterr().out
    assert runner.train_all(PLAN, tmp_path, workers=1) == [PLAN[1]]  # the failed one alone is tried again
    assert len(counts) == 4


def test_an_interrupt_ends_what_runs(tmp_path, monkeypatch):
    _, alive = pretend(monkeypatch, "import time; time.sleep(60)")
    monkeypatch.setattr(
        runner.tqdm, "set_postfix_str", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        runner.train_all(PLAN, tmp_path, workers=2)
    assert time.monotonic() - began < 30
    assert len(alive) == 2
    assert all(process.poll() is not None for process in alive)


def run_command(*options, until=None):
    """Run `agents.experiments`; Ctrl-C once the file `until` exists; return the exit code."""
    command = [sys.executable, "-m", "agents.experiments", *map(str, options)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while until and not until.exists() and process.poll() is None:
        time.sleep(0.1)
    if until:
        process.send_signal(signal.SIGINT)
    return process.wait(300)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="SIGINT of another process")
def test_an_interrupted_command_goes_on_to_the_same_curves(tmp_path):
    """A real one, of a stock learner: interrupted after its first score, between two rollouts it stops."""
    training = ("--plan", "stock", "--only", "ppo-HorseLegFixed-v0-s0", "--steps", "4096", "--no-page")
    name = "ppo-HorseLegFixed-v0-s0"
    one = tmp_path / "one"
    assert run_command(*training, "--out", one, until=one / name / CURVE) == 130
    assert not (one / name / FINAL).exists()
    assert [path.name for path in (one / name / "checkpoints").iterdir()] == ["2048"]
    assert not (one / CURVES).exists()
    assert run_command(*training, "--out", one) == 0
    assert runs.read_record(one / name)["resumed"] == [2048]
    stock = FOLDER / "stock.yml"
    whole = tmp_path / "whole"
    assert train_one(
        Args(env_id="hoof_env/HorseLegFixed-v0", steps=4096, every=20_480, hyperparams=stock, out=whole)
    )
    again = {row["steps"]: row["return"] for row in read_curves(one)}
    assert again == {row["steps"]: round(row["return"], 2) for row in read_curve(whole / CURVE)}
    assert list(again) == [0, 4096]


def test_a_training_that_is_done_with_other_settings_is_refused(done, tmp_path):
    """Before any other is trained."""
    pretend_results(tmp_path, done)
    args = command.Args("nightly", only=("ppo-HorseLeg-v0",), steps=4096, out=tmp_path)
    with pytest.raises(DataFileError, match=r"s0: expected a training with .*4096.*remove the folder"):
        command.train_planned(args)


# Statistics


RETURNS = {
    "PPO": [
        54.0173, 53.4881, 53.4729, 53.889, 53.6221, 51.9234, 53.2262, 54.14, 52.0408, 54.3173,
    ],
    "SAC": [
        41.0027, 34.3514, 44.4314, 33.5286, 42.4824, 41.2074, 37.5377, 41.1991, 30.4561, 36.9208,
    ],
    "TD3": [
        36.3857, 29.0368, 42.3795, 40.5073, 35.9627, 31.6596, 29.3667, 29.2792, 24.8539, 29.5856,
    ],
    "TQC": [
        32.3044, 17.4388, 28.6732, 29.5526, 27.9316, 32.6584, 35.9406, 35.2821, 18.5021, 35.8887,
    ],
}  # fmt: skip
"""Mean returns of seeds, of an earlier table (docs/baselines/runs.csv of commit 13ae716)."""

RLIABLE = {
    "PPO": (53.6193, 52.8315, 53.9700),
    "SAC": (38.7032, 35.0864, 41.5955),
    "TD3": (32.0399, 29.2091, 36.9014),
    "TQC": (31.0671, 24.7334, 34.1725),
}
"""IQM, low and high of these, by rliable 1.2.0 (arch 7.2.0): its
`get_interval_estimates` with 50,000 draws of NumPy's global generator after `seed(0)`, rounded."""


@pytest.mark.parametrize("algo", RLIABLE)
def test_statistics_agree_with_rliable(algo):
    """Bounds within a tenth of the interval: other seeds move them by 0.075 of it at most."""
    mean, *bounds = RLIABLE[algo]
    found = iqm(RETURNS[algo])
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


# Dominance


def test_the_interval_of_the_cost_of_transport_is_around_the_whole():
    """Far and cheap, or short and dear: the mean of the costs of episodes is far from the cost of all."""
    far = {"distance_m": 90.0, "positive_work_j": 90.0, "mean_normal_n": 1.0, "weight_share": 1.0,
           "return": 1.0, "cost_of_transport": 1.0}  # fmt: skip
    short = {**far, "distance_m": 1.0, "positive_work_j": 10.0, "cost_of_transport": 10.0}
    episodes = [far, short] * 20
    cost = over_episodes(episodes)["cost_of_transport"]
    assert cost.low < cost.mean == mean_figures(episodes)["cost_of_transport"] < cost.high < 2
    back = over_episodes([{**far, "distance_m": -1.0, "cost_of_transport": np.inf}] * 2)
    assert np.isnan(back["cost_of_transport"].low)
    assert back["return"].low == 1.0


RUN = {"speed_m_s": 2.0, "highest_grf_n": 4.0, "stance_peak_n": 3.0, "cost_of_transport": 1.0,
       "loading_rate_n_s": 1.0, "weight_share": 0.7}  # fmt: skip
BETTER = RUN | {"speed_m_s": 2.5} | {key: 0.9 * part * RUN[key] for key, part in LOWER.items()}


def scored(figures, width=0.01, seeds=()):
    return Scored("", {key: Interval(x, x - width, x + width) for key, x in figures.items()}, seeds)


@pytest.mark.parametrize(
    ("changes", "is_better"),
    [
        ({}, True),
        ({"speed_m_s": 1.9}, False),
        ({"weight_share": 0.6}, False),  # bearing less is a way to be soft
        *(({key: 1.01 * part * RUN[key]}, False) for key, part in LOWER.items()),
        ({"weight_share": 1.02}, False),  # the suspension pulls the animal down
        ({"weight_share": 0.99}, True),
    ],
)
def test_dominance(changes, is_better):
    agent = BETTER | changes
    assert dominates(agent, RUN) == is_better
    lines = compare([scored(agent, seeds=(BETTER, RUN, BETTER | changes))], scored(RUN)).splitlines()
    assert lines[-1].endswith(f"| {'yes' if is_better else 'no'} | {1 + is_better}/3 |")


def test_intervals_must_lie_apart():
    assert dominates_with_confidence(scored(BETTER), scored(RUN))
    assert not dominates_with_confidence(scored(BETTER, 2.0), scored(RUN))
    assert "| no |" in compare([scored(BETTER, 2.0)], scored(RUN))


def test_who_follows_half_of_a_command(monkeypatch, tmp_path):
    """And results without a policy, as of an archive, are passed over."""
    monkeypatch.setattr(baselines_page, "settled_speed", lambda policy, command: 1.0 + 0.5 * command)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "policy.json").touch()
    results = [Outcome(tmp_path / name, {"seed": seed}) for seed, name in enumerate(("one", "gone", "two"))]
    speeds = settled_speeds(Row(SMALL[0], tuple(results)))
    assert list(speeds) == [0, 2]
    assert following("PPO", speeds).intervals["follows"].mean == pytest.approx(0.5)


def test_the_settled_speed_leaves_out_the_start():
    """A constant gait: its speed after four seconds, from the environment's own account."""
    env = gym.make(baselines_page.SPEED, target_speed=2.0)
    held = open_loop({"constant": env.unwrapped.gaits["run"].to_array()}, env)
    speed = baselines_page.settled_speed(held, 2.0)
    each = []
    for seed in FINAL_SEEDS[:10]:
        (seen, _), x = env.reset(seed=seed), []
        for _ in range(500):
            seen, _, _, _, info = env.step(held.predict(seen)[0])
            x.append(info["measured"]["x"])
        each.append((x[-1] - x[199]) / 6)
    assert speed == pytest.approx(np.mean(each), rel=0.02)


# The page

SMALL = (Entry("ppo", LEG, 3), Entry("sac", LEG, 2))


def pretend_results(folder, done):
    """Folders as trainings leave them, with returns of seeds that are known."""
    final = json.loads((done / FINAL).read_text())
    for one in runs_of(SMALL):
        here = folder / one.name
        here.mkdir(parents=True)
        for name in ("run.json", CURVE):
            (here / name).write_text((done / name).read_text())
        (here / "config.yml").write_text(yaml.safe_dump({one.entry.env_id: one.entry.settings}))
        level = 40.0 + one.seed if one.entry.algo == "ppo" else 1.0
        episodes = [{**episode, "return": level} for episode in final["episodes"]]
        (here / FINAL).write_text(
            json.dumps({**final, "env_kwargs": {}, "seed": one.seed, "episodes": episodes})
        )


@pytest.fixture
def page(done, tmp_path, monkeypatch):
    pretend_results(tmp_path / "runs", done)
    point = {key: Interval(x, x, x) for key, x in (
        ("return", 6.0), ("speed_m_s", 2.0), ("highest_grf_n", 4e3), ("stance_peak_n", 3500.0),
        ("loading_rate_n_s", 1e5), ("cost_of_transport", 1.3), ("weight_share", 0.7))}  # fmt: skip
    known = {name: Scored(name, point) for name in ("run", "walk", "open-loop")}
    monkeypatch.setattr(baselines_page, "references", lambda env_id: known)
    monkeypatch.setattr(statistics, "REPS", 100)
    return baselines_page.write("the small plan", SMALL, tmp_path / "runs")


def test_the_page_says_what_the_runs_say(page, tmp_path):
    assert page == tmp_path / "runs" / "report.md"
    text = page.read_text()
    (line,) = (line for line in text.splitlines() if line.startswith(f"| `{LEG}` | PPO | 3 |"))
    assert "| 41.0 [40" in line  # the IQM of 40, 41 and 42
    assert "| 40.0 to 42.0 | 3/3 | 3/3 |" in line
    assert "| SAC | 2 |" in text
    assert "python -m agents.experiments.training --algo sac" in text
    with (page.with_suffix("") / "curves.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 5 * 5
    with (page.with_suffix("") / "episodes.csv").open() as file:
        episodes = list(csv.DictReader(file))
    assert len(episodes) == 5 * len(FINAL_SEEDS)
    assert {row["return"] for row in episodes if row["seed"] == "2"} == {"42"}
    assert (page.with_suffix("") / "HorseLeg-v0.png").stat().st_size > 10_000


def test_what_the_plan_does_not_ask_for_is_not_shown(page, tmp_path):
    folder = tmp_path / "runs" / "ppo-HorseLeg-v0-s1"
    asked, steps = (folder / "config.yml").read_text(), SMALL[0].settings["n_timesteps"]
    (folder / "config.yml").write_text(asked.replace(f"n_timesteps: {steps}", "n_timesteps: 64000"))
    wanted = rf"-s1: expected .*'n_timesteps': {steps}.*got .*64000"
    with pytest.raises(DataFileError, match=wanted):
        read_rows(SMALL, tmp_path / "runs")
    (folder / "config.yml").write_text(asked)
    final = json.loads((folder / FINAL).read_text())
    (folder / FINAL).write_text(json.dumps({**final, "env_kwargs": {"friction": 0.1}}))
    with pytest.raises(DataFileError, match=r"-s1: expected .*'friction': None.*got .*0.1"):
        read_rows(SMALL, tmp_path / "runs")

"""Curves of stock learners: what is trained, that an interrupted plan goes on, and what the page says."""

import csv

import gymnasium as gym
import numpy as np
import pytest

from agents import stock, stock_page
from agents.stock import Args
from agents.stock_plan import COLUMNS, LEG, OTHERS, PLAN, RAIL, TUNED, read_curves
from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import FINAL_SEEDS


def curve(env_id, algo, seed, returns, every=100, processor="one"):
    """Rows of a training whose seconds are a hundredth of its steps."""
    steps = every * np.arange(len(returns))
    return [
        dict(zip(COLUMNS, (env_id, algo, seed, int(step), value, step / 100, "abc", processor), strict=True))
        for step, value in zip(steps, returns, strict=True)
    ]


def test_the_plan_has_every_id_of_one_leg_and_the_horse():
    assert {curves.env_id for curves in PLAN} == {LEG, *OTHERS}
    of_leg = {curves.algo: (curves.seeds, curves.steps) for curves in PLAN if curves.env_id == LEG}
    assert of_leg["ppo"] == (10, 400_000)
    assert of_leg["sac"] == (10, 60_000)
    assert of_leg["td3"] == of_leg["tqc"] == (5, 60_000)
    for env_id in OTHERS:
        each = {curves.algo: (curves.seeds, curves.steps) for curves in PLAN if curves.env_id == env_id}
        assert each == {"ppo": (10 if env_id == RAIL else 5, 300_000), "sac": (3, 60_000)}


def test_arguments_choose_from_the_plan():
    chosen = stock.jobs(Args(env_id=RAIL, algo="ppo", seeds=2, steps=1000))
    assert [(job.curves.env_id, job.seed, job.curves.steps, job.curves.every) for job in chosen] == [
        (RAIL, 0, 1000, 1000),
        (RAIL, 1, 1000, 1000),
    ]
    assert len(stock.jobs(Args())) == sum(curves.seeds for curves in PLAN)


def test_a_training_scores_a_learner_as_its_library_makes_it(tmp_path, monkeypatch):
    """And so twice the same, before its first step and at its end."""
    monkeypatch.setattr(stock_page, "FINAL_SEEDS", FINAL_SEEDS[:3])
    monkeypatch.setattr(stock, "FINAL_SEEDS", FINAL_SEEDS[:3])
    job = stock.jobs(Args(env_id=RAIL, algo="ppo", seeds=1, steps=2048))[0]
    model = stock.stock_model(job)
    assert (model.n_steps, model.batch_size, model.n_epochs, model.learning_rate) == (2048, 64, 10, 3e-4)
    first, again = stock.train(job), stock.train(job)
    assert [row["steps"] for row in first] == [0, 2048]
    assert [row["return"] for row in first] == [row["return"] for row in again]
    assert first[0]["train_seconds"] == 0.0 < first[1]["train_seconds"]


def test_another_leg_is_trained_by_its_own_plan_with_more_figures(tmp_path, monkeypatch):
    monkeypatch.setattr(stock, "FINAL_SEEDS", FINAL_SEEDS[:3])
    plan = stock.jobs(Args(preset="klann"))
    assert [(job.curves.algo, job.curves.steps) for job in plan] == [("ppo", 200_000)] * 5 + [
        ("sac", 60_000)
    ] * 5
    (slow,) = {job.curves for job in stock.jobs(Args(preset="klann", half_rates=True))}
    usual = gym.make("hoof_env/HorseLeg-v0").unwrapped.resolved_settings
    for name, rate in stock.leg_of(slow).items():
        assert rate == ("klann" if name == "preset" else getattr(usual, name) / 2)
    with pytest.raises(ParameterError, match="expected with --preset"):
        stock.jobs(Args(half_rates=True))
    args = Args(preset="klann", algo="ppo", seeds=1, steps=2048, out=tmp_path / "klann")
    rows = stock.stock(args)
    assert stock.stock_model(stock.jobs(args)[0]).env.envs[0].unwrapped.geometry.name == "klann"
    assert [row["steps"] for row in rows] == [0, 2048]
    assert read_curves(args.out) == rows
    assert all(row["stance_peak_n"] > 0 for row in rows)
    assert not (args.out / "README.md").exists()


def test_steps_of_ppo_flat_are_whole_rollouts_so_that_the_last_is_scored(tmp_path, monkeypatch, capsys):
    """Without them a training that has no row of its last step would be made again each time."""
    monkeypatch.setattr(stock_page, "FINAL_SEEDS", FINAL_SEEDS[:3])
    monkeypatch.setattr(stock, "FINAL_SEEDS", FINAL_SEEDS[:3])
    monkeypatch.setattr(stock_page, "anchors", lambda env_id: {"zero action": 0.5, stock_page.BEST: 1.5})
    args = Args(env_id=LEG, algo=TUNED, seeds=1, steps=1000, out=tmp_path / "curves")
    assert [row["steps"] for row in stock.stock(args)] == [0, 2048]
    assert f"{TUNED}: 2048 steps instead of 1000" in capsys.readouterr().out
    monkeypatch.setattr(stock, "train", None)
    stock.stock(args)  # nothing is left to train
    assert "instead" not in capsys.readouterr().out
    assert [job.curves.steps for job in stock.jobs(Args(env_id=LEG, algo="ppo", seeds=1, steps=1000))] == [
        1000
    ]


def test_an_interrupted_plan_goes_on_with_what_is_missing(tmp_path, monkeypatch):
    trained = []

    def train(job):
        if len(trained) == 2:
            raise KeyboardInterrupt
        trained.append(job.key)
        return curve(*job.key, [0.0, job.seed + 1.0], job.curves.steps)

    monkeypatch.setattr(stock, "train", train)
    monkeypatch.setattr(stock_page, "anchors", lambda env_id: {"zero action": 0.5, stock_page.BEST: 1.5})
    args = Args(env_id=LEG, algo="ppo", seeds=3, steps=500, out=tmp_path / "curves")
    with pytest.raises(KeyboardInterrupt):
        stock.stock(args)
    assert [row["seed"] for row in read_curves(args.out)] == [0, 0, 1, 1]
    assert not (args.out / "README.md").exists()
    trained.clear()
    stock.stock(args)
    assert trained == [(LEG, "ppo", 2)]
    page = (args.out / "README.md").read_text(encoding="utf-8")
    assert "| HorseLeg | PPO | 3 |" in page
    assert "2 of 3 |" in page  # above the best without feedback
    assert "`abc`" in page
    assert (args.out / "stock.png").stat().st_size > 1000
    trained.clear()
    stock.stock(args)
    assert not trained


def test_what_is_written_is_read_back(tmp_path):
    rows = curve(LEG, "ppo", 0, [1.0, 2.5])
    with (tmp_path / "curves.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    assert read_curves(tmp_path) == rows
    assert read_curves(tmp_path / "nowhere") == []


def test_seconds_are_compared_on_one_processor(tmp_path, monkeypatch):
    """On the one of most trainings of HorseLeg-v0; those of other ids alone are marked."""
    monkeypatch.setattr(stock_page, "anchors", lambda env_id: {"zero action": 0.5, stock_page.BEST: 1.5})
    rows = [
        row
        for seed in range(3)
        for row in curve(LEG, "ppo", seed, [0.0, 1.0], processor="other" if seed == 2 else "one")
    ]
    rows[3] |= {"train_seconds": 3.0}
    rows[5] |= {"train_seconds": 900.0}
    rail = [row | {"train_seconds": 7.0} for row in curve(RAIL, "ppo", 0, [0.0, 1.0], processor="third")]
    assert stock_page.usual_processor(rows + rail) == "one"
    lines = stock_page.table(rows + rail, {LEG: {}, RAIL: {}}).splitlines()[2:]
    assert [line.split("|")[7].strip() for line in lines] == ["2", "7*"]
    stock_page.write(tmp_path, rows)
    assert "of one kind of processor (with a star: of other)" in (tmp_path / "README.md").read_text()


def test_learners_are_compared_where_all_have_been():
    """At the last score up to there, by the interquartile mean; and not beyond the end of a training."""
    rows = [
        row
        for seed, final in enumerate((1.0, 2.0, 3.0, 100.0))
        for row in curve(LEG, "ppo", seed, [0.0, final, 10 * final])
    ] + curve(LEG, TUNED, 0, [5.0] * 11)
    table = stock_page.compared(rows, "steps", (150, 200, 1000))
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]
    assert lines == [
        ["PPO, stock", "2.5", "25.0", ""],
        ["ppo_flat, tuned, 16 environments", "5.0", "5.0", "5.0"],
    ]
    by_seconds = stock_page.compared(rows, "train_seconds", (1.5, 10.0)).splitlines()[2]
    assert [cell.strip() for cell in by_seconds.split("|")[2:-1]] == ["2.5", ""]

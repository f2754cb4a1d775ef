"""Stock learners: what is planned, how trainings become published curves, and what the page says."""

import csv
import json

import numpy as np

from agents.experiments import curves, stock_page
from agents.experiments.__main__ import Args, entries_of, main, trainings_of
from agents.experiments.curves import COLUMNS, PUBLISHED, TUNED, has_run, publish, read_curves
from agents.experiments.plans import LEG, Run, load_plan
from agents.experiments.training import CURVE, FINAL

RAIL = "hoof_env/HorseLegRail-v0"
NAMES = ("HorseLegRail", "HorseLegSpeed", "HorseLegTerrain", "Horse", "HorseLegFixed")
OTHERS = tuple(f"hoof_env/{name}-v0" for name in NAMES)
PLAN = load_plan("stock")


def curve(env_id, algo, seed, returns, every=100, processor="one"):
    """Rows of a training whose seconds are a hundredth of its steps."""
    steps = every * np.arange(len(returns))
    return [
        dict(zip(COLUMNS, (env_id, algo, seed, int(step), value, step / 100, "abc", processor), strict=True))
        for step, value in zip(steps, returns, strict=True)
    ]


def test_the_plan_has_every_id_of_one_leg_and_the_horse():
    assert {entry.env_id for entry in PLAN} == {LEG, *OTHERS}
    of_leg = {entry.algo: (entry.seeds, entry.steps) for entry in PLAN if entry.env_id == LEG}
    assert of_leg["ppo"] == (10, 400_000)
    assert of_leg["sac"] == (10, 60_000)
    assert of_leg["td3"] == of_leg["tqc"] == (5, 60_000)
    for env_id in OTHERS:
        each = {entry.algo: (entry.seeds, entry.steps) for entry in PLAN if entry.env_id == env_id}
        assert each == {"ppo": (10 if env_id == RAIL else 5, 300_000), "sac": (3, 60_000)}


def test_all_learners_but_one_have_the_defaults_of_their_library():
    for entry in PLAN:
        is_stock = entry.settings == {"n_envs": 1, "n_timesteps": entry.steps, "policy": "MlpPolicy"}
        assert is_stock == (entry.algo != TUNED)


def test_arguments_choose_from_the_plan():
    args = Args("stock", only=("ppo-HorseLegRail",), seeds=2, steps=1000)
    chosen = trainings_of(args, entries_of(args))
    assert [(one.name, one.entry.steps) for one in chosen] == [
        ("ppo-HorseLegRail-v0-s0", 1000),
        ("ppo-HorseLegRail-v0-s1", 1000),
    ]
    assert len(trainings_of(Args("stock"), PLAN)) == sum(entry.seeds for entry in PLAN)


def test_every_published_training_is_through():
    rows = read_curves(PUBLISHED)
    assert all(has_run(rows, Run(entry, 0)) for entry in PLAN)


def leave(folder, one, returns):
    """Leave the files of a training that is done, with a second for each score."""
    here = folder / one.name
    here.mkdir(parents=True)
    steps = np.linspace(0, one.entry.settings["n_timesteps"], len(returns)).astype(int)
    lines = [f"{step},{k},{k},{value}" for k, (step, value) in enumerate(zip(steps, returns, strict=True))]
    (here / CURVE).write_text("\n".join(["steps,wall_s,cpu_s,return", *lines]) + "\n")
    (here / "config.yml").write_text(json.dumps({one.entry.env_id: one.entry.settings}))
    about = {"env_id": one.entry.env_id, "algo": one.entry.algo, "seed": one.seed, "env_kwargs": {}}
    (here / "run.json").write_text(json.dumps({**about, "versions": {"commit": "abc"}}))
    (here / FINAL).write_text(json.dumps({**about, "processor": "one"}))


def test_trainings_that_are_done_are_published_and_the_page_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(stock_page, "anchors", lambda env_id: {"zero action": 0.5, stock_page.BEST: 1.5})
    args = Args("stock", only=("ppo-HorseLeg-v0",), seeds=3, out=tmp_path)
    trainings = trainings_of(args, entries_of(args))
    for one in trainings[:2]:
        leave(tmp_path, one, [0.0, one.seed + 1.0])
    options = ["--plan", "stock", "--no-train", "--seeds", "3", "--out", str(tmp_path)]
    assert main(options) == 0
    assert [(row["seed"], row["return"]) for row in read_curves(tmp_path)] == [
        (0, 0.0), (0, 1.0), (1, 0.0), (1, 2.0)
    ]  # fmt: skip
    leave(tmp_path, trainings[2], [0.0, 3.0])
    assert main(options) == 0
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert "| HorseLeg | PPO | 3 |" in page
    assert "2 of 3 |" in page  # above the best without feedback
    assert "`abc`" in page
    assert (tmp_path / "stock.png").stat().st_size > 1000
    assert "gallery" not in capsys.readouterr().out  # which reads the published curves


def test_a_longer_training_replaces_a_shorter_one_and_no_other(tmp_path):
    (short,) = (entry for entry in PLAN if (entry.env_id, entry.algo) == (LEG, "td3"))
    rows = curve(LEG, "td3", 0, [1.0, 2.0]) + curve(LEG, "td3", 1, [1.0, 2.0], every=60_000)
    with (tmp_path / curves.CURVES).open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    leave(tmp_path, Run(short, 0), [3.0, 4.0])
    leave(tmp_path, Run(short, 1), [5.0, 6.0])  # whose rows are there
    found = publish(PLAN, tmp_path, tmp_path)
    assert found == read_curves(tmp_path)
    assert [row["return"] for row in found] == [3.0, 4.0, 1.0, 2.0]


def test_written_rows_are_read_back(tmp_path):
    rows = curve(LEG, "ppo", 0, [1.0, 2.5])
    with (tmp_path / "curves.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    assert read_curves(tmp_path) == rows
    assert read_curves(tmp_path / "nowhere") == []


def test_seconds_are_compared_on_one_processor(tmp_path, monkeypatch):
    """On the processor of most trainings of HorseLeg-v0; one of other ids alone is marked."""
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
    lines = stock_page.table(rows + rail, {LEG: {}, RAIL: {}}, PLAN).splitlines()[2:]
    assert [line.split("|")[7].strip() for line in lines] == ["2", "7*"]
    stock_page.write(tmp_path, rows, PLAN)
    assert "of one kind of processor (with a star: of other)" in (tmp_path / "README.md").read_text()


def test_learners_are_compared_where_all_have_been():
    """At the last score up to there, by the interquartile mean; and not beyond the end of a training."""
    rows = [
        row
        for seed, final in enumerate((1.0, 2.0, 3.0, 100.0))
        for row in curve(LEG, "ppo", seed, [0.0, final, 10 * final])
    ] + curve(LEG, TUNED, 0, [5.0] * 11)
    table = stock_page.compared(rows, "steps", (150, 200, 1000), PLAN)
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]
    assert lines == [
        ["PPO, stock", "2.5", "25.0", ""],
        ["ppo_flat, tuned, 16 environments", "5.0", "5.0", "5.0"],
    ]
    by_seconds = stock_page.compared(rows, "train_seconds", (1.5, 10.0), PLAN).splitlines()[2]
    assert [cell.strip() for cell in by_seconds.split("|")[2:-1]] == ["2.5", ""]

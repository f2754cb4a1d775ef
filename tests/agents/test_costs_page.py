"""The page of learners under a constraint: what it says of rows, and that the published one is of its own."""

import numpy as np
import pytest

from agents.experiments import costs_page
from agents.experiments.plans import load_plan
from agents.settings import load_settings
from hoof_env.errors import DataFileError
from hoof_env.tasks.registry import TASKS

LEG = "hoof_env/HorseLegSafe-v0"


def row(agent, seed, cost, highest=2800.0, steps="200000"):
    figures = dict.fromkeys(costs_page.FIGURES, 0.5)
    found = figures | {"cost": cost, "median_highest_n": highest, "return": 100.0 + cost}
    return costs_page.row_of((LEG, agent, seed), found | {"steps": steps, "commit": "abc"})


def test_an_agent_keeps_the_limit_whose_mean_cost_is_within_it():
    rows = [row("PPO-Lagrangian", str(k), cost) for k, cost in enumerate((10.0, 25.0, 26.0))]
    rows += [row("PPO", "0", 80.0), row("walk", "", 3.0, steps="")]
    lagrangian, ppo, walk = (
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in sorted(costs_page.table(rows).splitlines()[2:], key=lambda line: "gait" in line)
        if line.startswith("| ")
    )
    assert sorted([lagrangian[0], ppo[0]]) == ["PPO", "PPO-Lagrangian"]
    ppo, lagrangian = sorted((lagrangian, ppo))
    assert lagrangian[1:5] == ["3", "200,000", "120 (110 to 126)", "20 (10 to 26)"]
    assert lagrangian[6] == "2 of 3"
    assert ppo[4:7] == ["80", "50.0", "0 of 1"]
    assert walk[:3] == ["gait `walk`", "", ""]


def test_the_limit_is_beside_three_quarters_of_the_median_of_the_agents_without_it():
    rows = [row("PPO, free", str(k), 80.0, highest) for k, highest in enumerate((2400.0, 2800.0, 4000.0))]
    rows.append(row("PPO-Lagrangian", "0", 20.0, 1000.0))
    cells = [cell.strip() for cell in costs_page.limits_table(rows).splitlines()[2].split("|")[1:-1]]
    assert cells[3:6] == ["2800", "2100", f"{TASKS['safe'].defaults['cost']['indicator']:.0f}"]


def test_the_published_tables_are_of_the_published_rows():
    rows = costs_page.read_rows(costs_page.PUBLISHED)
    page = (costs_page.PUBLISHED / costs_page.PAGE_FILE).read_text(encoding="utf-8")
    for env_id in {found["env_id"] for found in rows}:
        assert costs_page.table([found for found in rows if found["env_id"] == env_id]) in page
    assert costs_page.limits_table(rows) in page
    agents = {found["agent"] for found in rows if found["env_id"] == LEG}
    for env_id in {found["env_id"] for found in rows}:
        trained = [found for found in rows if found["env_id"] == env_id and found["seed"]]
        steps = {found["steps"] for found in trained if found["agent"] != costs_page.FREE}
        assert len(steps) == 1, "rows of an earlier plan"
    assert agents >= {*costs_page.NAMES.values(), *costs_page.GAITS}


def test_a_published_gait_has_the_figures_of_a_replay():
    (published,) = (
        found
        for found in costs_page.read_rows(costs_page.PUBLISHED)
        if (found["env_id"], found["agent"]) == (LEG, "walk")
    )
    again = costs_page.figures_of("walk", LEG)
    np.testing.assert_allclose([float(published[name]) for name in again], [*again.values()], rtol=1e-3)


def test_learners_have_equal_steps_and_the_budget_of_the_page():
    plan = [entry for entry in load_plan("costs") if costs_page.name_of(entry) != costs_page.FREE]
    for env_id in {entry.env_id for entry in plan}:
        entries = [entry for entry in plan if entry.env_id == env_id]
        names = {costs_page.name_of(entry) for entry in entries}
        assert names == {*costs_page.NAMES.values()} - {costs_page.FREE}
        assert len({entry.settings["n_timesteps"] for entry in entries}) == 1
        usual = [
            {k: v for k, v in e.settings.items() if k not in ("cost_limit", "multiplier_rate")}
            for e in entries
        ]
        assert usual[0] == usual[1] == usual[2]
        (own,) = (entry for entry in entries if entry.algo == "ppo_lagrangian")
        assert load_settings(own.settings_file, env_id)["cost_limit"] == costs_page.BUDGET


def test_no_rows_and_foreign_rows_are_refused(tmp_path):
    with pytest.raises(DataFileError, match=r"costs\.csv: expected rows of trainings"):
        costs_page.write(tmp_path, costs_page.read_rows(tmp_path))
    (tmp_path / "costs.csv").write_text("a,b\n1,2\n")
    with pytest.raises(DataFileError, match=r"costs\.csv: expected columns env_id, agent"):
        costs_page.read_rows(tmp_path)

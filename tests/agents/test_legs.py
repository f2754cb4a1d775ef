"""The search for a four-bar leg, the figures of feet's paths, and the page that compares legs."""

import numpy as np
import pytest

from agents import four_bar, legs
from agents.foot_paths import figures, path_of
from agents.stock_plan import COLUMNS, FIGURES, LEG, LEGS
from hoof_env.gait import GaitParameters, load_gait
from hoof_env.leg.geometry import load_geometry


def test_a_search_finds_the_same_leg_again_and_a_better_one_than_chance():
    ticks = []
    found = [four_bar.search(1, 4, 3, lambda: ticks.append(1)) for _ in range(2)]
    assert found[0].cost == found[1].cost
    np.testing.assert_array_equal(found[0].x, found[1].x)
    assert len(ticks) == 6
    assert found[0].looked_at == four_bar.SCREENED + 3 * four_bar.POPULATION
    generator = np.random.default_rng([4, 2])
    chance = [four_bar.cost(x, 1) for x in generator.uniform(-1, 1, (four_bar.SCREENED, 6))]
    assert found[0].cost <= min(chance)


def test_a_leg_that_locks_or_stands_over_its_hip_costs_more_than_any_that_walks():
    costs = [four_bar.cost(x, 1) for x in np.random.default_rng(0).uniform(-1, 1, (200, 6))]
    assert four_bar.LOCKED in costs
    assert min(costs) < four_bar.LOCKED / 2


def test_the_four_bar_that_ships_does_what_was_asked():
    """Near enough: its stance is as level as Klann's leg's, and its foot comes back above the ground."""
    leg = load_geometry("fourbar")
    found = figures(leg)
    assert found["level"] < figures(load_geometry("klann"))["level"]
    assert found["stroke"] > 0.7
    assert found["passes"] > 0.05
    assert found["margin"] > 0.5
    assert leg.mass == pytest.approx(load_geometry().mass, rel=1e-3)


def test_figures_of_a_path_are_those_of_the_turned_foot():
    """A swing that never changes turns the path as a whole."""
    leg = load_geometry("jansen")
    foot, moved, _ = path_of(leg)
    turned, also, _ = path_of(leg, GaitParameters(5.0, 0.3, 0.0, 0.0))
    np.testing.assert_allclose(turned, foot * np.exp(0.3j))
    np.testing.assert_allclose(also, moved * np.exp(0.3j))
    # and one that changes has the derivative of differences
    turned, also, _ = path_of(leg, GaitParameters(5.0, 0.1, 0.2, -0.3))
    slope = (np.roll(turned, -1) - np.roll(turned, 1)) / (2 * np.radians(1.0))
    np.testing.assert_allclose(also, slope, atol=2e-3)


def test_gaits_of_the_presets_are_those_that_were_found():
    gaits = legs.read_gaits()
    for preset in LEGS:
        for name in ("walk", "run"):
            assert load_gait(name, preset) == gaits[preset][name]


def test_trainings_that_are_there_have_a_line(tmp_path):
    assert legs.learnt_table(tmp_path) == ""
    folder = tmp_path / "klann"
    folder.mkdir()
    lines = [",".join((*COLUMNS, *FIGURES))]
    for seed, value in enumerate((100.0, 120.0, 140.0)):
        lines += [f"{LEG},ppo,{seed},{n},{n and value},1.0,abc,one,2.0,1500.0,0.5,0.9" for n in (0, 200_000)]
    (folder / "curves.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = legs.learnt_table(tmp_path)
    assert "| `klann` | PPO, 3 seeds, 200,000 steps | 120 (100 to 140) | 2.00 | 1.50 | 0.50 | 0.90 |" in table

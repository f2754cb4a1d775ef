"""Learning on the page of all ids is read off the curves of stock learners, for ids with curves."""

import json

import pytest

from agents import gallery
from agents.experiments.curves import COLUMNS, TUNED, read_curves
from agents.experiments.plans import LEG
from docs._manual.results import RETURNS, learning
from hoof_env.policies.catalogue import shipped_returns

RAIL = "hoof_env/HorseLegRail-v0"


def curve(algo, seed, returns, seconds=1.0):
    """Rows of a training with a score every 100 steps, each of which takes so many seconds."""
    return [
        dict(zip(COLUMNS, (LEG, algo, seed, 100 * k, value, k * seconds, "abc", "one"), strict=True))
        for k, value in enumerate(returns)
    ]


def test_a_training_has_passed_a_bar_where_it_stays_above_it():
    rows = curve("ppo", 0, [0.0, 6.0, 4.0, 7.0, 8.0])
    assert gallery.passed(rows, 5.0) == gallery.passed(rows[::-1], 5.0) == (300, 3.0)
    assert gallery.passed(rows, 8.0) == (float("inf"), float("inf"))
    assert gallery.passed(rows, -1.0) == (0, 0.0)


def test_the_fastest_learner_is_shown_with_medians_over_its_seeds():
    """The tuned learner is no stock learner, and a seed that never passes counts as the slowest."""
    quick = [row for seed, k in enumerate((1, 2, 4)) for row in curve("sac", seed, [0.0] * k + [9.0] * 5)]
    slow = [row for seed in range(2) for row in curve("ppo", seed, [0.0, 9.0], seconds=60.0)]
    rows = quick + slow + curve(TUNED, 0, [9.0])
    assert gallery.learning_of(rows, 5.0) == {"algo": "sac", "seeds": 3, "steps": 200, "seconds": 2.0}
    rows = quick + curve("sac", 3, [0.0] * 9)
    assert gallery.learning_of(rows, 5.0) == {"algo": "sac", "seeds": 4, "steps": 300, "seconds": 3.0}


def test_a_learner_that_does_not_pass_has_its_return_at_the_end():
    rows = [row for seed, end in enumerate((1.0, 2.0, 6.0)) for row in curve("ppo", seed, [0.0, end])]
    shown = gallery.learning_of(rows + curve("sac", 0, [0.0, 0.5, 1.5]), 5.0)
    assert shown == {"algo": "ppo", "seeds": 3, "return": 3.0, "steps": 100, "seconds": 1.0}
    assert learning(shown) == "reaches 3 in 100 steps, 1 s<br>(PPO, 3 seeds)"


def test_an_id_without_curves_shows_nothing():
    assert gallery.learning_of([], 5.0) == gallery.learning_of(curve(TUNED, 0, [9.0]), 5.0) == {}
    assert learning({}) == ""


def test_the_committed_file_has_what_the_curves_say():
    committed = json.loads((gallery.POLICIES / RETURNS).read_text(encoding="utf-8"))
    found = {env_id: gallery.returns_of(env_id, known["random"]) for env_id, known in committed.items()}
    assert found == committed, "run `python -m agents.gallery` and `python -m docs._manual`"
    trained = {row["env_id"] for row in read_curves(gallery.CURVES) if row["algo"] != TUNED}
    assert {env_id for env_id in committed if "learnt" in committed[env_id]} == trained


@pytest.mark.parametrize("name", ["HorseLegRail", "HorseLegSpeed", "HorseLegTerrain", "HorseRough"])
def test_the_committed_return_of_random_actions_has_the_present_reward(name):
    committed = json.loads((gallery.POLICIES / RETURNS).read_text(encoding="utf-8"))
    env_id = f"hoof_env/{name}-v0"
    # Another machine has other last bits, which change an episode, and hardly the mean of a hundred
    assert gallery.random_return(env_id) == pytest.approx(committed[env_id]["random"], rel=0.1)


@pytest.mark.parametrize("env_id", [LEG, RAIL])
def test_scores_of_the_curves_are_compared_with_gaits_in_the_same_episodes(env_id):
    """At the start of a training the score is not yet the best gait's, and at its end it is near the shipped
    agent's."""
    scored = shipped_returns(env_id.rpartition("/")[2])
    rows = [row for row in read_curves(gallery.CURVES) if (row["env_id"], row["algo"]) == (env_id, "ppo")]
    first = [row["return"] for row in rows if row["steps"] == 0]
    assert max(first) < scored["constant"] < scored["policy"]
    assert max(row["return"] for row in rows) < 1.02 * scored["policy"]

"""Terms add up to the return, legs accelerate the horse, and the committed figures are today's."""

import json

import numpy as np
import pytest

from agents import horse_figures, runs
from agents.gait_figures import SETTLED
from hoof_env.constants import GRAVITY
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, score_vector
from hoof_env.policies.find import find_policy

ROWS = 4
SEEDS = FINAL_SEEDS[:ROWS]


@pytest.fixture(scope="module")
def policies():
    with runs.make_env(horse_figures.ENV_ID) as env:
        return {name: find_policy(name, env, horse_figures.ENV_ID) for name in ("shipped", "reference")}


@pytest.fixture(scope="module")
def envs():
    return make_rows(horse_figures.ENV_ID, ROWS)


def test_returns_and_figures_agree_with_an_evaluation(envs, policies):
    ours = horse_figures.play(envs, policies["reference"], SEEDS, {})
    theirs = score_vector("reference", horse_figures.ENV_ID, SEEDS)
    for one, other in zip(ours, theirs, strict=True):
        assert one["return"] == pytest.approx(other["return"], rel=1e-9)
        assert {name: one[name] for name in horse_figures.SUMMARY} == pytest.approx(
            {name: other[name] for name in horse_figures.SUMMARY}
        )
        terms = [one[name] for name in one if name.startswith("reward_")]
        assert sum(terms) == pytest.approx(one["return"], rel=1e-9)


def test_the_terms_of_a_gain_add_up_to_it(envs, policies):
    played = [
        horse_figures.play(envs, policies[name], SEEDS, {"target_speed": 2.6})
        for name in ("shipped", "reference")
    ]
    found = {name: value["mean"] for name, value in horse_figures.gain(*played).items()}
    assert sum(value for name, value in found.items() if name != "return") == pytest.approx(found["return"])


def test_a_fallen_horse_has_the_figures_of_its_episode(envs, policies):
    """One that starts backward falls within a second, and its row begins anew."""
    played = horse_figures.play(envs, policies["reference"], SEEDS, {"speed": -6.0})
    for one, other in zip(played, score_backward(), strict=True):
        assert one["failed"] == 1.0
        assert one["return"] == pytest.approx(other, rel=1e-9)


def score_backward():
    """Returns of the same episodes, one after the other."""
    with runs.make_env(horse_figures.ENV_ID) as env:
        for seed in SEEDS:
            env.reset(seed=seed, options={"speed": -6.0})
            total, ended = 0.0, False
            while not ended:
                _, reward, ended, _, _ = env.step(np.zeros(16, np.float32))
                total += reward
            yield total


def test_both_pairs_accelerate_the_horse(envs, policies):
    """What the pairs do together is the change of momentum: no drag acts on the trunk of a horse."""
    options = {"target_speed": 1.85}
    found = horse_figures.play(envs, policies["reference"], SEEDS, options)[0]
    with runs.make_env(horse_figures.ENV_ID) as env:
        horse = env.unwrapped
        observation, _ = env.reset(seed=SEEDS[0], options=options)
        horse.record()
        momenta = []
        ended = False
        while not ended:
            action, _ = policies["reference"].predict(observation)
            observation, _, failed, truncated, _ = env.step(action)
            momenta.append(float(horse.record()["momentum_x"][-1, 0]))
            ended = failed or truncated
        settled = round(SETTLED / horse.dt)
        seconds = (len(momenta) - settled) * horse.dt
        gained = (momenta[-1] - momenta[settled - 1]) / seconds / (horse.weight / GRAVITY)
    assert found["net_fore"] + found["net_hind"] == pytest.approx(gained, abs=2e-3)
    assert abs(found["net_fore"]) > 0.1


def near(new, old, name):
    """True if a mean of few episodes is within four standard errors and 1 % of a committed one of a hundred,
    or within 0.02 N/kg of a net force, which may be small."""
    spread = (old.get("high", old["mean"]) - old.get("low", old["mean"])) / 2 / 1.96 * 10
    least = 0.02 if name in horse_figures.NET else 0.01 * abs(old["mean"])
    return abs(new - old["mean"]) <= 4 * spread / ROWS**0.5 + least


def test_the_committed_figures_are_measured_again(envs, policies):
    committed = json.loads(horse_figures.OUT.read_text(encoding="utf-8"))
    assert committed["seeds"] == [FINAL_SEEDS.start, FINAL_SEEDS.stop]
    agent, zero = policies["shipped"], policies["reference"]
    both = [horse_figures.play(envs, one, SEEDS, {}) for one in (agent, zero)]
    for name, value in horse_figures.gain(*both).items():
        assert near(value["mean"], committed["gain"][name], name), name
    for row in (committed["speeds"][1], committed["speeds"][-1], committed["forces"][1]):
        players = horse_figures.players(agent, zero, row["speed_m_s"])
        assert set(row["policies"]) <= set(players)
        for name, figures in row["policies"].items():
            policy, options = players[name]
            played = horse_figures.play(envs, policy, SEEDS, options)
            for figure, old in figures.items():
                assert near(np.mean([one[figure] for one in played]), old, figure), (name, figure)

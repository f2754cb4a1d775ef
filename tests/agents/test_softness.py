"""Softness at equal speed: the task charges travel beyond the command, and verdicts follow from intervals."""

import gymnasium as gym
import numpy as np
import pytest

from agents import softness
from agents.experiments.outcomes import read_figures
from hoof_env.errors import DataFileError
from hoof_env.evaluation.episodes import score_vector
from hoof_env.evaluation.statistics import Interval

SEARCHES = [{"origin": "random", "return": -3.0}, {"origin": "known gait", "return": 4.0}]


def test_the_task_is_the_hop_with_a_charge_for_overspeed():
    slow, usual = (
        gym.make(softness.ID, **softness.command_of(speed)).unwrapped for speed in (1.0, softness.SPEEDS[-1])
    )
    hop = gym.make(softness.HOP).unwrapped
    assert [term.name for term in slow.task.terms] == [term.name for term in hop.task.terms] + ["overspeed"]
    charges = []
    for env in (slow, usual):
        env.reset(seed=0, options={"speed": 2.0})
        for _ in range(5):
            *_, info = env.step(np.zeros(4, np.float32))
        charges.append(info["reward_overspeed"])
    assert charges[0] < charges[1] <= 0.0


def test_a_gait_of_the_hop_is_charged_for_going_faster_than_asked():
    gait = str(softness.gait_file(softness.HOP, "phase"))
    slow, fast = (
        np.mean([one["return"] for one in score_vector(gait, softness.ID, range(20), target_speed=[v, v])])
        for v in (1.5, 3.0)
    )
    assert slow < fast


@pytest.mark.parametrize(
    ("agents", "gait", "word"),
    [
        ((1, 0, 2), (4, 3, 5), "lower"),
        ((4, 3, 5), (1, 0, 2), "higher"),
        ((1, 0, 3.5), (4, 3, 5), "not apart"),
    ],
)
def test_a_relation_follows_from_the_intervals(agents, gait, word):
    assert softness.relation(Interval(*agents), Interval(*gait)) == word


def test_policies_of_another_speed_are_not_compared():
    def gait(speed):
        values = {name: [1.0, 0.9, 1.1] for name in softness.FIGURES} | {"speed_m_s": [speed] * 3}
        return {"intervals": values}

    def agent(speed):
        return dict.fromkeys(softness.FIGURES, 2.0) | {"speed_m_s": speed}

    entry = {
        "constant": gait(0.2),
        "phase": gait(1.7) | {"searches": SEARCHES},
        "agents": [agent(1.5), agent(0.4), agent(1.6)],
    }
    data = {"speeds": {"1.5": entry | {"balancing": []}}}
    near = softness.compared(data)[1.5]
    assert "constant" not in near
    assert [one["speed_m_s"] for one in near["agents"]] == [1.5, 1.6]
    assert softness.relations(data, "constant", "stance_peak_n")[0][0] == ""
    assert softness.relations(data, "phase", "stance_peak_n") == [("higher", pytest.approx(2.0))]
    assert "higher in 2" in softness.verdict(data)
    sentence = softness.softer(data, "agents", "phase")
    assert sentence == "At 1.5 m/s stance peak is higher (2.00 times) and loading is higher (2.00 times)."
    assert softness.softer(data, "agents", "constant") == ""
    text = softness.known_better(data)
    assert "returned 4 to 4, searches from random points, where a learner begins, too, -3" in text


def test_a_page_of_nothing_is_refused_by_name(tmp_path):
    args = softness.Args(folder=tmp_path / "none", balance=tmp_path / "neither", out=tmp_path)
    with pytest.raises(DataFileError, match=r"none.*1.5 m/s.*constant, phase, agents, balancing"):
        softness.measure(args)


def test_the_published_page_is_of_the_published_figures(tmp_path):
    data = read_figures(softness.EVIDENCE / softness.DATA)
    if not data:
        pytest.skip("no figures are published")
    page = softness.write(tmp_path, data).read_text(encoding="utf-8")
    assert page == (softness.EVIDENCE / softness.PAGE_FILE).read_text(encoding="utf-8")
    assert (tmp_path / softness.PICTURE).stat().st_size > 5000

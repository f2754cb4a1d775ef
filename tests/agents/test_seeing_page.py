"""The page of what seeing is worth is of its figures, and its verdicts follow from them."""

import numpy as np
import pytest

from agents.experiments import seeing_page
from agents.experiments.outcomes import read_figures
from agents.experiments.plans import load_plan

DATA = read_figures(seeing_page.PUBLISHED / seeing_page.DATA)
ID = seeing_page.IDS[0]


def test_the_published_page_is_of_the_published_figures(tmp_path):
    page = seeing_page.write(tmp_path, DATA).read_text(encoding="utf-8")
    assert page == (seeing_page.PUBLISHED / seeing_page.PAGE_FILE).read_text(encoding="utf-8")
    assert {seeing_page.key_of(entry) for entry in load_plan("seeing")} >= set(DATA["learners"])
    assert (tmp_path / seeing_page.PICTURE).stat().st_size > 5000


def changed(returned, falls):
    """Figures in which every agent has these, and the policy without feedback returns 0 and always falls."""
    seeds = {str(k): {"return": returned, "failed": falls} for k in range(5)}
    ends = {"return": [-1.0, 1.0], "failed": [1.0, 1.0]}
    blind = {"return": 0.0, "failed": 1.0, "intervals": ends}
    zero = {"return": -100.0, "failed": 1.0, "intervals": {"return": [-101.0, -99.0], "failed": [1.0, 1.0]}}
    gaits = {ID: {"zero": zero, "constant": blind | {"return": -5.0}, "open-loop": blind}}
    return {"learners": {ID: seeds}, "gaits": gaits}


@pytest.mark.parametrize(
    ("returned", "falls", "met", "apart"),
    [(100.0, 0.0, "is met", "are apart"), (30.0, 0.6, "is not met", "are not apart")],
)
def test_a_verdict_follows_from_the_intervals(returned, falls, met, apart):
    text = seeing_page.verdict(changed(returned, falls), ID)
    assert f"quarter {met}" in text
    assert text.endswith(f"theirs {apart}.")
    assert seeing_page.GAITS["open-loop"] in text


def test_pushes_are_those_of_rough_ground_and_shares_of_it():
    found = np.array(seeing_page.IMPULSES) / seeing_page.IMPULSES[2]
    assert found == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert seeing_page.pushed("zero", seeing_page.IDS[1]) == []


def test_learners_that_were_pushed_are_compared_without_pushes():
    pushed = next(entry for entry in load_plan("seeing") if entry.variant == "pushed")
    assert seeing_page.without_pushes(pushed) == {}
    assert max(pushed.env_kwargs["push_impulse"]) == seeing_page.IMPULSES[-1]


def test_each_learner_of_the_plan_has_its_own_line():
    keys = [seeing_page.key_of(entry) for entry in load_plan("seeing")]
    assert len(set(keys)) == len(keys)
    lines = {f"{env_id} {name}".strip() for env_id in seeing_page.IDS for name in seeing_page.LEARNERS}
    assert set(keys) <= lines

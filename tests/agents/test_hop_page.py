"""The page of a leg that carries itself shows its data, and the return prefers softer gaits."""

import numpy as np
import pytest

from agents import order
from agents.experiments import hop_page
from agents.experiments.outcomes import read_figures
from agents.experiments.plans import load_plan
from hoof_env.errors import DataFileError, ParameterError

DATA = read_figures(hop_page.PUBLISHED / hop_page.DATA)


def test_the_published_tables_are_of_the_published_figures():
    page = (hop_page.PUBLISHED / hop_page.PAGE_FILE).read_text(encoding="utf-8")
    assert hop_page.table(DATA) in page
    assert hop_page.order_table(DATA) in page
    assert {hop_page.key_of(entry) for entry in load_plan("hop")} >= set(DATA["learners"])


def test_the_gain_of_a_policy_is_its_part_of_what_the_best_without_feedback_gains():
    figures = dict.fromkeys(hop_page.FIGURES, 1.0)
    gaits = {"zero": -50.0, "constant": 100.0, "open-loop": 150.0}
    data = {"weight_n": 500.0, "gaits": {name: figures | {"return": x} for name, x in gaits.items()}}
    trained = [figures | {"return": x, "steps": 10} for x in (50.0, 250.0)]
    assert hop_page.line_of("agent", trained, data)[:5] == [
        "agent", "2", "10", "150 (50 to 250)", "1.00 (0.50 to 1.50)"
    ]  # fmt: skip


def test_published_gaits_have_the_figures_of_a_replay():
    played = hop_page.score_vector("open-loop", hop_page.ID, hop_page.FINAL_SEEDS)
    again = hop_page.figures_of(played)
    np.testing.assert_allclose(
        [DATA["gaits"]["open-loop"][name] for name in again], [*again.values()], rtol=1e-3
    )


def test_a_correlation_at_a_given_third_figure():
    """At a given third figure two that follow it have no correlation, and opposite rests have one of -1."""
    generator = np.random.default_rng(0)
    given, one, other = generator.normal(size=(3, 4000))
    assert abs(order.partial_rank_correlation(given + 0.1 * one, given + 0.1 * other, given)) < 0.1
    assert order.partial_rank_correlation(given + one, given - one, given) < -0.9


def test_the_return_prefers_small_peaks_and_slow_rises_at_a_given_speed():
    found = order.correlations(order.travelling_gaits(hop_page.ID, 384, 7))
    assert found["stance_peak_n"] < -0.5
    assert found["loading_rate_n_s"] < -0.5
    assert found["slip_m"] < -0.3


def test_sliding_is_not_travelling():
    episode = {"failed": 0.0, "speed_m_s": 1.0, "distance_m": 10.0, "slip_m": 0.05, "stances": 10.0}
    assert order.travels(episode)
    assert not order.travels(episode | {"slip_m": 0.2})
    assert not order.travels(episode | {"failed": 1.0})
    assert not order.travels(episode | {"speed_m_s": 0.1})


def test_an_id_on_which_no_gait_travels_is_named(monkeypatch):
    monkeypatch.setattr(order, "travels", lambda *_: False)
    monkeypatch.setattr(order, "play_rows", lambda *_: [])
    with pytest.raises(ParameterError, match="gaits travel, got 0"):
        order.travelling_gaits(hop_page.ID, 4, 0)


@pytest.mark.parametrize("text", ["{", "[]"])
def test_malformed_figures_are_named(tmp_path, text):
    (tmp_path / "figures.json").write_text(text)
    with pytest.raises(DataFileError, match=r"figures\.json: expected the figures"):
        read_figures(tmp_path / "figures.json")
    assert read_figures(tmp_path / "none.json") == {}

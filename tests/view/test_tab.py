"""The page's tab without a browser: requests, refusals, and failures that it survives."""

from __future__ import annotations

import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from hoof_env import records

pytest.importorskip("bokeh")


from hoof_env.view import session as session_module
from hoof_env.view.controls import CONDITIONS, PAPER_ID, paper_values
from hoof_env.view.server import Pages
from hoof_env.view.session import HANDLERS
from hoof_env.view.simulation import Simulation
from tests.view.pages import LEG, SETUP, Page, opened


def test_time_passes_only_while_it_plays(page):
    page.tick(0.4)
    assert page.row[0] >= 0.39
    assert page.ask("play", value=False)["playing"] is False
    before = page.row
    page.tick(0.4)
    np.testing.assert_array_equal(page.row, before)
    page.ask("step")
    assert page.row[0] == pytest.approx(before[0] + 0.02, abs=1e-6)
    page.ask("speed", value=0.1)
    page.ask("play", value=True)
    at = page.row[0]
    page.tick(0.4)
    assert page.row[0] - at < 0.1


def test_the_page_goes_back_in_time_and_on_again(page):
    rows = []
    for _ in range(30):
        page.tick(0.04)
        rows.append(page.row)
    told = page.ask("back", value=float(rows[10][0]))
    np.testing.assert_allclose(page.row, rows[10], rtol=1e-6, atol=1e-6)
    assert told["playing"] is False
    assert page.news.anew
    assert page.news.curves["time"][-1] <= rows[10][0] + 1e-6
    page.ask("play")
    page.tick(0.04)
    assert page.row[0] > rows[-1][0]


def test_a_reset_with_a_seed_begins_the_same_episode(page):
    page.tick(0.3)
    page.ask("reset", seed=5, policy="walk")
    first = page.row
    page.tick(0.3)
    page.ask("reset", seed=5)
    np.testing.assert_array_equal(page.row, first)
    assert page.player.simulation.policy == "walk"
    assert page.row[0] == 0.0


def test_a_reset_says_whether_a_hand_still_drives(page):
    page.ask("drive", setting="crank_speed", value=3.0)
    assert page.ask("reset")["hand"] is True
    assert page.player.simulation.hand["crank_speed"] == 3.0
    assert page.ask("reset", policy="walk")["hand"] is False
    assert page.player.simulation.hand is None


def test_another_preset_needs_no_other_policy_where_none_was_named(page):
    policy = page.tab._doc.template_variables["policy"]
    assert policy == ""
    told = page.ask("setup", env_id=LEG, arguments="", preset="klann", policy=policy, seed=0)
    assert told["go"]


def test_a_slider_moves_the_ground_and_the_next_episode_keeps_it(page):
    page.tick(0.2)
    page.ask("touch", setting="stiffness", value=40000)
    page.ask("reset")
    page.ask("touch", setting="restitution", value=0.1)  # before the first step of the episode
    page.tick(0.2)
    assert page.player.simulation.parameters == {"stiffness": 40000.0, "restitution": 0.1}
    page.ask("touch", setting="target_speed", value=1.5)
    assert page.player.simulation.commanded_speed == 1.5
    page.ask("touch", setting="exponent", value=1.5)
    # What was touched goes along to the page of the other exponent.
    assert page.kept[-1]["arguments"] == {"stiffness": 40000.0, "restitution": 0.1, "exponent": 1.5}


@pytest.mark.parametrize("seed", range(3))
def test_no_state_is_lost_or_doubled_whatever_is_asked_meanwhile(page, seed):
    """A browser that appends what comes has what the history has, to the bit."""
    rng = np.random.default_rng(seed)
    has = {}

    def hear(attr, old, new):
        news = page.news
        for group in ("curves", "steps"):
            for name, values in getattr(news, group).items():
                kept = [] if news.anew else has.get((group, name), [])
                has[group, name] = [*kept, *values]

    page.tab.wire.on_change("news", hear)
    asks = [
        ("touch", {"setting": "stiffness", "value": 5e4}),
        ("touch", {"setting": "friction", "value": 0.3}),
        ("drive", {"setting": "crank_speed", "value": 5.0}),
        ("reset", {"seed": 3}),
        ("reset", {"policy": "walk"}),
        ("push", {"value": 20}),
        ("step", {}),
        ("back", {"value": 0.1}),
        ("play", {}),
        ("speed", {"value": 0.3}),
        ("show", {}),
    ]
    page.ask("show")
    for _ in range(60):
        for k in rng.integers(0, len(asks), rng.integers(0, 3)):
            name, more = asks[k]
            page.ask(name, **more)
        page.tick(rng.choice([0.0, 0.04, 0.12]))
    page.ask("speed", value=1.0)
    page.ask("play", value=True)
    page.tick(0.8)
    history = page.player.history
    for k, group in enumerate(("curves", "steps")):
        time = np.array(has[group, "time"])
        assert len(time) > 30
        assert np.all(np.diff(time) > 0)
        assert time[-1] > page.player.shown - 0.07
        whole = history.between(time[0], time[-1])[k]
        for name, values in whole.items():
            np.testing.assert_array_equal(has[group, name], values, err_msg=name)


def test_a_warning_waits_until_the_page_has_opened(tmp_path, monkeypatch):
    warned = lambda **setup: warnings.warn("A zip.", stacklevel=1) or Simulation(**setup)  # noqa: E731
    monkeypatch.setattr(session_module, "Simulation", warned)
    page = Page(tmp_path)
    page.tick(0.2)
    assert page.tab.wire.told == {}
    told = page.ask("show")
    assert (told["status"], told["kind"]) == ("A zip.", "warning")
    assert page.ask("show") == {}
    page.tab.close()


def test_a_push_adds_its_impulse_over_the_mass(page):
    page.tick(0.1)
    leg = page.player.simulation.env.unwrapped
    before = leg.engine.state["momentum_x"].item()
    assert "60 N s" in page.ask("push", value=60)["status"]
    assert leg.engine.state["momentum_x"].item() == pytest.approx(before + 60)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"name": "touch", "setting": "restitution", "value": 7}, "restitution"),
        ({"name": "touch", "setting": "restitution", "value": None}, "restitution"),
        ({"name": "drive", "setting": "swing_sin", "value": 7}, "swing_sin"),
        ({"name": "speed", "value": 900}, "speed"),
        ({"name": "back", "value": "soon"}, "time"),
        ({"name": "reset", "seed": -3}, "seed"),
        ({"name": "reset", "seed": 2.7}, "seed"),
        ({"name": "reset", "policy": "gallop"}, "policy"),
        ({"name": "reset", "policy": "tests/view"}, "tests/view"),
        ({"name": "condition", "value": "fly"}, "fly"),
        ({"name": "record", "suffix": ".doc"}, "format"),
        ({"name": "push", "value": None}, "push"),
        ({"name": "push", "value": 1e9}, "forward"),
        ({"name": "stop everything"}, "request"),
        ({"name": "touch"}, "TypeError: Session.touch() missing"),
    ],
)
def test_a_refusal_says_why_and_the_page_lives_on(page, request_, words):
    page.tick(0.1)
    told = page.ask(**request_)
    assert told["kind"] == "error"
    assert words in told["status"]
    at = page.row[0]
    page.tick(0.1)
    assert page.row[0] > at
    assert not page.kept


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ({"env_id": "CartPole-v1"}, "of this package"),
        ({"preset": "mule"}, "mule"),
        ({"arguments": "friction=-2"}, "friction"),
        ({"arguments": "friction"}, "key=value"),
        ({"arguments": "sim_dt=1e-6"}, "at most 10000 substeps in a control step, got 20000"),
        ({"policy": "docs"}, "docs"),
        ({"seed": "many"}, "many"),
    ],
)
def test_a_refused_set_up_leaves_the_page_as_it_is(page, form, words):
    asked = {"env_id": LEG, "arguments": "", "preset": "", "policy": "run", "seed": 0} | form
    told = page.ask("setup", **asked)
    assert told["kind"] == "error"
    assert words in told["status"]
    assert not page.kept


def test_another_set_up_gets_a_page_of_its_own(page):
    told = page.ask(
        "setup",
        env_id=LEG,
        arguments="friction=0.7 trunk_mass=60",
        preset="identified",
        policy="walk",
        seed=4,
    )
    assert told["go"] == "?setup=kept"
    arguments = {"friction": 0.7, "trunk_mass": 60, "preset": "identified"}
    assert page.kept == [{"env_id": LEG, "arguments": arguments, "policy": "walk", "seed": 4}]


def raising(*given, **more):
    raise RuntimeError("out of order")


@pytest.mark.parametrize(
    ("predict", "words"),
    [
        (lambda *_, **__: (np.full(4, np.nan), None), "expected finite actions"),
        (lambda *_, **__: (["fast"], None), "could not convert"),
        (lambda *_, **__: 3.0, "expected predict to return actions and a state"),
        (lambda *_, **__: sys.exit(3), "it raised SystemExit: 3"),
        (raising, "policy walk: expected actions, it raised RuntimeError: out of order"),
    ],
)
def test_a_policy_that_fails_pauses_the_page_until_another_drives(tmp_path, predict, words):
    page = Page(tmp_path, policy="walk")
    page.tick(0.1)
    page.player.simulation._actor.policy = SimpleNamespace(predict=predict)
    told = []
    page.tab.wire.on_change("told", lambda attr, old, new: told.append(new))
    page.tick(0.1)
    assert words in told[0]["status"]
    assert (told[0]["kind"], told[0]["playing"]) == ("error", False)
    assert page.session.playing is False
    page.ask("step")  # may show what was simulated before
    assert words in page.ask("step")["status"]
    page.ask("reset", policy="run")
    page.ask("play", value=True)
    page.tick(0.1)
    assert page.row[0] > 0.05
    page.tab.close()


@pytest.mark.parametrize("part", ["go", "row", "curves"])
def test_no_error_of_a_tick_stops_the_page_without_words(page, monkeypatch, part, capfd):
    page.tick(0.1)
    with monkeypatch.context() as broken:
        broken.setattr(page.player, part, raising)
        page.tick(0.1)
    assert page.session.playing is False
    assert page.tab.wire.told["status"] == "RuntimeError: out of order"
    assert "in raising" in capfd.readouterr().err  # the whole trace, for the author of what is broken
    page.ask("play", value=True)
    at = page.row[0]
    page.tick(0.1)
    assert page.row[0] > at


@pytest.mark.parametrize("name", HANDLERS)
def test_no_error_of_a_request_leaves_its_callback(page, monkeypatch, name):
    monkeypatch.setitem(HANDLERS, name, raising)
    told = page.ask(name)
    assert (told["status"], told["kind"]) == ("RuntimeError: out of order", "error")


def test_an_error_of_the_thread_that_writes_is_reported(page, monkeypatch):
    monkeypatch.setattr(records, "write", raising)
    page.ask("record", suffix=".csv")
    page.tick(0.1)
    told = []
    recording = page.player.recording
    recording._tell = lambda *what: told.append(what)
    page.player.recording = None
    recording.write().join()
    assert told == [(f"{recording.path}: RuntimeError: out of order", "error")]


def test_an_error_of_a_new_page_is_reported_on_it(tmp_path, monkeypatch):
    monkeypatch.setattr(session_module, "Simulation", raising)
    refused = opened(Pages(SETUP, tmp_path))
    assert refused.template_variables["reason"] == "RuntimeError: out of order"


def test_bars_of_the_reward_belong_to_the_moment_that_is_shown(page):
    player = page.player
    names = [name for name, _ in player.numbers]
    first = 3 + names.index(player.simulation.terms[0])
    shown = {}
    for _ in range(20):
        page.tick(0.04)
        shown[page.row[0]] = page.row[first : 3 + len(names)]
    earlier, later = (list(shown)[k] for k in (4, -1))
    assert not np.allclose(shown[earlier], shown[later], rtol=0.1)
    page.ask("back", value=earlier)
    np.testing.assert_allclose(page.row[first : 3 + len(names)], shown[earlier], rtol=1e-6)
    page.ask("play", value=True)
    np.testing.assert_allclose(page.row[first : 3 + len(names)], shown[later], rtol=1e-6)


def test_the_policies_that_the_page_offers_can_be_chosen(page):
    offered = page.tab._doc.template_variables["policies"]
    assert {"walk", "run", "open-loop", "shipped"} <= set(offered)
    assert page.ask("reset", policy="shipped")["kind"] == "note"
    page.tick(0.1)
    assert page.session.playing


def test_the_conditions_of_the_paper_are_the_paper(page):
    page.ask("condition", value="run, inelastic")
    (setup,) = page.kept
    assert setup["env_id"] == PAPER_ID
    assert setup["arguments"]["restitution"] == paper_values()["restitution"][0] == 0.0
    assert len(CONDITIONS) == 4

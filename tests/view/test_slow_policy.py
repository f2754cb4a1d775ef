"""Policies that take long, or never return: no other tab waits, and the page of such a policy lives on."""

from __future__ import annotations

import threading
import time
import warnings

import numpy as np
import pytest

pytest.importorskip("bokeh")

from hoof_env.view import tab as tab_module
from hoof_env.view.messages import collect_warnings
from hoof_env.view.simulation import Simulation
from tests.view.pages import LEG, Page

MOST = 60.0  # time after which a test ends that hangs [s]


class Waiting:
    """A policy that answers when it may."""

    def __init__(self):
        self.may = threading.Event()

    def predict(self, observation, **_):
        self.may.wait(MOST)
        return np.full(4, 0.1), None


class Endless:
    """A policy that never answers, in Python's own code."""

    def __init__(self):
        self.asked = threading.Event()

    def predict(self, observation, **_):
        self.asked.set()
        while True:
            try:
                sum(range(100))
            except Exception:
                continue


@pytest.fixture
def waiting(tmp_path, monkeypatch):
    """A page whose policy waits, and the policy."""
    monkeypatch.setattr(tab_module, "PATIENCE", 0.2)
    policy = Waiting()
    page = Page(tmp_path, policy=policy)
    yield page, policy
    policy.may.set()
    page.wait()
    page.tab.close()


def late(page):
    """Let a page play until it says that it waits; return what it told."""
    told = {}
    page.tab.wire.on_change("told", lambda attr, old, new: told.update(new))
    page.tab._last = time.monotonic() - 0.04
    page.tab._tick()
    end = time.monotonic() + MOST
    while "status" not in told and time.monotonic() < end:
        time.sleep(0.02)
        page.tab._tick()
    return told


def test_no_tab_waits_for_the_policy_of_another(waiting, tmp_path):
    slow, _ = waiting
    quick = Page(tmp_path)
    slow.tab._last = time.monotonic() - 0.04
    slow.tab._tick()
    quick.tick(0.2)
    assert quick.row[0] == pytest.approx(0.2, abs=0.05)
    assert slow.tab._worker.is_busy
    quick.tab.close()


def test_a_page_says_that_its_policy_takes_long_and_pauses_meanwhile(waiting):
    page, policy = waiting
    told = late(page)
    assert "has not answered" in told["status"]
    assert told["kind"] == "warning"
    page.tab._on_asked("asked", None, {"name": "touch", "setting": "friction", "value": 0.3, "count": 1})
    page.tab._on_asked("asked", None, {"name": "play", "count": 2})
    page.tab._tick()
    page.tab._send()
    assert page.tab.wire.told["playing"] is False
    # When the policy answers at last, what was asked for is done, and states are the engine's.
    policy.may.set()
    page.wait()
    page.tick(0.04)
    assert page.player.simulation.parameters == {"friction": 0.3}
    page.ask("play")
    page.tick(0.2)
    twin = Simulation(LEG, policy=policy)
    twin.reset()
    twin.step()
    twin.step()
    twin.touch("friction", 0.3)
    chunks = [twin.step() for _ in range(8)]
    curves, _ = page.player.history.between(0.05, 0.15)
    time_ = np.concatenate([chunk.columns["time"] for chunk in chunks])
    normal = np.concatenate([c.columns["toe_normal"] + c.columns["heel_normal"] for c in chunks])
    rows = np.searchsorted(time_, curves["time"])
    assert len(rows) > 30
    np.testing.assert_array_equal(normal[rows], curves["normal"])


@pytest.mark.parametrize(
    "request_",
    [
        {"name": "reset", "seed": None, "policy": "walk"},
        {"name": "setup", "env_id": LEG, "arguments": "", "preset": "", "policy": "walk", "seed": 0},
    ],
)
def test_another_policy_replaces_one_that_never_returns(tmp_path, monkeypatch, request_):
    monkeypatch.setattr(tab_module, "PATIENCE", 0.2)
    policy = Endless()
    page = Page(tmp_path, policy=policy)
    told = late(page)
    assert policy.asked.is_set()
    assert "has not answered" in told["status"]
    for policy_name, key in (("gallop", "error"), ("walk", "note")):
        told.clear()
        page.tab._on_asked("asked", None, request_ | {"policy": policy_name, "count": 1})
        end = time.monotonic() + MOST
        while told.get("kind") != key and time.monotonic() < end:
            time.sleep(0.02)
            page.tab._tick()
        assert told["kind"] == key
    assert told["go"] == "?setup=kept"
    (setup,) = page.kept
    assert (setup["env_id"], setup["policy"]) == (LEG, "walk")
    # The page goes there, and its thread ends.
    page.tab.close()
    page.tab._worker._thread.join(MOST)
    assert not page.tab._worker._thread.is_alive()


def test_a_tab_that_is_closed_while_its_policy_blocks_writes_its_recording(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(tab_module, "PATIENCE", 0.2)
    policy = Waiting()
    policy.may.set()
    page = Page(tmp_path, policy=policy)
    page.ask("record", suffix=".csv")
    page.tick(0.2)
    policy.may.clear()
    late(page)
    page.tab.close()
    assert not page.tab.is_open
    end = time.monotonic() + MOST / 2
    said = ""
    while "Wrote" not in said and time.monotonic() < end:
        time.sleep(0.05)
        said += capfd.readouterr().out
    policy.may.set()
    (path,) = tmp_path.glob("*.csv")
    assert str(path) in said
    assert len(path.read_text().splitlines()) > 100
    page.tab._worker._thread.join(MOST)
    assert not page.tab._worker._thread.is_alive()


def test_warnings_are_collected_and_filters_stay():
    before = (warnings.showwarning, list(warnings.filters))
    with collect_warnings() as texts:
        warnings.warn("mine", stacklevel=1)
    assert texts == ["mine"]
    assert (warnings.showwarning, list(warnings.filters)) == before

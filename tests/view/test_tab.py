"""The page's tab without a browser: requests, refusals, recordings, and pages that stand alone."""

from __future__ import annotations

import asyncio
import re
import socket
import subprocess
import sys
import time
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from hoof_env import cli, film, records
from hoof_env.errors import HoofEnvError, MissingExtraError, ParameterError

pytest.importorskip("bokeh")

from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.models import Div
from bokeh.resources import INLINE
from tornado.httpclient import AsyncHTTPClient

from hoof_env.view import server
from hoof_env.view import tab as tab_module
from hoof_env.view.controls import CONDITIONS, PAPER_ID, paper_values, setting_sliders
from hoof_env.view.layout import template
from hoof_env.view.playback import Playback
from hoof_env.view.recording import FORMATS
from hoof_env.view.server import Pages, start
from hoof_env.view.simulation import Simulation
from hoof_env.view.tab import HANDLERS, Tab

LEG, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"
SETUP = {"env_id": LEG, "arguments": {}, "policy": None, "seed": 0}


class Page:
    """A tab, and what it told."""

    def __init__(self, out, **changes):
        self.kept = []
        keep = lambda setup: self.kept.append(setup) or "?setup=kept"  # noqa: E731
        self.tab = Tab(Document(), SETUP | changes, keep, out)

    def ask(self, name, **more):
        """Send a request; return what the tab told meanwhile."""
        heard = {}
        self.tab.wire.on_change("told", lambda attr, old, new: heard.update(new))
        self.tab._on_asked("asked", None, {"name": name, "count": 1} | more)
        return heard

    def tick(self, seconds):
        """Let real time pass."""
        for _ in range(round(seconds / 0.04)):
            self.tab._last = time.monotonic() - 0.04
            self.tab._tick()

    @property
    def news(self):
        """What was sent last: row, curves and terms by name, and True if they begin anew."""
        player = self.tab.player
        anew, *counts = self.tab.wire.news[:3]
        names = [[*player.history.between(-1, 1e9)[0]], ["time", *player.simulation.terms]]
        lengths = [player.drawing.length]
        for group, count in zip(names, counts, strict=True):
            lengths += [int(count)] * len(group)
        row, *columns, rest = np.split(self.tab.wire.news, 3 + np.cumsum([0, *lengths]))[1:]
        assert len(rest) == 0
        curves = dict(zip(names[0], columns, strict=False))
        steps = dict(zip(names[1], columns[len(curves) :], strict=True))
        return SimpleNamespace(row=row, curves=curves, steps=steps, anew=anew == 1)

    @property
    def row(self):
        return self.news.row


@pytest.fixture
def page(tmp_path):
    made = Page(tmp_path)
    yield made
    made.tab.close()


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
    assert page.tab.player.simulation.policy == "walk"
    assert page.row[0] == 0.0


def test_a_reset_says_whether_a_hand_still_drives(page):
    page.ask("drive", setting="crank_speed", value=3.0)
    assert page.ask("reset")["hand"] is True
    assert page.tab.player.simulation.hand["crank_speed"] == 3.0
    assert page.ask("reset", policy="walk")["hand"] is False
    assert page.tab.player.simulation.hand is None


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
    assert page.tab.player.simulation.parameters == {"stiffness": 40000.0, "restitution": 0.1}
    page.ask("touch", setting="target_speed", value=1.5)
    assert page.tab.player.simulation.commanded_speed == 1.5
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
    history = page.tab.player.history
    for k, group in enumerate(("curves", "steps")):
        time = np.array(has[group, "time"])
        assert len(time) > 30
        assert np.all(np.diff(time) > 0)
        assert time[-1] > page.tab.player.shown - 0.07
        whole = history.between(time[0], time[-1])[k]
        for name, values in whole.items():
            np.testing.assert_array_equal(has[group, name], values, err_msg=name)


def test_a_warning_waits_until_the_page_has_opened(tmp_path, monkeypatch):
    warned = lambda **setup: warnings.warn("A zip.", stacklevel=1) or Simulation(**setup)  # noqa: E731
    monkeypatch.setattr(tab_module, "Simulation", warned)
    page = Page(tmp_path)
    page.tick(0.2)
    assert page.tab.wire.told == {}
    told = page.ask("show")
    assert (told["status"], told["kind"]) == ("A zip.", "warning")
    assert page.ask("show") == {}
    page.tab.close()


def test_a_push_adds_its_impulse_over_the_mass(page):
    page.tick(0.1)
    leg = page.tab.player.simulation.env.unwrapped
    before = leg.batch.engine.state["momentum_x"].item()
    assert "60 N s" in page.ask("push", value=60)["status"]
    assert leg.batch.engine.state["momentum_x"].item() == pytest.approx(before + 60)


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
        ({"name": "push", "value": 1e9}, "push"),
        ({"name": "stop everything"}, "request"),
        ({"name": "touch"}, "TypeError: Tab.touch() missing"),
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
        (lambda *_, **__: 3.0, "TypeError"),
        (raising, "policy walk: expected actions, it raised RuntimeError: out of order"),
    ],
)
def test_a_policy_that_fails_pauses_the_page_until_another_drives(tmp_path, predict, words):
    page = Page(tmp_path, policy="walk")
    page.tick(0.1)
    page.tab.player.simulation._player = SimpleNamespace(predict=predict)
    told = []
    page.tab.wire.on_change("told", lambda attr, old, new: told.append(new))
    page.tick(0.1)
    assert words in told[0]["status"]
    assert (told[0]["kind"], told[0]["playing"]) == ("error", False)
    assert page.tab.playing is False
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
        broken.setattr(page.tab.player, part, raising)
        page.tick(0.1)
    assert page.tab.playing is False
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


def test_an_error_of_the_thread_that_writes_is_told(page, monkeypatch):
    monkeypatch.setattr(records, "write", raising)
    page.ask("record", suffix=".csv")
    page.tick(0.1)
    told = []
    recording = page.tab.player.recording
    recording._tell = lambda *what: told.append(what)
    page.tab.player.recording = None
    recording.write().join()
    assert told == [(f"{recording.path}: RuntimeError: out of order", "error")]


def test_an_error_of_a_new_page_is_told_on_it(tmp_path, monkeypatch):
    monkeypatch.setattr(tab_module, "Simulation", raising)
    refused = opened(Pages(SETUP, tmp_path))
    assert refused.template_variables["reason"] == "RuntimeError: out of order"


def test_bars_of_the_reward_are_those_of_the_moment_that_is_shown(page):
    player = page.tab.player
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
    assert page.tab.playing


def test_the_conditions_of_the_paper_are_the_paper(page):
    page.ask("condition", value="run, inelastic")
    (setup,) = page.kept
    assert setup["env_id"] == PAPER_ID
    assert setup["arguments"]["restitution"] == paper_values()["restitution"][0] == 0.0
    assert len(CONDITIONS) == 4


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_recording_is_written_in_each_format(page, suffix, tmp_path):
    if suffix in (".mp4", ".gif"):
        pytest.importorskip("imageio_ffmpeg")
        pytest.importorskip("pygame")
    assert page.ask("record", suffix=suffix)["recording"] is True
    page.tick(0.2)
    writes = []
    recording = page.tab.player.recording
    recording._tell = lambda *what: writes.append(what)
    page.tab.player.recording = None
    recording.write().join()
    assert writes[0][1] == "note", writes
    (path,) = tmp_path.glob(f"horseleg-v0-*{suffix}")
    assert path.stat().st_size > 1000


def test_a_film_begins_with_the_recording(page, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    pytest.importorskip("pygame")
    made = []
    monkeypatch.setattr(film, "write_film", lambda frames, path, fps: made.extend(frames))
    page.tick(0.6)
    page.ask("record", suffix=".gif")
    recording = page.tab.player.recording
    page.tick(0.4)
    page.tab.player.recording = None
    recording.write().join()
    assert 10 <= len(made) <= 11  # 0.4 s


def test_a_tab_that_is_closed_during_a_recording_writes_it(tmp_path, capfd):
    page = Page(tmp_path)
    page.ask("record", suffix=".csv")
    page.tick(0.2)
    recording = page.tab.player.recording
    write = recording.write
    threads = []
    recording.write = lambda: threads.append(write())
    page.tab.close()
    threads[0].join()
    (path,) = tmp_path.glob("*.csv")
    assert str(path) in capfd.readouterr().out
    assert len(path.read_text().splitlines()) > 100


@pytest.mark.parametrize("end", ["reset", "episode"])
def test_a_recording_describes_its_own_episode_when_the_next_one_has_begun(end, tmp_path, monkeypatch):
    page = Page(tmp_path, arguments={"episode_seconds": 0.5}, policy="walk", seed=3)
    described = []
    monkeypatch.setattr(records, "write", lambda columns, about, path: described.append(about))
    page.ask("touch", setting="friction", value=0.5)
    page.ask("record", suffix=".csv")
    recording = page.tab.player.recording
    page.tick(0.2)
    if end == "reset":
        page.ask("reset", seed=9, policy="run")
    else:
        page.tick(0.6)
    page.ask("touch", setting="friction", value=0.7)
    assert page.tab.player.simulation.seed != 3
    recording.write().join()
    for about in described:
        assert (about["seed"], about["policy"]) == (3, "walk")
        assert about["parameters"]["friction"] == 0.5
    assert described
    page.tab.close()


def html_of(page):
    """Return the page of a tab as the server gives it."""
    doc = page.tab._doc
    return file_html(doc, INLINE, template=doc.template, template_variables=doc.template_variables)


def test_texts_from_outside_are_escaped(page):
    text = '"><script>alert(1)</script>'
    page.tab._doc.template_variables.update({"policy": text, "arguments": 'normal_law="flores" ' + text})
    found = html_of(page)
    assert text not in found
    assert 'value="&#34;&gt;&lt;script&gt;alert(1)' in found
    assert 'value="normal_law=&#34;flores&#34; ' in found
    doc = Document()
    doc.add_root(Div())
    refused = file_html(doc, INLINE, template=template("refused.html"), template_variables={"reason": text})
    assert "alert(1)" in refused
    assert text not in refused
    made = Playback.of_policy(LEG, seconds=0.1)
    made.title = text
    assert text not in made.html("bokeh.min.js")


def test_a_leg_with_one_foot_has_no_heel(tmp_path):
    page = Page(tmp_path, arguments={"preset": "klann"})
    page.tick(0.5)
    shown = html_of(page)
    assert 'class="heel"' not in shown
    assert "hoof angle" not in shown
    assert not [name for name in page.news.curves if "heel" in name or "angle" in name]
    page.tab.close()
    made = Playback.of_policy(LEG, seconds=0.4, preset="klann")
    assert "hoof angle" not in made.html("bokeh.min.js")
    assert 'class="heel"' in html_of(Page(tmp_path))


def test_every_slider_of_a_setting_has_unit_and_range(page):
    for env_id, arguments in ((LEG, {"drive": "motor"}), (HORSE, {})):
        tab = Page(page.tab._out, env_id=env_id, arguments=arguments).tab
        sliders = [one for group in setting_sliders(tab.player.simulation).values() for one in group]
        assert len(sliders) >= 6
        for one in sliders:
            assert one.low < one.high
            assert one.low - 1e-9 <= one.value <= one.high + 1e-9
        assert {"touch", "drive"} <= set(HANDLERS)
        marks = {one.name: [text for _, text in one.marks] for one in sliders}
        assert marks["stiffness"] == ["20000"]
        assert marks["restitution"] == ["0", "1"]


# Server


def test_a_port_that_is_taken_is_told():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(ParameterError, match=r"port: expected a free one, \d+ is taken"):
            start(SETUP, port=taken.getsockname()[1])
    with pytest.raises(ParameterError, match="address"):
        start(SETUP, address="203.0.113.7", port=0)
    with pytest.raises(ParameterError, match=r"address: .* IPv4 .* got '::1'"):
        start(SETUP, address="::1", port=0)


@pytest.mark.parametrize(
    "options", [["--id", "CartPole-v1"], ["--port", "99999"], ["--policy", "gallop"], ["--seed", "-1"]]
)
def test_the_command_refuses_before_it_serves(options, capsys):
    assert cli.main(["view", "--no-open", *options]) == 2
    assert "hoof-env: error" in capsys.readouterr().err


def test_without_bokeh_the_command_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(server, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'pip install "hoof-env\[view\]"'):
        start(SETUP)


def opened(pages, **arguments):
    """Open a page as Bokeh does; return its document."""
    doc = Document()
    request = SimpleNamespace(arguments=arguments)
    doc._session_context = lambda: SimpleNamespace(request=request)
    pages.open(doc)
    return doc


def test_a_page_that_is_refused_takes_no_place_and_an_old_one_is_told(tmp_path):
    pages = Pages(SETUP, tmp_path)
    assert "too old" in opened(pages, setup=[b"guessed"]).template_variables["reason"]
    kept = pages.keep(SETUP | {"seed": 7}).partition("=")[2]
    doc = opened(pages, setup=[kept.encode()])
    assert doc.template_variables["simulation"].seed == 7
    assert len(pages._tabs) == 1


def test_no_more_tabs_than_the_limit_however_fast_they_are_opened(tmp_path, monkeypatch):
    """Requests that come in the same instant, before any browser is connected."""
    monkeypatch.setattr(server, "MOST_TABS", 2)
    running, url = start(SETUP, port=0, out=tmp_path)
    loop = running.io_loop
    client = AsyncHTTPClient()

    async def load(count):
        answers = [client.fetch(url, request_timeout=300, connect_timeout=300) for _ in range(count)]
        return [(await answer).body.decode() for answer in answers]

    async def at_last():
        # Sessions without a browser are let go after a second.
        for _ in range(50):
            (page,) = await load(1)
            if "Set-up" in page:
                return page
            await asyncio.sleep(0.2)
        return page

    pages = loop.run_sync(lambda: load(4))
    assert sum("Set-up" in page for page in pages) == 2
    assert sum('http-equiv="refresh"' in page and "2 tabs are open" in page for page in pages) == 2
    assert "Set-up" in loop.run_sync(at_last)
    running.stop()


# Pages that stand alone


def test_a_page_stands_alone_with_the_numbers_of_the_record(tmp_path):
    made = Playback.of_policy(LEG, "walk", seconds=0.4, friction=0.3)
    (record,) = made.records
    assert len(record.rows) == 21
    assert record.curves["time"][-1] == pytest.approx(0.4)
    text = made.write(tmp_path / "page.html").read_text()
    outside = r"""<(?:script|link|img|iframe)[^>]*(?:src|href)=["'](?!data:)"""
    assert not re.findall(outside, text[:1000] + text[-4000:])
    assert len(text) < 2.2e6
    linked = made.html("bokeh.min.js")
    assert '<script src="bokeh.min.js">' in linked
    assert len(linked) < 4e5
    assert made._repr_html_().startswith("<iframe title=")
    assert "0.40 s" in repr(made)


def test_four_conditions_play_side_by_side():
    runs = [
        {"label": name, "env_id": PAPER_ID, "policy": arguments["gait"], "arguments": arguments}
        for name, arguments in CONDITIONS.items()
    ]
    made = Playback.play(*runs, seconds=0.6)
    peaks = {record.label: record.curves["normal"].max() for record in made.records}
    assert peaks["run, inelastic"] > peaks["run, elastic"] > peaks["walk, elastic"] > 0
    assert made.html("bokeh.min.js").count('<div data-record="') == 4
    with pytest.raises(HoofEnvError, match="records"):
        Playback("nothing", [])
    short = {"env_id": LEG, "arguments": {"episode_seconds": 0.1}}
    with pytest.raises(ParameterError, match="skip: expected less than the episode takes, got 2 s"):
        Playback.play(short, skip=2.0)


def test_view_needs_no_browser_to_import():
    code = "import sys, hoof_env, hoof_env.cli; sys.exit('bokeh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=120).returncode == 0

"""The live page and a page that stands alone in Chromium: each slider, each button, keys, names, widths."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("bokeh")
playwright = pytest.importorskip("playwright.sync_api")

from hoof_env.view.figures import TICKS  # noqa: E402 - where there is no Bokeh there is none
from hoof_env.view.playback import Playback  # noqa: E402

ROOT = Path(__file__).parents[2]
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
LEG = "hoof_env/HorseLeg-v0"
SERVE = f"""
import sys
from pathlib import Path
from hoof_env.view.server import start
class Broken:
    def predict(self, observation, **_):
        return [float("nan")] * 4, None
policy = Broken() if "broken" in sys.argv else None
setup = dict(env_id={LEG!r}, arguments=dict(drive="motor"), policy=policy, seed=0)
server, url = start(setup, port=0, out=Path("."))
print(url, flush=True)
server.io_loop.start()
"""
NAMES = """[...document.querySelectorAll('button, input, select, summary')].filter((e) => e.offsetParent)
    .filter((e) => !(e.labels?.length || e.textContent.trim() || e.getAttribute('aria-label')))
    .map((e) => e.outerHTML)"""
TOO_WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


@contextmanager
def served(folder, *options):
    """Serve a page from another process, as the browser's driver has a loop of its own; give its address."""
    command = [sys.executable, "-c", SERVE, *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    """Address of a page, and its folder of recordings."""
    folder = tmp_path_factory.mktemp("recordings")
    with served(folder) as address:
        yield address, folder


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as players:
        try:
            started = players.chromium.launch(executable_path=CHROMIUM)
        except playwright.Error as error:
            pytest.skip(f"no Chromium here: {str(error).splitlines()[0]}")
        yield started
        started.close()


class Tab:
    """A page and what its console said."""

    def __init__(self, browser, address, width=1280):
        self.page = browser.new_page(viewport={"width": width, "height": 900})
        self.faults = []
        self.page.on("console", lambda m: self.faults.append(m.text) if m.type in ("error", "warning") else 0)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.goto(address)
        self.page.wait_for_selector("body[data-ready]", timeout=60_000)

    def number(self, name):
        text = self.page.locator(f'[data-number="{name}"]').first.text_content()
        return float(text) if text != "–" else None

    def wait(self, condition, **values):
        self.page.wait_for_function(condition, arg=values, timeout=30_000)

    def status(self, words):
        self.wait("({words}) => document.querySelector('#status').textContent.includes(words)", words=words)

    def set(self, name, value):
        """Move a slider as a hand does: to a value, with the events of a browser."""
        self.page.locator(f"#{name}").evaluate(
            "(e, v) => { e.value = v; for (const t of ['input', 'change']) e.dispatchEvent(new Event(t)) }",
            str(value),
        )

    @property
    def states(self):
        return int(self.page.evaluate("document.body.dataset.states"))


@pytest.fixture
def tab(browser, url):
    made = Tab(browser, url[0])
    yield made
    made.page.close()
    assert not made.faults


def test_the_page_plays_and_says_what_the_engine_says(tab):
    tab.wait("() => Number(document.querySelector('[data-number=\"peak 0\"]').textContent) > 500")
    assert tab.number("time") > 0
    assert tab.page.evaluate(NAMES) == []
    assert tab.page.evaluate(TOO_WIDE) <= 0
    assert "HorseLeg-v0" in tab.page.title()
    # A figure of curves is painted: it has more than its background.
    canvas = tab.page.locator(".curve canvas").first
    assert (
        canvas.evaluate(
            """(c) => new Set(new Uint32Array(
            c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size""",
        )
        > 10
    )


def test_texts_at_ticks_have_no_rounding_errors(tab):
    texts = [
        tab.page.evaluate(f"((tick) => {{ {TICKS} }})({tick})")
        for tick in (-0.6000000000000001, 0, 2.5, 12000.000000000002)
    ]
    assert texts == [-0.6, 0, 2.5, "12k"]


def test_buttons_and_keys(tab):
    page = tab.page
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play").wait_for()
    page.wait_for_timeout(200)
    before = tab.number("time")
    page.get_by_role("button", name="Step").click()
    tab.wait("({t}) => Number(document.querySelector('[data-number=time]').textContent) > t", t=before)
    assert tab.number("time") == pytest.approx(before + 0.02, abs=0.011)
    page.locator("h1").click()
    page.keyboard.press(".")
    tab.wait(
        "({t}) => Number(document.querySelector('[data-number=time]').textContent) > t", t=before + 0.025
    )
    page.keyboard.press("Space")
    page.get_by_role("button", name="Pause").wait_for()
    tab.wait("({t}) => Number(document.querySelector('[data-number=time]').textContent) > t", t=before + 0.3)
    tab.set("back", 0.1)
    page.get_by_role("button", name="Play").wait_for()
    tab.wait("() => Number(document.querySelector('[data-number=time]').textContent) < 0.13")
    page.keyboard.press("r")
    tab.status("Seed")
    assert tab.number("time") == 0
    for name in ("zoom in", "zoom out"):
        page.get_by_role("button", name=name).click()
    page.get_by_label("follow").uncheck()


def test_each_slider_reaches_the_simulation(tab):
    page = tab.page
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play").wait_for()
    sliders = page.locator("aside input[type=range]")
    count = sliders.count()
    assert count >= 12
    seen = set()
    for k in range(count):
        slider = sliders.nth(k)
        name = slider.get_attribute("id")
        if slider.get_attribute("data-late") is not None:
            continue
        low, high = (float(slider.get_attribute(end)) for end in ("min", "max"))
        tab.set(name, low + 0.4 * (high - low))
        seen.add(slider.locator("xpath=..").locator("output").text_content())
    page.wait_for_timeout(300)
    status = page.locator("#status")
    assert status.get_attribute("data-kind") == "note", status.text_content()
    assert page.locator("[data-ask=release]").is_enabled()
    page.locator("[data-ask=release]").click()
    tab.status("policy drives")
    assert len(seen) > 8


def test_stiffer_ground_gives_a_higher_peak(tab):
    """The numbers change as the engine says: the loading rate goes with the stiffness."""
    rates = []
    for logarithm in (3.6, 5.2):
        tab.set("touch-stiffness", logarithm)
        tab.page.get_by_role("button", name="Reset").click()
        tab.wait("() => Number(document.querySelector('[data-number=\"duty 0\"]').textContent) > 0")
        tab.page.wait_for_timeout(700)
        rates.append(tab.number("loading rate 0"))
    assert rates[1] > 1.5 * rates[0]


def test_a_refusal_is_told_and_another_set_up_is_a_new_page(tab):
    page = tab.page
    page.get_by_label("environment").fill("CartPole-v1")
    page.get_by_role("button", name="Apply").click()
    tab.status("CartPole-v1")
    states = tab.states
    tab.wait("({n}) => Number(document.body.dataset.states) > n + 3", n=states)
    page.get_by_role("button", name="run, inelastic").click()
    page.wait_for_url("**/?setup=*")
    page.wait_for_selector("body[data-ready]")
    tab.wait("() => Number(document.querySelector('[data-number=\"peak 0\"]').textContent) > 7000")
    assert page.locator("h1").text_content() == "HorseLegFixed-v0"


def test_a_policy_that_fails_before_the_page_is_there_is_told(browser, tmp_path):
    with served(tmp_path, "broken") as address:
        tab = Tab(browser, address)
        tab.status("expected finite actions")
        tab.page.get_by_role("button", name="Play").wait_for()
        tab.page.close()
    assert not tab.faults


def test_a_push_changes_the_speed_of_the_trunk(tab):
    page = tab.page
    page.get_by_role("button", name="Push").click()
    page.wait_for_selector("#status[data-kind=error]")
    tab.status('expected none with drive="motor"')
    page.get_by_label("arguments, key=value").fill("")
    page.get_by_role("button", name="Apply").click()
    page.wait_for_url("**/?setup=*")
    page.wait_for_selector("body[data-ready]")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play").wait_for()
    page.get_by_role("button", name="Step").click()
    page.wait_for_timeout(300)
    before = tab.number("speed")
    page.get_by_label("impulse at the trunk").fill("-200")
    page.get_by_role("button", name="Push").click()
    tab.status("Pushed by -200 N s.")
    page.get_by_role("button", name="Step").click()
    words = "({v}) => Number(document.querySelector('[data-number=speed]').textContent) < v - 1"
    tab.wait(words, v=before)  # 200 N s over 50 kg are 4 m/s, of which the ground takes some
    page.get_by_label("impulse at the trunk").fill("1e9")
    page.get_by_role("button", name="Push").click()
    page.wait_for_selector("#status[data-kind=error]")
    tab.status("push")


@pytest.mark.parametrize(("setting", "part"), [("exponent", 0.4), ("motor_inertia", 0.5)])
def test_sliders_that_begin_a_new_page(tab, setting, part):
    page = tab.page
    tab.set("touch-friction", 0.4)  # goes along to the new page
    page.wait_for_timeout(300)
    slider = page.locator(f"#touch-{setting}")
    low, high = (float(slider.get_attribute(end)) for end in ("min", "max"))
    tab.set(f"touch-{setting}", low + part * (high - low))
    asked = float(slider.input_value())
    if slider.get_attribute("data-log") is not None:
        asked = 10**asked
    page.wait_for_url("**/?setup=*")
    page.wait_for_selector("body[data-ready]")
    given = dict(pair.split("=") for pair in page.get_by_label("arguments, key=value").input_value().split())
    assert float(given[setting]) == pytest.approx(asked)
    assert float(given["friction"]) == pytest.approx(0.4)
    assert given["drive"] == '"motor"'
    tab.wait("() => Number(document.querySelector('[data-number=time]').textContent) > 0.1")


def test_a_recording_is_a_file(tab, url):
    page = tab.page
    page.get_by_label("format").select_option(".csv")
    page.get_by_role("button", name="Record").click()
    page.wait_for_timeout(400)
    page.get_by_role("button", name="Stop and write").click()
    tab.status("Wrote")
    assert list(url[1].glob("*.csv"))


def test_a_narrow_page_has_closed_controls(browser, url):
    tab = Tab(browser, url[0], width=390)
    assert tab.page.evaluate(TOO_WIDE) <= 0
    assert tab.page.locator("aside details[open]").count() == 0
    tab.page.get_by_text("Ground", exact=True).click()
    assert tab.page.locator("#touch-friction").is_visible()
    assert tab.page.evaluate(NAMES) == []
    tab.page.close()
    assert not tab.faults


def test_a_page_alone_plays_from_disk(browser, tmp_path):
    path = Playback.of_policy(LEG, "run", seconds=1.5).write(tmp_path / "page.html")
    tab = Tab(browser, path.as_uri())
    page = tab.page
    assert page.locator("output[for=at]").text_content() == "0.00 s"
    page.locator("#at").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("output[for=at]").text_content() == "0.02 s"
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("() => parseFloat(document.querySelector('output[for=at]').textContent) > 0.1")
    page.get_by_role("button", name="Pause").click()
    at = page.locator("output[for=at]").text_content()
    page.wait_for_timeout(200)
    assert page.locator("output[for=at]").text_content() == at
    page.locator("#at").fill("60")
    assert page.locator("output[for=at]").text_content() == "1.20 s"
    assert page.evaluate(NAMES) == []
    page.close()
    assert not tab.faults

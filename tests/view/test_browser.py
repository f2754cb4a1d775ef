"""The live page and a page that stands alone in Chromium: each slider, each button, keys, names, widths.

What is drawn is read from the page and compared with the engine, to the last bit.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bokeh")
playwright = pytest.importorskip("playwright.sync_api")

from hoof_env.view.controls import CONDITIONS, PAPER_ID, TURNS_ON  # noqa: E402 - where there is no Bokeh
from hoof_env.view.figures import TICKS  # noqa: E402
from hoof_env.view.history import RESOLUTION  # noqa: E402
from hoof_env.view.playback import Playback  # noqa: E402
from hoof_env.view.simulation import Simulation  # noqa: E402

ROOT = Path(__file__).parents[2]
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
LEG = "hoof_env/HorseLeg-v0"
MOTOR = {"drive": "motor"}
SERVE = f"""
import sys
from pathlib import Path
from hoof_env.view.server import start
class Broken:
    def predict(self, observation, **_):
        raise ValueError("there is no layer 3")
policy = Broken() if "broken" in sys.argv else None
env_id = "hoof_env/Horse-v0" if "horse" in sys.argv else {LEG!r}
setup = dict(env_id=env_id, arguments={MOTOR!r}, policy=policy, seed=0)
server, url = start(setup, port=0, out=Path("."))
print(url, flush=True)
server.io_loop.start()
"""
NAMES = """[...document.querySelectorAll('button, input, select, summary')].filter((e) => e.offsetParent)
    .filter((e) => !(e.labels?.length || e.textContent.trim() || e.getAttribute('aria-label')))
    .map((e) => e.outerHTML)"""
TOO_WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
CUT_CELLS = """() => {
    const edge = document.querySelector('.numbers').getBoundingClientRect().right + 0.5
    const cells = [...document.querySelectorAll('.numbers th, .numbers td')]
    return cells.filter((cell) => cell.getBoundingClientRect().right > edge).map((cell) => cell.textContent)
}"""
PAINTED = """(canvas) => new Set(new Uint32Array(canvas.getContext('2d').getImageData(
    0, 0, canvas.width, canvas.height).data.buffer)).size"""
SOURCE = "Bokeh.documents[0].get_model_by_name(name).renderers[0].data_source.data"
READ = f"(name) => Object.fromEntries(Object.entries({SOURCE}).map(([column, all]) => [column, [...all]]))"
WIRE = "Bokeh.documents[0].get_model_by_name('scene').tags[0]"
PICTURES = """() => new Promise((done) => {
    let pictures = 0
    const seen = new MutationObserver(() => pictures++)
    seen.observe(document.querySelector('[data-number=time]'), {childList: true})
    setTimeout(() => done(pictures), 2000)
})"""


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
        self.touched = {}
        self.page.on("console", lambda m: self.faults.append(m.text) if m.type in ("error", "warning") else 0)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.goto(address)
        self.page.wait_for_selector("body[data-ready]", timeout=60_000)

    def number(self, name):
        text = self.page.locator(f'[data-number="{name}"]').first.text_content()
        return float(text) if text != "–" else None

    def wait(self, condition, **values):
        self.page.wait_for_function(condition, arg=values, timeout=120_000)

    def wait_number(self, name, condition):
        """Wait until a number of the page meets a condition, as "> 3"."""
        self.wait(
            f"""() => Number(document.querySelector('[data-number="{name}"]').textContent) {condition}"""
        )

    def status(self, words):
        self.wait("({words}) => document.querySelector('#status').textContent.includes(words)", words=words)

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def pause(self):
        self.press("Pause")
        self.page.get_by_role("button", name="Play").wait_for()

    def steps(self, count):
        """Press Step some times; each is shown before the next."""
        for _ in range(count):
            before = self.states
            self.press("Step")
            self.wait("({n}) => Number(document.body.dataset.states) > n", n=before)

    def go(self, act):
        """Do what leads to another page, and wait for it."""
        before = self.page.url
        act()
        self.page.wait_for_url(lambda url: url != before, timeout=120_000)
        self.page.wait_for_selector("body[data-ready]", timeout=120_000)

    def check_drawn(self, columns):
        """Check that forces and the numbers of a page that pauses are the engine's, bitwise."""
        end = self.time
        last = end - 1.01 * RESOLUTION
        for name, column in (("normal", "normal"), ("forces", "grf"), ("forces", "friction")):
            self.wait(f"({{name, last}}) => {SOURCE}.time.at(-1) > last", name=name, last=last)
            drawn = self.page.evaluate(READ, name)
            time = np.array(drawn["time"])
            assert len(time) > 5
            rows = np.searchsorted(columns["time"], time)
            np.testing.assert_array_equal(columns["time"][rows], time)
            np.testing.assert_array_equal(columns[column][rows], drawn[column], err_msg=name)
        now = np.searchsorted(columns["time"], end - 1e-6)
        assert self.number("grf 0") == pytest.approx(columns["grf"][now], abs=0.51)
        assert self.number("time") == pytest.approx(end, abs=0.0051)

    def set(self, name, value):
        """Move a slider as a hand does: to a value, with the events of a browser."""
        self.page.locator(f"#{name}").evaluate(
            "(e, v) => { e.value = v; for (const t of ['input', 'change']) e.dispatchEvent(new Event(t)) }",
            str(value),
        )

    @property
    def time(self):
        """Time that is shown [s], with all digits."""
        return self.page.evaluate(f"{WIRE}.news[3]")

    @property
    def states(self):
        return int(self.page.evaluate("document.body.dataset.states"))


@pytest.fixture(scope="module")
def only_tab(browser, url):
    """The page that tests share, to load it once."""
    made = Tab(browser, url[0])
    yield made
    made.page.close()


@pytest.fixture
def tab(only_tab):
    yield only_tab
    assert not only_tab.faults


def forces(chunks):
    """Return time and forces of a simulation's chunks, from the columns that `export` writes."""
    columns = {name: np.concatenate([chunk.columns[name] for chunk in chunks]) for name in chunks[0].columns}
    return {
        "time": columns["time"],
        "normal": columns["toe_normal"] + columns["heel_normal"],
        "friction": columns["toe_friction"] + columns["heel_friction"],
        "grf": np.hypot(columns["force_x"], columns["force_y"]),
    }


def until(simulation, time):
    """Play a simulation from its start; return its forces up to a time [s]."""
    chunks = [simulation.reset()]
    while chunks[-1].columns["time"][-1] < time - 1e-6:
        chunks.append(simulation.step())
    return forces(chunks)


def test_the_page_plays_and_says_what_the_engine_says(tab):
    tab.wait_number("peak 0", "> 500")
    assert tab.page.evaluate(NAMES) == []
    assert tab.page.evaluate(TOO_WIDE) <= 0
    assert "HorseLeg-v0" in tab.page.title()
    # Sliders say the value itself, whatever notch is nearest.
    assert tab.page.locator("output[for=touch-stiffness]").text_content() == "20000 N/m^n"
    # A figure of curves is painted: it has more than its background.
    assert tab.page.locator(".curve canvas").first.evaluate(PAINTED) > 10
    tab.pause()
    tab.check_drawn(until(Simulation(LEG, MOTOR), tab.time))


def test_texts_at_ticks_have_no_rounding_errors(tab):
    ticks = (-0.6000000000000001, 0, 2.5, 12000.000000000002)
    texts = [tab.page.evaluate(f"((tick) => {{ {TICKS} }})({tick})") for tick in ticks]
    assert texts == [-0.6, 0, 2.5, "12k"]


def test_buttons_and_keys(tab):
    page = tab.page
    before = tab.number("time")
    tab.press("Step")
    tab.wait_number("time", f"> {before}")
    assert tab.number("time") == pytest.approx(before + 0.02, abs=0.011)
    page.locator("h1").click()
    page.keyboard.press(".")
    tab.wait_number("time", f"> {before + 0.025}")
    page.keyboard.press("Space")
    page.get_by_role("button", name="Pause").wait_for()
    tab.wait_number("time", f"> {before + 0.3}")
    tab.set("back", 0.1)
    page.get_by_role("button", name="Play").wait_for()
    tab.wait_number("time", "< 0.13")
    page.keyboard.press("r")
    tab.status("Seed")
    tab.wait_number("time", "== 0")
    for name in ("zoom in", "zoom out"):
        tab.press(name)
    page.get_by_label("follow").uncheck()
    page.get_by_label("follow").check()


def test_the_play_speed_follows_its_slider(tab):
    passed = {}
    for speed in ("0.05", "2"):
        tab.set("speed", speed)
        tab.press("Reset")
        tab.wait_number("time", "== 0")
        tab.press("Play")
        tab.page.wait_for_timeout(1500)
        tab.pause()
        passed[speed] = tab.number("time")
    assert 0 < passed["0.05"] < 0.05 * 30
    assert passed["2"] > 4 * passed["0.05"]
    tab.set("speed", 1)


def test_each_slider_changes_the_forces_as_the_engine_says(tab, url):
    """The page draws, and a recording has, what a simulation gives that is touched at the same times; without
    the touch it would give something else."""
    page = tab.page
    tab.press("Reset")
    tab.wait_number("time", "== 0")
    simulation = Simulation(LEG, MOTOR)
    twin = Simulation(LEG, MOTOR)
    twin.reset()
    chunks = [simulation.reset()]
    page.get_by_label("format").select_option(".csv")
    tab.press("Record")
    page.get_by_role("button", name="Stop and write").wait_for()
    sliders = page.locator("aside input[type=range]:not([data-late])")
    assert sliders.count() >= 12
    for k in range(sliders.count()):
        slider = sliders.nth(k)
        name = slider.get_attribute("data-name")
        low, high = (float(slider.get_attribute(end)) for end in ("min", "max"))
        part = 0.05 if name == "motor_torque" else 0.4  # what the motor does not reach is no limit
        tab.set(slider.get_attribute("id"), low + part * (high - low))
        page.wait_for_timeout(100)  # the second of both events waits for 60 ms
        asked = page.evaluate(f"{WIRE}.asked")
        assert (asked["name"], asked["setting"]) == (slider.get_attribute("data-ask"), name)
        said = slider.locator("xpath=..").locator("output").text_content()
        assert float(said.split()[0]) == pytest.approx(asked["value"], rel=1e-3)
        twin.env.unwrapped.set_state(simulation.env.unwrapped.get_state())
        twin.hand = simulation.hand
        twin._observation = simulation._observation
        if name == "target_speed":
            simulation.command_speed(asked["value"])
        elif asked["name"] == "drive":
            simulation.drive(name, asked["value"])
        else:
            assert simulation.touch(name, asked["value"])
            tab.touched[name] = asked["value"]
        tab.steps(3)
        touched = [simulation.step() for _ in range(3)]
        untouched = [twin.step() for _ in range(3)]
        chunks += touched
        tab.check_drawn(forces(chunks))
        if name == "target_speed":
            assert tab.number("target") == pytest.approx(asked["value"], abs=0.0051)
        else:
            changed = [
                c for c in touched[-1].columns if np.any(touched[-1].columns[c] != untouched[-1].columns[c])
            ]
            assert changed, name
    status = page.locator("#status")
    assert status.get_attribute("data-kind") == "note", status.text_content()
    tab.press("Stop and write")
    tab.status("Wrote")
    (path,) = url[1].glob("*.csv")
    lines = path.read_text().splitlines()
    names = [name.partition(" ")[0] for name in lines[0].split(",")]
    record = dict(zip(names, np.array([line.split(",") for line in lines[1:]], float).T, strict=True))
    assert len(record["time"]) == sum(len(chunk.columns["time"]) for chunk in chunks[1:])
    for name, values in record.items():
        if name != "free_moment":
            np.testing.assert_array_equal(values, np.concatenate([c.columns[name] for c in chunks[1:]]))
    page.locator("[data-ask=release]").click()
    tab.status("policy drives")


def test_sliders_that_are_moved_while_an_episode_starts_anew(tab):
    """Both act, whatever comes first; the episode equals an engine's with these settings."""
    tab.press("Play")
    race = """() => {
        const slider = document.querySelector('#touch-friction')
        const reset = document.querySelector('[data-ask=reset]')
        for (let k = 0; k < 20; k++) {
            reset.click()
            slider.value = 0.2 + 0.02 * k
            slider.dispatchEvent(new Event('input'))
            reset.click()
        }
        slider.dispatchEvent(new Event('change'))
    }"""
    tab.page.evaluate(race)
    tab.page.wait_for_timeout(200)
    tab.pause()
    tab.press("Reset")
    tab.status("Seed 0")
    tab.wait_number("time", "== 0")
    tab.steps(4)
    assert tab.page.locator("#status").get_attribute("data-kind") == "note"
    simulation = Simulation(LEG, MOTOR)
    friction = float(tab.page.locator("#touch-friction").input_value())
    for name, value in (tab.touched | {"friction": friction}).items():
        simulation.touch(name, value)
    assert simulation.parameters["friction"] == pytest.approx(0.58)
    tab.check_drawn(until(simulation, 0.08))


def test_sliders_that_begin_a_new_page(tab):
    page = tab.page
    for setting, part in (("exponent", 0.4), ("motor_inertia", 0.5)):
        slider = page.locator(f"#touch-{setting}")
        low, high = (float(slider.get_attribute(end)) for end in ("min", "max"))
        tab.go(lambda: tab.set(f"touch-{setting}", low + part * (high - low)))  # noqa: B023 - called at once
        text = page.get_by_label("arguments, key=value").input_value()
        given = {name: json.loads(value) for name, _, value in (pair.partition("=") for pair in text.split())}
        assert low < given[setting] != getattr(Simulation(LEG, MOTOR).env.unwrapped.settings, setting)
        assert given["friction"] == pytest.approx(0.58)  # what was touched goes along
        assert given["drive"] == "motor"
        tab.wait_number("time", "> 0.1")
        tab.pause()
        tab.check_drawn(until(Simulation(LEG, given), tab.time))


def test_a_refusal_is_reported_and_the_page_plays_on(tab):
    tab.press("Play")
    tab.page.get_by_label("impulse at the trunk").fill("1e9")
    tab.press("Push")
    tab.page.wait_for_selector("#status[data-kind=error]")
    tab.status("forward")
    tab.page.get_by_label("environment").fill("CartPole-v1")
    tab.press("Apply")
    tab.status("CartPole-v1")
    states = tab.states
    tab.wait("({n}) => Number(document.body.dataset.states) > n + 3", n=states)


@pytest.mark.parametrize("name", CONDITIONS)
def test_the_papers_conditions(tab, name):
    tab.go(lambda: tab.press(name))
    assert tab.page.locator("h1").text_content() == "HorseLegFixed-v0"
    tab.wait_number("peak 0", "> 100")
    tab.wait_number("time", "> 0.5")
    tab.pause()
    arguments = {"episode_seconds": TURNS_ON} | CONDITIONS[name]
    simulation = Simulation(PAPER_ID, arguments, CONDITIONS[name]["gait"])
    tab.check_drawn(until(simulation, tab.time))


def test_a_push_changes_the_speed_of_the_trunk(tab):
    page = tab.page
    page.get_by_label("environment").fill(LEG)
    page.get_by_label("arguments, key=value").fill("")
    page.get_by_label("policy").fill("")
    tab.go(lambda: tab.press("Apply"))
    tab.pause()
    tab.steps(1)
    page.wait_for_timeout(300)
    before = tab.number("speed")
    page.get_by_label("impulse at the trunk").fill("-200")
    tab.press("Push")
    tab.status("Pushed by -200 N s.")
    tab.steps(1)
    tab.wait_number(
        "speed", f"< {before - 1}"
    )  # 200 N s over 50 kg are 4 m/s, of which the ground takes some
    page.get_by_label("impulse at the trunk").fill("1e9")
    tab.press("Push")
    page.wait_for_selector("#status[data-kind=error]")
    tab.status("forward")


def test_a_policy_that_fails_before_the_page_is_there_is_reported(browser, tmp_path):
    with served(tmp_path, "broken") as address:
        tab = Tab(browser, address)
        tab.status("expected actions, it raised ValueError: there is no layer 3")
        tab.page.get_by_role("button", name="Play").wait_for()
        tab.page.get_by_label("policy").fill("walk")
        tab.press("Reset")
        tab.status("Seed")
        tab.press("Play")
        tab.wait_number("time", "> 0.1")
        tab.page.close()
    assert not tab.faults


def test_a_narrow_page_plays_with_closed_controls(browser, url):
    tab = Tab(browser, url[0], width=390)
    page = tab.page
    assert page.locator("aside details[open]").count() == 0
    tab.wait_number("peak 0", "> 500")
    assert page.evaluate(TOO_WIDE) <= 0
    assert page.evaluate(CUT_CELLS) == []
    page.get_by_text("Ground", exact=True).click()
    tab.set("touch-friction", 0.1)
    tab.wait_number("time", f"> {tab.number('time') + 0.3}")
    assert page.evaluate(f"{WIRE}.asked")["value"] == pytest.approx(0.1)
    assert page.locator("#status").get_attribute("data-kind") == "note"
    assert page.evaluate(TOO_WIDE) <= 0
    assert page.evaluate(NAMES) == []
    # With reduced motion the same time passes in few pictures.
    page.emulate_media(reduced_motion="reduce")
    before = tab.number("time")
    assert 1 <= page.evaluate(PICTURES) <= 9
    tab.wait_number("time", f"> {before}")
    page.close()
    assert not tab.faults


def test_a_narrow_page_of_a_horse_has_the_whole_table(browser, tmp_path):
    """Four legs of the largest numbers: no column is cut."""
    with served(tmp_path, "horse") as address:
        tab = Tab(browser, address, width=390)
        cells = tab.page.locator(".numbers td")
        assert cells.count() == 24
        tab.pause()
        cells.evaluate_all("(all) => all.forEach((cell) => { cell.textContent = '8888.8' })")
        assert tab.page.evaluate(CUT_CELLS) == []
        assert tab.page.locator(".marks").count() == 0
        tab.page.close()


def test_pictures_of_the_report_fit_a_phone(browser):
    """Each figure as the template has it, with a picture that is wider."""
    template = (ROOT / "hoof_env" / "demo" / "report.html.j2").read_text(encoding="utf-8")
    wide = "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='900' height='400'/>"
    figures = re.findall(r'<figure class="card picture.*?</figure>', template)
    assert len(figures) == 2
    body = "".join(re.sub(r'src="[^"]*"', f'src="{wide}"', figure) for figure in figures)
    page = browser.new_page(viewport={"width": 390, "height": 844})
    style = template[template.index("<style>") : template.index("</style>")]
    page.set_content(f"<!doctype html>{style}</style><main>{body}</main>")
    for image in page.locator("img").all():
        image.evaluate("(image) => image.decode()")
        box = image.bounding_box()
        assert 300 < box["width"] < 390
        assert box["x"] + box["width"] <= 390
    hidden = "[...document.querySelectorAll('*')].filter((e) => e.scrollWidth > e.clientWidth + 1).length"
    assert page.evaluate(hidden) == 0
    page.close()


def test_a_page_alone_plays_from_disk(browser, tmp_path):
    path = Playback.of_policy(LEG, "run", seconds=1.5).write(tmp_path / "page.html")
    tab = Tab(browser, path.as_uri())
    page = tab.page
    time = page.locator("output[for=at]")
    assert time.text_content() == "0.00 s"
    page.locator("#at").focus()
    page.keyboard.press("ArrowRight")
    assert time.text_content() == "0.02 s"
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("() => parseFloat(document.querySelector('output[for=at]').textContent) > 0.1")
    page.get_by_role("button", name="Pause").click()
    at = time.text_content()
    page.wait_for_timeout(200)
    assert time.text_content() == at
    page.locator("#at").fill("60")
    assert time.text_content() == "1.20 s"
    for shown in ("h1", ".legend", ".settings"):
        assert page.locator(shown).bounding_box()["height"] > 15
    assert page.locator("h1").text_content() == "HorseLeg-v0"
    assert page.evaluate(NAMES) == []
    page.emulate_media(reduced_motion="reduce")
    page.locator("#at").fill("0")
    page.get_by_role("button", name="Play").click()
    assert page.evaluate(PICTURES.replace("[data-number=time]", "output[for=at]")) <= 9
    page.close()
    assert not tab.faults

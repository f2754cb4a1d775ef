"""The pages themselves: texts from outside, sliders, and pages that stand alone."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from hoof_env.errors import HoofEnvError, ParameterError

pytest.importorskip("bokeh")

from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.models import Div
from bokeh.resources import INLINE

from hoof_env.view.controls import CONDITIONS, PAPER_ID, setting_sliders, shown_settings
from hoof_env.view.playback import Playback, Played
from hoof_env.view.session import HANDLERS
from hoof_env.view.simulation import Simulation
from hoof_env.view.templates import template
from tests.view.pages import HORSE, LEG, Page


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


def test_every_slider_of_a_setting_has_unit_and_range(tmp_path):
    for env_id, arguments in ((LEG, {"drive": "motor"}), (HORSE, {})):
        made = Page(tmp_path, env_id=env_id, arguments=arguments)
        sliders = [one for group in setting_sliders(made.player.simulation).values() for one in group]
        assert len(sliders) >= 6
        for one in sliders:
            assert one.low < one.high
            assert one.low - 1e-9 <= one.value <= one.high + 1e-9
        assert {"touch", "drive"} <= set(HANDLERS)
        marks = {one.name: [text for _, text in one.marks] for one in sliders}
        # The paper has values for a leg, not for a horse.
        assert marks["stiffness"] == (["20000"] if env_id == LEG else [])
        assert marks["restitution"] == (["0", "1"] if env_id == LEG else [])
        assert ("paper's values" in html_of(made)) == (env_id == LEG)
        made.tab.close()


def test_sliders_of_a_small_horse_say_its_own_values(tmp_path):
    """Settings are given at size 1, and the page says what the engine has."""
    made = Page(tmp_path, env_id=HORSE, arguments={"size": 0.5, "drive": "motor"})
    simulation = made.player.simulation
    said = {one.name: one.value * one.scale for one in shown_settings(simulation)}
    engine = simulation.env.unwrapped.engine
    assert said["trunk_mass"] == pytest.approx(engine.trunk.mass) == pytest.approx(365.84 / 8)
    drive = engine.limbs[0].drive
    assert said["motor_torque"] == pytest.approx(drive.torque_limit)
    assert said["motor_gain"] == pytest.approx(drive.speed_gain)
    assert said["motor_inertia"] == pytest.approx(drive.rotor_inertia)
    sliders = {one.name: one for group in setting_sliders(simulation).values() for one in group}
    assert sliders["trunk_mass"].scale == 1 / 8
    assert f'data-name="trunk_mass"\n    data-unit="kg" data-scale="{1 / 8}"' in html_of(made)
    assert made.ask("touch", setting="trunk_mass", value=200.0).get("kind") != "error"
    assert dict(Played.of(simulation).about(simulation))["trunk mass"] == "25 kg"
    made.tab.close()


def test_a_page_that_stands_alone_says_what_was_played():
    """Also when the simulation has gone on to another episode."""
    simulation = Simulation(HORSE, {"size": 0.5}, seed=4)
    chunks = [simulation.reset(), simulation.step()]
    played = Played.of(simulation)
    simulation.touch("friction", 0.3)
    simulation.reset(7)
    text = Playback.of_chunks(simulation, chunks, played).html("bokeh.min.js")
    heading = re.search(r"<h1>(.*?)</h1>\s*<p>(.*?)</p>", text)
    assert heading.group(1) == "Horse-v0"
    assert "four legs" in heading.group(2)
    assert "0.00 to 0.02 s" in heading.group(2)
    told = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", text))
    assert told["environment"] == HORSE
    assert told["seed"] == "4"
    assert told["policy"] == "reference (default)"
    assert told["arguments"] == "size=0.5"
    assert told["trunk mass"] == "45.73 kg"
    assert told["friction"] == "0.6"
    assert told["stiffness K"] == "2000000 N/m^n"
    for name in ("force on the hoof", "toe", "heel", "crank", "1 m of arrow"):
        assert name in text


# Pages that stand alone


def test_a_page_stands_alone_with_the_numbers_of_the_record(tmp_path):
    made = Playback.of_policy(LEG, "walk", seconds=0.4, friction=0.3)
    (record,) = made.records
    assert len(record.rows) == 21
    assert record.curves["time"][-1] == pytest.approx(0.4)
    text = made.write(tmp_path / "page.html").read_text()
    outside = r"""<(?:script|link|img|iframe)[^>]*(?:src|href)=["'](?!data:)"""
    assert not re.findall(outside, text[:1000] + text[-4000:])
    linked = made.html("bokeh.min.js")
    assert '<script src="bokeh.min.js">' in linked
    assert len(linked) < len(text)
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
    with pytest.raises(ParameterError, match=r"skip: expected less .*episode takes, got 2 s"):
        Playback.play(short, skip=2.0)


def test_view_needs_no_browser_to_import():
    code = "import sys, hoof_env, hoof_env.cli; sys.exit('bokeh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=120).returncode == 0

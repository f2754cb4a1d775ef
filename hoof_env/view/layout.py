"""Document of a tab: figures, controls and script."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from bokeh.models import ColumnDataSource, CustomJS
from jinja2 import Environment, FileSystemLoader, Template

from hoof_env.records import default_policy
from hoof_env.view import controls, figures
from hoof_env.view.drawing import ARROW_M, HEAD
from hoof_env.view.history import RESOLUTION, STANCE
from hoof_env.view.news import News, names_of
from hoof_env.view.player import Player
from hoof_env.view.recording import FORMATS

FOLDER = Path(__file__).parent / "files"
SPEEDS = (0.05, 2.0)  # slowest and fastest play, over real time [-]
POINTS = round(1.15 * figures.SECONDS / RESOLUTION)  # of a curve that the browser keeps
STEPS = 500  # of the reward that the browser keeps


class Look(NamedTuple):
    """Player of a page, sources of messages from the page and to it, and the names of the numbers in `news`.

    Attributes:
        player: player.
        told, asked: words to the page, and requests from it.
        news: numbers of the present state, see `News.packed`.
        names: see `news.names_of`.
    """

    player: Player
    told: ColumnDataSource
    asked: ColumnDataSource
    news: ColumnDataSource
    names: Mapping[str, Any]


def new_look(player: Player) -> Look:
    """Return the sources of a player, with what it shows at present."""
    first = News(player.row(), player.curves(), player.steps(), player.totals.values(), anew=True)
    told = ColumnDataSource({"message": ["{}"]})
    asked = ColumnDataSource({"message": ["{}"]})
    return Look(player, told, asked, ColumnDataSource({"numbers": first.packed()}), names_of(first))


def bars_source(terms: tuple[str, ...]) -> ColumnDataSource:
    """Return the source of bars of the reward's terms."""
    names = [name.removeprefix("reward_") for name in terms]
    shades = [figures.hex_of(line.colour) for line in reward_lines(terms)]
    return ColumnDataSource({"term": names, "total": [0.0] * len(terms), "colour": shades})


def template(name: str) -> Template:
    """Return a template of the room, which extends Bokeh's own; texts from outside are escaped in it."""
    files = Environment(
        loader=FileSystemLoader(FOLDER), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return files.get_template(name)


def script(*names: str) -> str:
    """Return the scripts of some files, one after the other."""
    return "\n".join((FOLDER / name).read_text(encoding="utf-8") for name in names)


def scene_arguments(scene: figures.Scene, player: Player) -> dict[str, Any]:
    """Return what the script needs to draw rows into a scene."""
    drawing = scene.drawing
    return {
        "paths": scene.paint_paths(player.legs),
        "figure": scene.figure,
        "sources": scene.sources,
        "places": [list(place) for place in drawing.places],
        "camera": {"low": drawing.low, "high": drawing.high, "wide": drawing.half_width},
        "head": HEAD,
        "numbers": [list(number) for number in player.numbers],
    }


def legend_of(curves: figures.Curves) -> dict[str, Any]:
    """Return what a page writes above a figure of curves: its name, title, and the names of its lines."""
    keys = [(line.label, figures.hex_of(line.colour), line.dash) for line in curves.lines]
    is_plain = len(keys) == 1 or curves.figure.name == "footfall"
    return {"name": curves.figure.name, "title": curves.title, "keys": [] if is_plain else keys}


def reward_lines(terms: tuple[str, ...]) -> list[figures.Trace]:
    """Return the curves of the reward's terms."""
    shades = figures.REWARDS
    return [
        figures.Trace(name, name.removeprefix("reward_"), shades[k % len(shades)])
        for k, name in enumerate(terms)
    ]


def fill(doc: Any, look: Look) -> None:
    """Fill the document of a tab."""
    player = look.player
    simulation = player.simulation
    scene = figures.Scene(player.drawing, simulation.setting.terrain)
    sets = figures.line_sets(player.legs, look.names["curves"])
    curves = [figures.curve_figure(name, title, lines) for name, (title, lines) in sets.items()]
    if len(player.legs) > 1:
        curves.append(figures.footfall_figure(player.legs))
    lines = reward_lines(simulation.terms)
    curves.append(figures.curve_figure("rewards", "reward of a step, by term [-]", lines, "steps"))
    bars = bars_source(simulation.terms)
    shown = [scene.figure, *(each.figure for each in curves)]
    shown.append(figures.bars_figure(bars, simulation.terms))
    # Models that only the script knows belong to the document by this list alone.
    scene.figure.tags = [look.news, look.told, look.asked]
    for each in shown:
        doc.add_root(each)
    doc.title = f"{simulation.env_id.rpartition('/')[2]} - hoof-env view"
    doc.template = template("live.html")
    doc.template_variables.update(variables(player, curves))
    arguments = {
        "parts": scene_arguments(scene, player),
        "news": look.news,
        "names": look.names,
        "most": {"curves": POINTS, "steps": STEPS},
        "bars": bars,
        "shown": [{"source": c.source, "window": c.window, "master": c.master} for c in curves],
        "told": look.told,
        "asked": look.asked,
        "seconds": figures.SECONDS,
    }
    code = script("scene.js", "columns.js", "live.js")
    doc.js_on_event("document_ready", CustomJS(args=arguments, code=code))


def variables(player: Player, shown: list[figures.Curves]) -> dict[str, Any]:
    """Return what the template of a tab says."""
    simulation = player.simulation
    drawing = player.drawing
    env: Any = simulation.env.unwrapped
    arguments = {name: value for name, value in simulation.arguments.items() if name != "preset"}
    return {
        "style": script("style.css"),
        "simulation": simulation,
        "summary": env.task.summary,
        "figures": [legend_of(each) for each in shown],
        "has_heel": drawing.has_heel,
        "legs": [figures.leg_name(leg) for leg in player.legs],
        "stance": STANCE,
        "ids": controls.known_ids(),
        "presets": controls.known_presets(),
        "preset": env.settings.preset,
        "policies": controls.known_policies(simulation),
        "policy": simulation.policy_name or "",
        "default": default_policy(env),
        "arguments": controls.as_text(arguments),
        "groups": controls.setting_sliders(simulation),
        "gait": controls.gait_sliders(simulation),
        "conditions": [*controls.CONDITIONS],
        "formats": FORMATS,
        "speeds": SPEEDS,
        "kinds": figures.ground_key(simulation.setting.terrain),
        "arrow": f"{drawing.full_scale / (ARROW_M * drawing.size) / 1000:.3g}",
    }

"""Document of a tab: figures, controls and script, and what page and server tell each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.core import properties
from bokeh.model import DataModel
from bokeh.models import ColumnDataSource, CustomJS
from numpy.typing import NDArray

from hoof_env.leg.presets import preset_names
from hoof_env.record.columns import Columns
from hoof_env.records import default_policy
from hoof_env.view import controls, figures
from hoof_env.view.history import RESOLUTION, STANCE
from hoof_env.view.player import Player
from hoof_env.view.recording import FORMATS
from hoof_env.view.templates import legend_of, scene_arguments, scene_key, script, template

SPEEDS = (0.05, 2.0)  # slowest and fastest play, over real time [-]
POINTS = round(1.15 * figures.SECONDS / RESOLUTION)  # of a curve that the browser keeps
STEPS = 500  # of the reward that the browser keeps


class Wire(DataModel):
    """Messages between page and server.

    Attributes:
        news: what is new since the last state, as numbers; see `packed`.
        told, asked: words to the page, and requests from it.
    """

    news = properties.Any()
    told = properties.Dict(properties.String, properties.Any)
    asked = properties.Dict(properties.String, properties.Any)


def packed(row: NDArray[Any], curves: Columns, steps: Columns, is_anew: bool = False) -> NDArray[np.float64]:
    """Return what is new since the last state as one list of numbers.

    Bokeh sends a header and a part of its own for each column of a source. A horse has forty columns, which
    are news many times a second: one list for all of them costs the server and the browser much less.

    Args:
        row: row of the scene, see `drawing.Drawing`.
        curves, steps: new rows of curves and of the reward's terms, by name; {} for none.
        is_anew: True if they replace those that the page has.

    Returns:
        1 for `is_anew`, the numbers of rows of curves and steps, the row, and all columns in a line.
    """
    counts = [len(columns.get("time", ())) for columns in (curves, steps)]
    return np.concatenate([[is_anew, *counts], row, *curves.values(), *steps.values()])


def fill(doc: Any, player: Player) -> Wire:
    """Fill the document of a tab with what its player shows at present; return the messages."""
    simulation = player.simulation
    curves = player.curves()
    steps = player.steps()
    row = player.row()
    wire = Wire(news=packed(row, curves, steps, is_anew=True))
    scene = figures.Scene(player.drawing, simulation.setting.terrain)
    sets = figures.line_sets(player.legs, curves)
    shown = [figures.curve_figure(name, title, lines) for name, (title, lines) in sets.items()]
    if len(player.legs) > 1:
        shown.append(figures.footfall_figure(player.legs))
    lines = figures.reward_lines(simulation.terms)
    shown.append(figures.curve_figure("rewards", "reward of a step, by term [-]", lines, "steps"))
    bars, bars_figure = figures.bars_figure(lines)
    # Models that only the script knows belong to the document by this list alone.
    scene.figure.tags = [wire]
    doc.title = f"{simulation.env_id.rpartition('/')[2]} - hoof-env view"
    doc.template = template("live.html")
    doc.template_variables.update(variables(player, shown))
    masters = {
        "curves": {"source": empty_source(curves), "most": POINTS},
        "steps": {"source": empty_source(steps), "most": STEPS},
    }
    arguments = {
        "parts": scene_arguments(scene, player),
        "wire": wire,
        "row_length": len(row),
        "masters": masters,
        "bars": bars,
        "shown": [{"source": c.source, "window": c.window, "master": c.master} for c in shown],
        "seconds": figures.SECONDS,
    }
    # The figures are added last and together, because Bokeh looks through all models after each change.
    with doc.models.freeze():
        for each in (scene.figure, *(one.figure for one in shown), bars_figure):
            doc.add_root(each)
    doc.js_on_event("document_ready", CustomJS(args=arguments, code=script("scene.js", "live.js")))
    return wire


def empty_source(columns: Columns) -> ColumnDataSource:
    """Return a source of these columns, in which the browser keeps what it was sent."""
    return ColumnDataSource({name: np.zeros(0) for name in columns})


def variables(player: Player, shown: list[figures.Curves]) -> dict[str, Any]:
    """Return what the template of a tab says."""
    simulation = player.simulation
    env: Any = simulation.env.unwrapped
    arguments = {name: value for name, value in simulation.arguments.items() if name != "preset"}
    return {
        "style": script("style.css"),
        "simulation": simulation,
        "summary": env.task.summary,
        "figures": [legend_of(each) for each in shown],
        "refusal": simulation.other_ground.refusal,
        "legs": [figures.leg_name(leg) for leg in player.legs],
        "stance": STANCE,
        "ids": controls.known_ids(),
        "presets": preset_names(),
        "preset": env.settings.preset,
        "policies": controls.known_policies(simulation),
        "policy": simulation.policy_name or "",
        "default": default_policy(env),
        "arguments": controls.as_text(arguments),
        "groups": controls.setting_sliders(simulation),
        "gait": controls.gait_sliders(simulation),
        "has_paper_leg": controls.has_paper_leg(simulation),
        "conditions": [*controls.CONDITIONS],
        "formats": FORMATS,
        "speeds": SPEEDS,
        "scene_key": scene_key(player),
    }

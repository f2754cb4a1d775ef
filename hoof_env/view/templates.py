"""Templates, scripts and their arguments that the live page and pages that stand alone share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, Template

from hoof_env.render.drawing import HEAD
from hoof_env.render.outline import ARROW_M
from hoof_env.view import figures
from hoof_env.view.player import Player

FOLDER = Path(__file__).parent / "files"
"""Folder of the templates, scripts and styles."""


def template(name: str) -> Template:
    """Return a template by the name of its file. It extends Bokeh's own and escapes the texts it is given."""
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


def scene_key(player: Player) -> dict[str, Any]:
    """Return what the legend of a scene says: kinds of ground, the scale of the arrows, and the heel."""
    drawing = player.drawing
    return {
        "has_heel": drawing.has_heel,
        "kinds": figures.ground_key(player.simulation.setting.terrain),
        "arrow": f"{drawing.full_scale / (ARROW_M * drawing.size) / 1000:.3g}",
    }


def legend_of(curves: figures.Curves) -> dict[str, Any]:
    """Return what a page writes above a figure of curves: its name, title, and the names of its lines."""
    keys = dict.fromkeys((line.label, figures.hex_of(line.colour), line.dash) for line in curves.lines)
    is_plain = len(keys) == 1 or curves.figure.name == "footfall"
    return {"name": curves.figure.name, "title": curves.title, "keys": [] if is_plain else [*keys]}

"""Pages that stand alone: records of one or several simulations with scene, curves, a cursor and a slider,
which a browser plays from disk without Python and without a network."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.models import CDSView, ColumnDataSource, CustomJS, Span
from bokeh.resources import INLINE
from numpy.typing import NDArray

from hoof_env._input import as_path
from hoof_env._output import staged
from hoof_env.errors import ParameterError, check_number
from hoof_env.record.columns import Columns
from hoof_env.records import default_policy
from hoof_env.render import colours
from hoof_env.render.colours import Colour
from hoof_env.view import figures
from hoof_env.view.controls import as_text, shown_settings
from hoof_env.view.player import Player
from hoof_env.view.simulation import Chunk, Simulation
from hoof_env.view.templates import legend_of, scene_arguments, scene_key, script, template

SHADES: tuple[Colour, ...] = (colours.FORCE, colours.TOE, colours.CRANK, colours.HEEL)
"""Colours of the records of a page with several."""

ROWS = 50.0  # rows of the scene a second [1/s]
SHOWN = {"normal": "normal force [N]", "friction": "friction [N]", "torque": "crank torque [N m]"}
"""Titles of the curves of a page with several records, by column."""
OF_ONE = ("normal", "friction", "forces", "hoof_angle", "crank_speed", "torque", "power")
"""Figures of a page of one record."""


class Record(NamedTuple):
    """Record of one simulation.

    Attributes:
        label: its name on the page.
        player: player that showed it, for its drawing data.
        rows: rows of the scene, shape (n, length).
        curves: curves, shape (m,).
        about: names and texts of what was played, and of the settings that have an effect.
    """

    label: str
    player: Player
    rows: NDArray[np.float32]
    curves: Columns
    about: Sequence[tuple[str, str]] = ()


class Played(NamedTuple):
    """What a simulation played, which may go on to another episode before its record is written.

    Attributes:
        policy: name of the policy, None for the default.
        seed: seed of the episode.
        parameters: physical parameters that were touched, by name.
    """

    policy: str | None
    seed: int
    parameters: Mapping[str, float]

    @classmethod
    def of(cls, simulation: Simulation) -> Played:
        """Return what a simulation plays at present."""
        return cls(simulation.policy_name, simulation.seed, dict(simulation.parameters))

    def about(self, simulation: Simulation) -> list[tuple[str, str]]:
        """Return names and texts of what was played, and of the settings that have an effect."""
        env: Any = simulation.env.unwrapped
        preset = env.settings.preset
        told = [
            ("environment", simulation.env_id),
            ("policy", self.policy or f"{default_policy(env)} (default)"),
            ("seed", str(self.seed)),
            ("leg preset", preset if isinstance(preset, str) else simulation.setting.geometry.name or "own"),
        ]
        arguments = {name: value for name, value in simulation.arguments.items() if name != "preset"}
        if arguments:
            told.append(("arguments", as_text(arguments)))
        shown = shown_settings(simulation, self.parameters)
        return told + [(one.label, one.text) for one in shown if one.name != "target_speed"]


class Playback:
    """Page of records.

    Args:
        title: title of the page.
        records: records; they play together.

    Raises:
        ParameterError: there is no record.
    """

    def __init__(self, title: str, records: Sequence[Record]) -> None:
        if not records:
            raise ParameterError("records: expected one or more, got none")
        self.title = title
        self.records = tuple(records)

    @classmethod
    def of_chunks(
        cls, simulation: Simulation, chunks: Sequence[Chunk], played: Played | None = None
    ) -> Playback:
        """Return the page of chunks of one episode of a simulation.

        Args:
            simulation: simulation.
            chunks: chunks.
            played: policy, seed and touched parameters of that episode, by default as in the present one.
        """
        player = Player(simulation)
        rows = []
        shown = -np.inf
        for k, chunk in enumerate(chunks):
            player.take(chunk, is_first=k == 0)
            if player.shown >= shown + 1 / ROWS - 1e-9:
                rows.append(player.row().astype(np.float32))
                shown = player.shown
        label = simulation.env_id.rpartition("/")[2]
        about = (played or Played.of(simulation)).about(simulation)
        return cls(label, [Record(label, player, np.array(rows), player.curves(), about)])

    @classmethod
    def play(
        cls, *runs: Mapping[str, Any], seconds: float = 4.0, skip: float = 0.0, title: str = ""
    ) -> Playback:
        """Simulate and return the page.

        Args:
            runs: arguments of `Simulation`, one mapping for each record, with a "label" if there are several.
            seconds: time that is shown [s]; an episode may end earlier.
            skip: time before that [s].
            title: title of the page, by default the name of the id.

        Raises:
            HoofEnvError: as of `Simulation`, or an episode ends within `skip`.
        """
        check_number("seconds", seconds, low=0, exclusive_low=True)
        check_number("skip", skip, low=0)
        made = []
        for run in runs:
            given = dict(run)
            label = given.pop("label", "")
            simulation = Simulation(**given)
            first = simulation.reset()
            chunks = [] if skip else [first]
            while (chunk := simulation.step()) is not None:
                if chunk.columns["time"][-1] > skip + 1e-9:
                    chunks.append(chunk)
                if chunk.columns["time"][-1] >= skip + seconds - 1e-9:
                    break
            if not chunks:
                raise ParameterError(f"skip: expected less than the episode takes, got {skip:g} s")
            (record,) = cls.of_chunks(simulation, chunks).records
            made.append(record._replace(label=label or record.label))
        return cls(title or " and ".join(dict.fromkeys(record.label for record in made)), made)

    @classmethod
    def of_policy(cls, env_id: str, policy: Any = None, seconds: float = 4.0, **arguments: Any) -> Playback:
        """Simulate a policy in an environment with these arguments and return the page; see `play`."""
        return cls.play({"env_id": env_id, "policy": policy, "arguments": arguments}, seconds=seconds)

    def document(self) -> Document:
        """Return the page as a document of Bokeh."""
        roots = []
        views = []
        for k, record in enumerate(self.records):
            scene = figures.Scene(
                record.player.drawing, record.player.simulation.setting.terrain, f"scene_{k}"
            )
            parts = scene_arguments(scene, record.player)
            paths = parts["paths"]
            paths.data = {name: record.curves[name] for name in paths.data}
            data = ColumnDataSource({"row": np.ascontiguousarray(record.rows).ravel()})
            views.append({"parts": parts, "rows": data, "count": len(record.rows)})
            roots.append(scene.figure)
        shown = self._figures()
        end = max(float(record.curves["time"][-1]) for record in self.records)
        begin = min(float(record.curves["time"][0]) for record in self.records)
        cursors = []
        for each in shown:
            each.window.update(start=begin, end=end)
            cursor = Span(location=begin, dimension="height", line_color=figures.INK, line_width=1)
            each.figure.add_layout(cursor)
            cursors.append(cursor)
            roots.append(each.figure)
        doc = Document()
        # The figures are added together, because Bokeh looks through all models after each addition.
        with doc.models.freeze():
            for root in roots:
                doc.add_root(root)
        doc.title = self.title
        step = 1 / ROWS
        arguments = {"views": views, "cursors": cursors, "begin": begin, "step": step}
        doc.js_on_event("document_ready", CustomJS(args=arguments, code=script("scene.js", "alone.js")))
        doc.template = template("alone.html")
        doc.template_variables.update(
            style=script("style.css"),
            records=[facts_of(record) for record in self.records],
            figures=[legend_of(each) for each in shown],
            several=len(self.records) > 1,
            common_key=common_key([record.player for record in self.records]),
        )
        return doc

    def _figures(self) -> list[figures.Curves]:
        """Return the filled figures of curves."""
        if len(self.records) > 1:
            return self._figures_of_several()
        (record,) = self.records
        sets = figures.line_sets(record.player.legs, record.curves)
        shown = [figures.curve_figure(name, *sets[name]) for name in OF_ONE if name in sets]
        if len(record.player.legs) > 1:
            shown = shown[:4]
            shown.append(figures.footfall_figure(record.player.legs))
        for each in shown:
            each.source.data = {name: record.curves[name] for name in each.source.data}
        return shown

    def _figures_of_several(self) -> list[figures.Curves]:
        """Return figures with the curves of several records, each in its colour: records whose labels are
        alike up to a comma share their figures."""
        groups: dict[str, list[Record]] = {}
        for record in self.records:
            groups.setdefault(record.label.partition(",")[0], []).append(record)
        shown = []
        for column, title in SHOWN.items():
            for k, (group, records) in enumerate(groups.items()):
                lines = [
                    figures.Trace(str(i), record.label, SHADES[i % len(SHADES)])
                    for i, record in enumerate(records)
                ]
                made = figures.curve_figure(f"{column}_{k}", f"{group}: {title}", lines)
                for line, renderer, record in zip(lines, made.figure.renderers, records, strict=True):
                    data = {"time": record.curves["time"], line.column: record.curves[column]}
                    renderer.update(data_source=ColumnDataSource(data), view=CDSView())
                shown.append(made)
        return shown

    def html(self, library: str | None = None) -> str:
        """Return the page.

        Args:
            library: address of bokeh.min.js, relative to the page; None puts the library into the page.
        """
        doc = self.document()
        variables = doc.template_variables | {"library": library}
        return file_html(doc, INLINE, self.title, template=doc.template, template_variables=variables)

    def write(self, path: Path | str, library: str | None = None) -> Path:
        """Write the page; an older file is replaced when the new one is complete.

        Raises:
            OutputError: the folder cannot be written.
        """
        path = as_path("path", path)
        text = self.html(library)
        with staged(path.parent) as stage:
            (stage / path.name).write_text(text, encoding="utf-8")
        return path

    def _repr_html_(self) -> str:
        """Return the page in a frame of a notebook."""
        height = 560 if len(self.records) == 1 else 620
        page = html.escape(self.html(), quote=True)
        return (
            f'<iframe title="{html.escape(self.title)}" srcdoc="{page}" '
            f'style="width: 100%; height: {height}px; border: 0"></iframe>'
        )

    def __repr__(self) -> str:
        seconds = self.records[0].curves["time"][-1] - self.records[0].curves["time"][0]
        labels = ", ".join(record.label for record in self.records)
        return f"<Playback of {labels}: {seconds:.2f} s>"


def common_key(players: Sequence[Player]) -> dict[str, Any] | None:
    """Return the legend of the scenes of some players, None where they differ."""
    key, *others = [scene_key(player) | {"legs": player.legs} for player in players]
    return key if all(other == key for other in others) else None


def facts_of(record: Record) -> dict[str, Any]:
    """Return what a page writes about a record: its label, legs, summary, legend, times and settings."""
    time = record.curves["time"]
    env: Any = record.player.simulation.env.unwrapped
    return {
        "label": record.label,
        "summary": env.task.summary,
        "span": f"{time[0]:.2f} to {time[-1]:.2f} s",
        "legs": [figures.leg_name(leg) for leg in record.player.legs],
        "about": record.about,
        "scene_key": scene_key(record.player),
    }

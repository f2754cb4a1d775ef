"""Figures of a page: the scene, and curves of forces, angles, drives and rewards against time."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, CustomJSTickFormatter, FixedTicker, Range1d, Span
from bokeh.models.glyphs import HBar, Line, MultiLine, Patches, Scatter, VArea
from bokeh.plotting import figure

from hoof_env.ground.terrain import Terrain
from hoof_env.render import colours, kinds
from hoof_env.render.colours import Colour
from hoof_env.render.drawing import Drawing
from hoof_env.view.history import path_columns, paths_of

SECONDS = 3.0  # time that curves show [s]
DEEP = 9.0  # how far below the surface the soil is drawn [m]
SKIN_M = 0.04  # depth to which slippery or rough ground is drawn [m]
FAR_ALPHA = 0.4  # opacity of a horse's far legs
LEG_WIDTH = 3.0  # of links [pixels]
REWARDS = (
    colours.TOE,
    colours.FORCE,
    colours.CRANK,
    colours.HEEL,
    (230, 159, 0),
    (86, 180, 233),
    colours.INK,
    colours.GREY,
    colours.HOOF,
)
"""Colours of the reward's terms, in their order."""


def hex_of(colour: Colour) -> str:
    """Return a colour as #rrggbb."""
    return "#" + "".join(f"{part:02x}" for part in colour)


INK = hex_of(colours.INK)
GREY = hex_of(colours.GREY)
FAINT = hex_of(colours.FAINT)


def leg_name(prefix: str) -> str:
    """Return the name of a leg from the prefix of its columns."""
    return prefix.rstrip("_").replace("_", " ") or "leg"


TICKS = (
    "return Math.abs(tick) >= 1e4 ? Number((tick / 1e3).toPrecision(6)) + 'k' : Number(tick.toPrecision(6))"
)
"""Script of the texts at ticks: thousands as k, and without the digits that rounding errors add."""


AWAY_FROM_EDGES = """
const at = (tick - range.start) / (range.end - range.start)
return at < 0.035 || at > 0.965 ? "" : String(Number(tick.toPrecision(6))).replace("-", "\u2212")
"""
"""Script of the texts at the ticks of a scene: none that its edge would cut, without room beside it."""


class Trace(NamedTuple):
    """A curve: its column, its name in the legend, colour and dash."""

    column: str
    label: str
    colour: Colour
    dash: str = "solid"


class Scene:
    """Figure that shows the scene; the page's script fills its glyphs from rows.

    Args:
        drawing: drawing data.
        terrain: ground.
        name: name of the figure in the page.

    Attributes:
        figure: the figure.
        sources: sources of the glyphs by name.
    """

    def __init__(self, drawing: Drawing, terrain: Terrain, name: str = "scene") -> None:
        self.drawing = drawing
        places: dict[str, dict[str, Any]] = {}
        for place in drawing.places:
            columns = places.setdefault(place.source, {})
            empty = np.full(place.length, np.nan)
            columns[place.column] = [empty] * place.pieces if place.pieces else empty
        self.sources = {source: ColumnDataSource(columns) for source, columns in places.items()}
        self.figure = self._frame(name)
        self._paint_ground(terrain)
        self._patches("support", None)
        if "far_flesh" in self.sources:
            self._paint_legs("far", FAR_ALPHA)
        self._patches("trunk", colours.COAT, colours.COAT_EDGE)
        self._paint_legs("near", 1.0)
        self._paint_arrows()

    def _frame(self, name: str) -> Any:
        """Make the empty figure."""
        drawing = self.drawing
        wide = drawing.half_width
        ranges = {"x_range": Range1d(-wide, wide), "y_range": Range1d(drawing.low, drawing.high)}
        f = empty_figure(name, sizing_mode="stretch_both", **ranges)
        f.background_fill_color = hex_of(colours.SKY_BOTTOM)
        f.grid.visible = False
        f.yaxis.visible = False
        f.xaxis.axis_label = "way forward [m]"
        f.xaxis.formatter = CustomJSTickFormatter(args={"range": f.x_range}, code=AWAY_FROM_EDGES)
        f.min_border_left = 0
        return f

    def _add(self, source: ColumnDataSource, glyph: Any, **more: Any) -> None:
        """Add a glyph to the figure."""
        add_glyph(self.figure, source, glyph, **more)

    def _paint_ground(self, terrain: Terrain) -> None:
        """Draw the soil, stretches of another kind, and the surface."""
        x = np.concatenate([[terrain.x[0] - 1e4], terrain.x, [terrain.x[-1] + 1e4]])
        height = terrain.height_at(x)
        soil = hex_of(colours.SOIL)
        surface = ColumnDataSource({"x": x, "deep": height - DEEP, "y": height})
        self._add(surface, VArea(x="x", y1="deep", y2="y", fill_color=soil), level="underlay")
        # In one glyph: hills have hundreds of stretches, of which a browser paints those that are seen.
        shapes: dict[str, list[Any]] = {"xs": [], "ys": [], "fill_color": []}
        for patch in kinds.find_patches(terrain):
            inside = np.clip([patch.start, patch.end], x[0], x[-1])
            knots = terrain.x[(terrain.x > inside[0]) & (terrain.x < inside[1])]
            along = np.unique(np.concatenate([inside, knots]))
            top = terrain.height_at(along)
            body = kinds.BODY[int(kinds.shade(patch.stiffness))]
            skin = kinds.SKIN[int(kinds.shade(patch.friction))]
            for shade, depth in ((body, DEEP), (skin, SKIN_M)):
                if shade:
                    shapes["xs"].append(np.concatenate([along, along[::-1]]))
                    shapes["ys"].append(np.concatenate([top, top[::-1] - depth]))
                    shapes["fill_color"].append(hex_of(shade))
        source = ColumnDataSource(shapes)
        self._add(source, Patches(xs="xs", ys="ys", fill_color="fill_color", line_color=None))
        self._add(surface, Line(x="x", y="y", line_color=hex_of(colours.SOIL_LINE), line_width=2))

    def _patches(
        self, name: str, fill: Colour | None, edge: Colour = colours.GREY, alpha: float = 1.0
    ) -> None:
        """Draw outlines over all their edges, or a line if there is nothing to fill."""
        source = self.sources[name]
        if fill is None:
            self._add(source, Line(x="x", y="y", line_color=hex_of(edge), line_width=2))
            return
        rim: dict[str, Any] = {
            "line_color": hex_of(edge),
            "line_width": 3.0,
            "line_join": "round",
            "line_alpha": alpha,
        }
        self._add(source, Patches(xs="xs", ys="ys", fill_color=None, **rim))
        look: dict[str, Any] = {"fill_color": hex_of(fill), "line_color": None, "fill_alpha": alpha}
        self._add(source, Patches(xs="xs", ys="ys", **look))

    def _paint_legs(self, group: str, alpha: float) -> None:
        """Draw flesh, hooves, links and joints of some legs."""
        self._patches(f"{group}_flesh", colours.COAT, colours.COAT_EDGE, alpha)
        hoof = self.sources[f"{group}_hoof"]
        hooves = len(hoof.data["xs"]) // 2
        hoof.data["fill"] = [hex_of(colours.PASTERN), hex_of(colours.HOOF)] * hooves
        self._add(hoof, Patches(xs="xs", ys="ys", fill_color="fill", line_color=None, fill_alpha=alpha))
        links = self.sources[f"{group}_links"]
        each = len(links.data["xs"]) // (hooves or 1)
        links.data["line"] = ([hex_of(colours.CRANK)] + [hex_of(colours.LINK)] * (each - 1)) * hooves
        look: dict[str, Any] = {"line_width": LEG_WIDTH, "line_cap": "round", "line_alpha": alpha}
        self._add(links, MultiLine(xs="xs", ys="ys", line_color="line", **look))
        dots: dict[str, Any] = {"fill_color": "white", "line_color": INK, "line_width": 1.2}
        joints = self.sources[f"{group}_joints"]
        self._add(joints, Scatter(x="x", y="y", size=5.5, fill_alpha=alpha, line_alpha=alpha, **dots))

    def _paint_arrows(self) -> None:
        """Draw the forces on toe, heel and whole hoof."""
        source = self.sources["arrows"]
        count = len(source.data["xs"]) // 3
        source.data["fill"] = [hex_of(c) for c in (colours.TOE, colours.HEEL, colours.FORCE)] * count
        look: dict[str, Any] = {"line_color": "white", "line_width": 1.0, "line_join": "round"}
        self._add(source, Patches(xs="xs", ys="ys", fill_color="fill", **look))

    def paint_paths(self, legs: Sequence[str]) -> ColumnDataSource:
        """Draw the paths of hooves; return their source, whose columns are some of the curves'."""
        has_heel = self.drawing.has_heel
        source = ColumnDataSource({name: [] for name in path_columns(legs, has_heel)})
        shades = colours.OF_LEGS if len(legs) > 1 else (colours.TOE, colours.HEEL)
        for point, colour in zip(paths_of(legs, has_heel), shades, strict=False):
            look: dict[str, Any] = {"line_color": hex_of(colour), "line_width": 1.4, "line_alpha": 0.8}
            self._add(source, Line(x=f"{point}_x", y=f"{point}_y", **look))
        return source


def ground_key(terrain: Terrain) -> list[tuple[str, str]]:
    """Return names and colours of the unusual kinds of ground in a terrain."""
    return [(name, hex_of(colour)) for name, colour in kinds.kinds_of(terrain)]


def add_glyph(f: Any, source: ColumnDataSource, glyph: Any, **more: Any) -> None:
    """Add a glyph to a figure; glyphs of a source share its view.

    `figure.line` and its like make three glyphs and a view each, and Bokeh goes through all models of a
    page for each message.
    """
    views = {renderer.data_source.id: renderer.view for renderer in f.renderers}
    f.add_glyph(source, glyph, view=views.get(source.id) or CDSView(), **more)


def empty_figure(name: str, **more: Any) -> Any:
    """Return an empty figure with the lettering and lines of all figures; `more` are arguments of Bokeh's."""
    usual = {"height": 200, "sizing_mode": "stretch_width", "toolbar_location": None, "tools": ""}
    f = figure(name=name, border_fill_color=None, lod_threshold=None, **(usual | more))
    f.axis.axis_label_text_font_style = "normal"
    f.axis.axis_label_text_font_size = "12px"
    f.axis.major_label_text_font_size = "12px"
    f.axis.axis_label_text_color = GREY
    f.axis.major_label_text_color = GREY
    f.axis.axis_line_color = FAINT
    f.axis.major_tick_line_color = FAINT
    f.axis.minor_tick_line_color = None
    f.grid.grid_line_color = "#eef1f4"
    f.outline_line_color = None
    f.min_border_left = 58
    return f


class Curves(NamedTuple):
    """A figure of curves against time.

    Attributes:
        title: title with the unit, which the page writes above it.
        lines: curves, which the page names above it where there are several.
        figure: the figure.
        source: columns of its lines, with the time; the script of the page fills it.
        window: times that are shown.
        master: name of the source from which the script takes the columns, "curves" or "steps".
    """

    title: str
    lines: Sequence[Trace]
    figure: Any
    source: ColumnDataSource
    window: Range1d
    master: str


def curve_figure(name: str, title: str, lines: Sequence[Trace], master: str = "curves") -> Curves:
    """Return a figure of curves against time; `title` has the unit, for `master` see `Curves`."""
    # Not empty: a browser warns of axes without data.
    source = ColumnDataSource({column: [0.0] for column in ("time", *(line.column for line in lines))})
    window = Range1d(0.0, SECONDS)
    f = empty_figure(name, x_range=window)
    f.xaxis.axis_label = "time [s]"
    f.yaxis.formatter = CustomJSTickFormatter(code=TICKS)
    for line in lines:
        look: dict[str, Any] = {"line_color": hex_of(line.colour), "line_dash": line.dash, "line_width": 1.7}
        add_glyph(f, source, Line(x="time", y=line.column, **look))
    return Curves(title, lines, f, source, window, master)


def footfall_figure(legs: Sequence[str]) -> Curves:
    """Return the footfall diagram: a bar for each leg while its hoof stands."""
    lines = [Trace(f"{leg}stance", leg_name(leg), colours.OF_LEGS[k]) for k, leg in enumerate(legs)]
    made = curve_figure("footfall", "footfall", lines)
    f = made.figure
    for renderer in f.renderers:
        renderer.glyph.line_width = 13
    f.y_range = Range1d(0.4, len(legs) + 0.6)
    f.yaxis.ticker = FixedTicker(ticks=[*range(1, len(legs) + 1)])
    labels = {len(legs) - k: leg_name(leg) for k, leg in enumerate(legs)}
    f.yaxis.major_label_overrides = labels
    f.min_border_left = 78
    return made


def reward_lines(terms: Sequence[str]) -> list[Trace]:
    """Return the curves of the reward's terms."""
    shades = [REWARDS[k % len(REWARDS)] for k in range(len(terms))]
    return [Trace(n, n.removeprefix("reward_"), shade) for n, shade in zip(terms, shades, strict=True)]


def bars_figure(lines: Sequence[Trace]) -> tuple[ColumnDataSource, Any]:
    """Return the source and the figure of bars of the reward's terms, summed over the episode."""
    names = [line.label for line in lines]
    colours_of_bars = [hex_of(line.colour) for line in lines]
    source = ColumnDataSource({"term": names, "total": [0.0] * len(names), "colour": colours_of_bars})
    f = empty_figure("terms", y_range=names[::-1])
    f.min_border_left = 78
    bar = HBar(y="term", right="total", left=0, height=0.7, fill_color="colour", line_color=None)
    add_glyph(f, source, bar)
    f.add_layout(Span(location=0, dimension="height", line_color=GREY, line_width=1))
    f.ygrid.visible = False
    return source, f


def line_sets(legs: Sequence[str], columns: Collection[str]) -> Mapping[str, tuple[str, list[Trace]]]:
    """Return the figures of curves by name: title with unit, and lines.

    Args:
        legs: prefixes of the legs.
        columns: columns of the curves: elastic and inelastic ground are shown for the same motion, and the
            angle of the hoof, where there are such columns.
    """

    def each(column: str) -> list[Trace]:
        if len(legs) == 1:
            shade = colours.FORCE if column == "normal" else colours.INK
            return [Trace(column, "this ground", shade)]
        return [Trace(f"{leg}{column}", leg_name(leg), colours.OF_LEGS[k]) for k, leg in enumerate(legs)]

    others = [
        Trace(f"{leg}{name}", f"{name} ground", shade, dash)
        for name, shade, dash in (("elastic", colours.CRANK, "dashed"), ("inelastic", colours.INK, "dotted"))
        for leg in legs
        if f"{leg}{name}" in columns
    ]
    normal = [*others, *each("normal")]
    sets = {"normal": ("normal force [N]", normal)}
    if len(legs) == 1:
        forces = [Trace("grf", "resultant", colours.FORCE), Trace("friction", "friction", colours.TOE)]
        sets["forces"] = ("ground reaction force [N]", forces)
    else:
        sets["friction"] = ("friction [N]", each("friction"))
        sets["forces"] = ("ground reaction force, resultant [N]", each("grf"))
    sets |= {
        "hoof_angle": ("hoof angle, heel up [deg]", each("hoof_angle")),
        "crank_speed": ("crank speed [rad/s]", each("crank_speed")),
        "torque": ("crank torque [N m]", each("torque")),
        "power": ("crank power [W]", each("power")),
    }
    return {name: found for name, found in sets.items() if found[1][-1].column in columns}

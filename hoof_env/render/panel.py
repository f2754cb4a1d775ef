"""The panel of one leg: numbers of the instant, commanded and actual gait, force of the last seconds."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pygame

from hoof_env.dynamics.observables import StanceCounter
from hoof_env.record.instant import BodyInstant, Instant
from hoof_env.render.brush import FINE, Brush
from hoof_env.render.colours import CRANK, FAINT, FORCE, GREY, INK, PAPER

SECONDS = 3  # time shown [s]
RESOLUTION = 0.01  # the curve has the largest force of every such interval [s]
MIN_FULL_SCALE_N = 200.0  # least full scale of the curve [N]
UNDER_CURVE = (252, 230, 214)

NUMBERS = (
    ("time", "s", INK),
    ("forward speed", "m/s", INK),
    ("ground force", "", FORCE),
    ("peak of this stance", "", FORCE),
    ("highest so far", "", FORCE),
)
"""Title, unit and colour; "" for the unit of forces."""


class Unit(NamedTuple):
    """Unit of forces: name, size [N] and number of decimals."""

    name: str
    newtons: float
    digits: int


KILONEWTONS = Unit("kN", 1000.0, 2)
NEWTONS = Unit("N", 1.0, 0)
LIGHT = 10.0  # lift-off force of a leg below which its forces are shown in newtons [N]
MIN_LIGHT_FULL_SCALE_N = 10.0  # least full scale of its curve [N]


def unit_of(lift_off_n: float) -> Unit:
    """Return the unit of a leg's forces; a leg of unknown weight counts as heavy."""
    return NEWTONS if 0.0 < lift_off_n < LIGHT else KILONEWTONS


GAIT = (
    ("crank speed", "crank_angle_rate", "crank_speed", "rad/s"),
    ("swing offset", "swing_offset", "swing_offset", "rad"),
    ("swing sine", "swing_sin", "swing_sin", "rad"),
    ("swing cosine", "swing_cos", "swing_cos", "rad"),
)
"""Title, field of `Instant`, commanded parameter and unit."""


class Peak(NamedTuple):
    """Time and size of a stance's highest force [s, N]."""

    time: float
    force: float


class Stances:
    """Stances, in which the normal force exceeds `threshold` [N], and their peaks from a stream of instants.

    Attributes:
        opened: start of the open stance [s]; None between stances.
        peaks: peak of each stance so far, the last one's still growing while it is open.
        highest: force so far [N].
    """

    def __init__(self, threshold: float) -> None:
        self._stance = StanceCounter(threshold)
        self.opened: float | None = None
        self.peaks: list[Peak] = []
        self.highest = 0.0

    @property
    def running_peak(self) -> float:
        """Highest force of the open stance so far [N], 0 between stances."""
        return self._stance.peak

    def add(self, now: Instant) -> None:
        force = now.grf
        self.highest = max(self.highest, force)
        grown, *_ = self._stance.add(now.crank_angle, now.normal, force)
        if self._stance.count > len(self.peaks):
            self.opened = now.time
            self.peaks.append(Peak(now.time, force))
        elif grown > 0:
            self.peaks[-1] = Peak(now.time, force)
        if not self._stance.is_open:
            self.opened = None


class LegPanel:
    """Numbers, gait and force curve in one box (left, top, width, height) of the picture, with the weight of
    trunk and leg [N] as a line, unless it is 0, and stances from `lift_off_n` [N] on. `limits` are the
    limits of the gait parameters, by name; see `gait.limits_of`.

    Its `full_scale`, the force at the top of the curve's axis [N], only grows during an episode.
    """

    def __init__(
        self,
        brush: Brush,
        box: tuple[int, int, int, int],
        weight_n: float,
        lift_off_n: float,
        limits: Mapping[str, tuple[float, float]],
    ) -> None:
        unit = brush.unit
        self._limits = limits
        self._brush = brush
        self._box = pygame.Rect(box)
        self._weight = weight_n
        self._lift_off = lift_off_n
        self._force = unit_of(lift_off_n)
        self._least = MIN_LIGHT_FULL_SCALE_N if self._force is NEWTONS else MIN_FULL_SCALE_N
        self._inside = self._box.inflate(-36 * unit, -32 * unit)
        self._plot = pygame.Rect(0, 0, self._inside.width - 40 * unit, 150 * unit)
        self._plot.bottomright = self._inside.right - round(6 * unit), self._inside.bottom - round(36 * unit)
        self._track = self._inside.left + 112 * unit, self._inside.right - 54 * unit
        self._card = lru_cache(maxsize=8)(self._paint_card)
        self.reset()

    def reset(self) -> None:
        self.stances = Stances(self._lift_off)
        self._curve: deque[tuple[float, float]] = deque()  # time [s], force [N]
        self.full_scale = nice(max(4 * self._weight, self._least))

    def add(self, instants: Sequence[BodyInstant]) -> None:
        curve = self._curve
        for now in instants:
            (leg,) = now.legs
            self.stances.add(leg)
            if not curve or interval_of(curve[-1][0]) != interval_of(now.time):
                curve.append((now.time, leg.grf))
            elif leg.grf > curve[-1][1]:
                curve[-1] = now.time, leg.grf
        self.full_scale = max(self.full_scale, nice(max(self.stances.highest, self._least)))
        while curve[0][0] < instants[-1].time - SECONDS:
            curve.popleft()

    def draw(self, canvas: Any, now: BodyInstant) -> None:
        (leg,) = now.legs
        canvas.blit(self._card(self.full_scale), self._box, special_flags=pygame.BLEND_PREMULTIPLIED)
        stances = self.stances
        values = now.time, now.vx, leg.grf, stances.running_peak, stances.highest
        for k, (value, (_, own, colour)) in enumerate(zip(values, NUMBERS, strict=True)):
            shown, digits = (value, 2) if own else (value / self._force.newtons, self._force.digits)
            text = f"{round(shown, digits) + 0.0:.{digits}f}"  # + 0.0 takes the sign off a zero
            self._brush.write(canvas, text, self._line(k, 210), 24, colour, "midright")
        self._draw_gait(canvas, leg)
        self._draw_curve(canvas, now.time)

    def _line(self, k: float, x: float) -> tuple[float, float]:
        """Return the middle of line `k` of the numbers and the gait, `x` from the left."""
        return self._inside.left + x * self._brush.unit, self._inside.top + (8 + 24 * k) * self._brush.unit

    def _paint_card(self, full_scale: float) -> Any:
        unit = self._brush.unit
        whole = pygame.Surface(self._box.bottomright, pygame.SRCALPHA, 32)
        plot = self._plot
        inside = self._inside

        def paint(fine: Any, place: Any) -> None:
            edge = fine.get_rect()
            radius = round(12 * unit * FINE)
            pygame.draw.rect(fine, FAINT, edge, border_radius=radius)
            pygame.draw.rect(fine, PAPER, edge.inflate(-2 * FINE, -2 * FINE), border_radius=radius - FINE)

        def write(text: str, x: float, y: float, size: int, side: str = "midleft") -> None:
            self._brush.write(whole, text, (x, y), size, GREY, side)

        self._brush.smooth(whole, [complex(*self._box.topleft), complex(*self._box.bottomright)], 0, paint)
        for k, (name, unit_name, _) in enumerate(NUMBERS):
            write(name, *self._line(k, 0), 20)
            write(unit_name or self._force.name, *self._line(k, 217), 20)
        first = len(NUMBERS) + 0.4
        write("gait", *self._line(first, 0), 20)
        _, y = self._line(first, 0)
        self._mark_actual(whole, inside.left + 112 * unit, y)
        write("now", inside.left + 122 * unit, y, 18)
        self._mark_command(whole, inside.left + 172 * unit, y + 8 * unit)
        write("commanded", inside.left + 182 * unit, y, 18)
        for k, (title, _, parameter, _) in enumerate(GAIT):
            x, y = self._line(first + 1 + k, 0)
            write(title, x, y, 20)
            left, right = self._track
            whole.fill(FAINT, (round(left), round(y - unit), round(right - left), max(2, round(3 * unit))))
            low, high = self._limits[parameter]
            if low < 0 < high:
                zero = round(left + (right - left) * -low / (high - low))
                whole.fill(GREY, (zero, round(y - 4 * unit), 1, round(9 * unit)))
        head = plot.top - 20 * unit
        write(f"ground reaction force, {self._force.name}", inside.left, head, 20)
        for part in (0.0, 0.5, 1.0):
            y = plot.bottom - part * plot.height
            whole.fill(FAINT, (plot.left, round(y), plot.width, 1))
            write(f"{part * full_scale / self._force.newtons:g}", plot.left - 7 * unit, y, 18, "midright")
        for second in range(SECONDS + 1):
            x = plot.right - second / SECONDS * plot.width
            whole.fill(FAINT, (round(x), plot.bottom, 1, round(5 * unit)))
            write(f"{-second}", x, plot.bottom + 7 * unit, 18, "midtop")
        write("time before now, s", plot.centerx, inside.bottom + 7 * unit, 18, "midbottom")
        if self._weight:
            y = plot.bottom - self._weight / full_scale * plot.height
            key = inside.right - 74 * unit
            for left, right, line in ((plot.left, plot.right, y), (key, key + 22 * unit, head)):
                for x in np.arange(left, right, 8 * unit):
                    whole.fill(GREY, (round(x), round(line), round(5 * unit), 1))
            write("weight", key + 28 * unit, head, 18)
        return whole.subsurface(self._box)

    def _draw_gait(self, canvas: Any, now: Instant) -> None:
        """Draw each gait parameter between its limits, with its command."""
        left, right = self._track
        for k, (_, name, parameter, unit_name) in enumerate(GAIT):
            _, y = self._line(len(NUMBERS) + 1.4 + k, 0)
            low, high = self._limits[parameter]
            actual = getattr(now, name)
            wanted = getattr(now, f"command_{parameter}")
            for value, mark in ((wanted, self._mark_command), (actual, self._mark_actual)):
                if math.isfinite(value):
                    part = min(max((value - low) / (high - low), 0.0), 1.0)
                    mark(canvas, left + part * (right - left), y)
            digits = 1 if unit_name == "rad/s" else 2
            text = f"{round(actual, digits) + 0.0:.{digits}f}" if math.isfinite(actual) else "-"
            self._brush.write(canvas, text, (self._inside.right, y), 20, INK, "midright")

    def _mark_actual(self, canvas: Any, x: float, y: float) -> None:
        self._brush.disc(canvas, CRANK, (x, y), 5 * self._brush.unit)

    def _mark_command(self, canvas: Any, x: float, y: float) -> None:
        unit = self._brush.unit
        tip = y - 4 * unit
        half = 5 * unit
        top = y - 12 * unit
        shape = [(x, tip), (x - half, top), (x + half, top)]
        pygame.draw.polygon(canvas, INK, shape)
        pygame.draw.aalines(canvas, INK, True, shape)

    def _draw_curve(self, canvas: Any, now: float) -> None:
        plot = self._plot
        unit = self._brush.unit
        per_second = plot.width / SECONDS
        per_newton = plot.height / self.full_scale

        def place(t: float, force: float) -> tuple[float, float]:
            return plot.right - (now - t) * per_second, plot.bottom - force * per_newton

        line = [place(*sample) for sample in self._curve]
        if len(line) > 1:
            pygame.draw.polygon(
                canvas, UNDER_CURVE, [(line[0][0], plot.bottom), *line, (line[-1][0], plot.bottom)]
            )
            for shift in (0.0, 0.7 * unit):  # an anti-aliased line is one pixel wide
                pygame.draw.aalines(canvas, FORCE, False, [(x, y - shift) for x, y in line])
        seen = [peak for peak in self.stances.peaks[-20:] if peak.time >= now - SECONDS]
        if not seen:
            return
        for peak in seen:
            self._brush.disc(canvas, FORCE, place(*peak), 4 * unit)
        x, y = place(*seen[-1])
        if self.stances.opened is not None:  # the running peak, from touch-down on
            start, _ = place(max(self.stances.opened, now - SECONDS), 0.0)
            canvas.fill(
                FORCE, (round(start), round(y), max(round(plot.right - start), 1), max(1, round(unit)))
            )
        above = min(x, plot.right - 10 * unit), y - 6 * unit
        peak_now = f"{seen[-1].force / self._force.newtons:.{self._force.digits}f}"
        self._brush.write(canvas, peak_now, above, 20, FORCE, "midbottom")


def interval_of(time: float) -> int:
    """Return the interval of `RESOLUTION` in which a time [s] lies."""
    return math.floor(time / RESOLUTION + 1e-6)


def nice(force: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is at least `force` [N]."""
    power = 10.0 ** np.floor(np.log10(force))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m >= force * (1 - 1e-12)))

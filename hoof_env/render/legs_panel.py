"""The panel of several legs: numbers of the instant, forces on the hooves, footfall of the last seconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from itertools import cycle
from string import ascii_letters
from typing import Any, NamedTuple

import pygame

from hoof_env.record.instant import BodyInstant
from hoof_env.render.brush import FINE, Brush
from hoof_env.render.colours import FAINT, FORCE, GREY, INK, OF_LEGS, PAPER, Colour
from hoof_env.render.panel import MIN_FULL_SCALE_N, SECONDS, Stances, interval_of, nice

NUMBERS = (
    ("time", "s", INK),
    ("forward speed", "m/s", INK),
    ("pitch", "deg", INK),
    ("highest force", "kN", FORCE),
)
CURVE = 50  # largest height of a leg's curve [pixels of a picture of 960 x 540]
ROOM = 320  # for all curves and rows [same]
MAX_LEGS = 9  # for which there is room


class Lines(NamedTuple):
    """Heights of the parts of a panel [pixels of a picture of 960 x 540].

    Attributes:
        row: of a row of the footfall diagram.
        gap: between curves, for the name of a leg.
        name: of the letters of a leg's name.
        letters: of numbers at axes, and of the names of rows.
    """

    row: int
    gap: int
    name: int
    letters: int


WIDE = Lines(16, 19, 20, 18)
NARROW = Lines(13, 17, 17, 16)
MAX_WIDE = 6  # legs for which there is room with `WIDE`


class LegsPanel:
    """Numbers, a force curve for each leg and the footfall diagram in one box (left, top, width, height) of
    the picture, with the weight of the animal [N] as a scale and stances from `lift_off_n` [N] on. `legs` are
    the prefixes of the legs' names."""

    def __init__(
        self,
        brush: Brush,
        box: tuple[int, int, int, int],
        legs: Sequence[str],
        weight_n: float,
        lift_off_n: float,
    ) -> None:
        unit = brush.unit
        self._brush = brush
        self._box = pygame.Rect(box)
        self._legs = tuple(leg.removesuffix("_") for leg in legs)
        self._weight = weight_n or MIN_FULL_SCALE_N  # 0 if the weight is unknown
        self._lift_off = lift_off_n
        self._inside = self._box.inflate(-36 * unit, -28 * unit)
        left = self._inside.left + round(34 * unit)
        width = self._inside.width - round(40 * unit)
        top = self._inside.top + 126 * unit
        self._lines = WIDE if len(legs) <= MAX_WIDE else NARROW
        row, gap, *_ = self._lines
        high = min(CURVE, (ROOM - row * len(legs)) / len(legs) - gap) * unit
        self._plots = [
            pygame.Rect(left, round(top + k * (high + gap * unit)), width, round(high))
            for k in range(len(legs))
        ]
        first = self._plots[-1].bottom + 34 * unit
        self._rows = [
            pygame.Rect(left, round(first + k * row * unit), width, round((row - 4) * unit))
            for k in range(len(legs))
        ]
        self._card = lru_cache(maxsize=8)(self._paint_card)
        self.reset()

    def reset(self) -> None:
        self.each = [Stances(self._lift_off) for _ in self._legs]
        self._curves: list[deque[tuple[float, float]]] = [deque() for _ in self._legs]
        self._stances: list[list[list[float]]] = [[] for _ in self._legs]  # from and to [s]
        self.full_scale = nice(self._weight)

    @property
    def stances(self) -> Stances:
        """Stances of the leg whose open stance has the highest force."""
        return max(self.each, key=lambda one: one.running_peak)

    def add(self, instants: Sequence[BodyInstant]) -> None:
        for now in instants:
            for k, leg in enumerate(now.legs):
                stances = self.each[k]
                curve = self._curves[k]
                bars = self._stances[k]
                stances.add(leg)
                if not curve or interval_of(curve[-1][0]) != interval_of(now.time):
                    curve.append((now.time, leg.grf))
                elif leg.grf > curve[-1][1]:
                    curve[-1] = now.time, leg.grf
                if stances.opened is not None:
                    if not bars or bars[-1][0] != stances.opened:
                        bars.append([stances.opened, now.time])
                    bars[-1][1] = now.time
        since = instants[-1].time - SECONDS
        for curve, bars in zip(self._curves, self._stances, strict=True):
            while curve[0][0] < since:
                curve.popleft()
            while bars and bars[0][1] < since:
                bars.pop(0)
        self.full_scale = max(
            self.full_scale, nice(max(self._weight / 4, *(one.highest for one in self.each)))
        )

    def draw(self, canvas: Any, now: BodyInstant) -> None:
        canvas.blit(self._card(self.full_scale), self._box, special_flags=pygame.BLEND_PREMULTIPLIED)
        highest = max(one.highest for one in self.each) / 1000
        values = now.time, now.vx, now.pitch * 57.29578, highest
        for k, (value, (_, _, colour)) in enumerate(zip(values, NUMBERS, strict=True)):
            self._brush.write(
                canvas, f"{round(value, 2) + 0.0:.2f}", self._line(k, 210), 24, colour, "midright"
            )
        for k, colour in zip(range(len(self._legs)), cycle(OF_LEGS), strict=False):
            self._draw_curve(canvas, k, now.time, colour)
            row = self._rows[k]
            for start, end in self._stances[k]:
                left = max(self._across(row, now.time, start), row.left)
                right = self._across(row, now.time, end)
                canvas.fill(colour, (round(left), row.top, max(round(right - left), 1), row.height))

    def _across(self, plot: Any, now: float, time: float) -> float:
        return float(plot.right - (now - time) * plot.width / SECONDS)

    def _draw_curve(self, canvas: Any, k: int, now: float, colour: Colour) -> None:
        plot = self._plots[k]
        unit = self._brush.unit
        line = [
            (self._across(plot, now, time), plot.bottom - force * plot.height / self.full_scale)
            for time, force in self._curves[k]
        ]
        if len(line) > 1:
            for shift in (0.0, 0.7 * unit):  # an anti-aliased line is one pixel wide
                pygame.draw.aalines(canvas, colour, False, [(x, y - shift) for x, y in line])

    def _line(self, k: float, x: float) -> tuple[float, float]:
        """Return the middle of line `k` of the numbers, `x` from the left."""
        return self._inside.left + x * self._brush.unit, self._inside.top + (8 + 23 * k) * self._brush.unit

    def _paint_card(self, full_scale: float) -> Any:
        unit = self._brush.unit
        lines = self._lines
        whole = pygame.Surface(self._box.bottomright, pygame.SRCALPHA, 32)

        def paint(fine: Any, place: Any) -> None:
            edge = fine.get_rect()
            radius = round(12 * unit * FINE)
            pygame.draw.rect(fine, FAINT, edge, border_radius=radius)
            pygame.draw.rect(fine, PAPER, edge.inflate(-2 * FINE, -2 * FINE), border_radius=radius - FINE)

        def write(
            text: str, x: float, y: float, size: int, side: str = "midleft", colour: Any = GREY
        ) -> None:
            self._brush.write(whole, text, (x, y), size, colour, side)

        self._brush.smooth(whole, [complex(*self._box.topleft), complex(*self._box.bottomright)], 0, paint)
        for k, (name, unit_name, _) in enumerate(NUMBERS):
            write(name, *self._line(k, 0), 20)
            write(unit_name, *self._line(k, 217), 20)
        write("force on each hoof, kN", *self._line(len(NUMBERS) + 0.2, 0), 20)
        for plot, leg, colour in zip(self._plots, self._legs, cycle(OF_LEGS), strict=False):
            for part in (0.0, 1.0):
                y = plot.bottom - part * plot.height
                whole.fill(FAINT, (plot.left, round(y), plot.width, 1))
                write(f"{part * full_scale / 1000:g}", plot.left - 7 * unit, y, lines.letters, "midright")
            write(leg.replace("_", " "), plot.right, plot.top - 9 * unit, lines.name, "midright", colour)
        first = self._rows[0]
        last = self._rows[-1]
        write("footfall", self._inside.left, first.top - 14 * unit, 20)
        for row, leg in zip(self._rows, self._legs, strict=True):
            whole.fill(FAINT, row)
            letters = "".join(word[0].upper() + word.lstrip(ascii_letters) for word in leg.split("_") if word)
            write(letters, row.left - 7 * unit, row.centery, lines.letters, "midright")
        for second in range(SECONDS + 1):
            x = last.right - second / SECONDS * last.width
            write(f"{-second}", x, last.bottom + 5 * unit, lines.letters, "midtop")
        write("time before now, s", last.centerx, last.bottom + 33 * unit, lines.letters, "midbottom")
        return whole.subsurface(self._box)

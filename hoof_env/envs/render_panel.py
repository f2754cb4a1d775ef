"""The panel: numbers of the present row, and the ground reaction force over the last seconds."""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

from hoof_env.envs.render_paint import FAINT, FINE, FORCE, GREY, INK, PAPER, Brush
from hoof_env.envs.stance import new_account, take_account

SECONDS = 3
"""Time shown [s]."""

RESOLUTION = 0.01
"""The curve keeps the largest force of every such interval [s]."""

SMALLEST_SCALE = 200.0
"""Least full scale of the curve [N]."""

UNDER_CURVE = (252, 230, 214)

NUMBERS = (
    ("time", "s", INK),
    ("forward speed", "m/s", INK),
    ("crank speed", "rad/s", INK),
    ("swing angle", "deg", INK),
    ("ground force", "kN", FORCE),
    ("peak so far", "kN", FORCE),
)


class Panel:
    """Numbers and force curve in one box of the picture.

    Args:
        brush: the paint box.
        box: left, top, width and height [pixels].
        weight_n: weight of trunk and leg [N], a line in the curve; or None.
        lift_off_n: normal force that tells stance from swing [N].

    Attributes:
        peaks: time [s] and force [N] of the peak of each stance in view.
        full_scale: force at the top of the curve's axis [N]; during an episode it only grows.
    """

    def __init__(
        self, brush: Brush, box: tuple[int, int, int, int], weight_n: float | None, lift_off_n: float
    ) -> None:
        unit = brush.unit
        self._brush, self._box, self._weight = brush, pygame.Rect(box), weight_n
        self._lift_off = lift_off_n
        self._inside = self._box.inflate(-36 * unit, -32 * unit)
        self._plot = pygame.Rect(0, 0, self._inside.width - 40 * unit, 156 * unit)
        self._plot.bottomright = self._inside.right - round(6 * unit), self._inside.bottom - round(38 * unit)
        self._card = lru_cache(maxsize=8)(self._paint_card)
        self.reset()

    def reset(self) -> None:
        """Forget the forces."""
        self._account = new_account(self._lift_off)
        self._curve: deque[tuple[float, float]] = deque()  # time [s], force [N]
        self.peaks: deque[tuple[float, float]] = deque()
        self.full_scale = _nice(max(4 * (self._weight or 0.0), SMALLEST_SCALE))

    def add(self, trace: NDArray[np.void]) -> None:
        """Take the rows of a trace."""
        now = float(trace["t"][-1])
        rows = max(1, round(RESOLUTION * (len(trace) - 1) / max(now - trace["t"][0], RESOLUTION)))
        for first in range(0, len(trace), rows):
            part = trace[first : first + rows]
            top = part[np.argmax(part["grf"])]
            sample = float(top["t"]), float(top["grf"])
            self._curve.append(sample)
            stances = self._account["stances"]
            take_account(self._account, part, 0.0, 0.0, True)  # only its stances and peaks are read
            if self._account["stances"] > stances:
                self.peaks.append(sample)
            elif self.peaks and self._account["open"] and sample[1] > self.peaks[-1][1]:
                self.peaks[-1] = sample
        self.full_scale = max(self.full_scale, _nice(max(float(self._account["highest"]), SMALLEST_SCALE)))
        for samples in (self._curve, self.peaks):
            while samples and samples[0][0] < now - SECONDS:
                samples.popleft()

    def draw(self, canvas: Any, row: Any) -> None:
        """Draw the panel for a row of dtype `TRACE`."""
        canvas.blit(self._card(self.full_scale), self._box, special_flags=pygame.BLEND_PREMULTIPLIED)
        values = (
            row["t"],
            row["trunk_vx"],
            row["theta_rate"],
            np.degrees(row["phi"]),
            row["grf"] / 1000,
            self._account["highest"] / 1000,
        )
        for k, (value, (_, unit_name, colour)) in enumerate(zip(values, NUMBERS, strict=True)):
            digits = 1 if unit_name == "deg" else 2
            text = f"{round(float(value), digits) + 0.0:.{digits}f}"  # + 0.0 takes the sign off a zero
            self._brush.write(canvas, text, self._line(k, 204), 25, colour, "midright")
        self._draw_curve(canvas, float(row["t"]))

    def _line(self, k: int, x: float) -> tuple[float, float]:
        """Middle of line `k` of the numbers, `x` from the left."""
        return self._inside.left + x * self._brush.unit, self._inside.top + (10 + 26 * k) * self._brush.unit

    def _paint_card(self, full_scale: float) -> Any:
        unit = self._brush.unit
        whole = pygame.Surface(self._box.bottomright, pygame.SRCALPHA, 32)
        plot, inside = self._plot, self._inside

        def paint(fine: Any, place: Any) -> None:
            edge, radius = fine.get_rect(), round(12 * unit * FINE)
            pygame.draw.rect(fine, FAINT, edge, border_radius=radius)
            pygame.draw.rect(fine, PAPER, edge.inflate(-2 * FINE, -2 * FINE), border_radius=radius - FINE)

        def write(text: str, x: float, y: float, size: int, side: str = "midleft") -> None:
            self._brush.write(whole, text, (x, y), size, GREY, side)

        self._brush.smooth(whole, [complex(*self._box.topleft), complex(*self._box.bottomright)], 0, paint)
        for k, (name, unit_name, _) in enumerate(NUMBERS):
            write(name, *self._line(k, 0), 21)
            write(unit_name, *self._line(k, 212), 21)
        title = plot.top - 23 * unit
        write("ground reaction force, kN", inside.left, title, 21)
        for part in (0.0, 0.5, 1.0):
            y = plot.bottom - part * plot.height
            whole.fill(FAINT, (plot.left, round(y), plot.width, 1))
            write(f"{part * full_scale / 1000:g}", plot.left - 7 * unit, y, 19, "midright")
        for second in range(SECONDS + 1):
            x = plot.right - second / SECONDS * plot.width
            whole.fill(FAINT, (round(x), plot.bottom, 1, round(5 * unit)))
            write(f"{-second}", x, plot.bottom + 8 * unit, 19, "midtop")
        write("time before now, s", plot.centerx, inside.bottom + 5 * unit, 19, "midbottom")
        if self._weight:
            y = plot.bottom - self._weight / full_scale * plot.height
            key = inside.right - 74 * unit
            for left, right, line in ((plot.left, plot.right, y), (key, key + 22 * unit, title)):
                for x in np.arange(left, right, 8 * unit):
                    whole.fill(GREY, (round(x), round(line), round(5 * unit), 1))
            write("weight", key + 28 * unit, title, 19)
        return whole.subsurface(self._box)

    def _draw_curve(self, canvas: Any, now: float) -> None:
        plot, unit = self._plot, self._brush.unit

        def pixels(samples: Any) -> Any:
            t, force = np.array(samples).T
            x = plot.right - (now - t) / SECONDS * plot.width
            return x + 1j * (plot.bottom - force / self.full_scale * plot.height)

        curve = pixels(self._curve)
        peaks = pixels(self.peaks) if self.peaks else curve[:0]
        line = [(z.real, z.imag) for z in curve.tolist()]
        if len(line) > 1:
            ends = (line[0][0], plot.bottom), (line[-1][0], plot.bottom)
            pygame.draw.polygon(canvas, UNDER_CURVE, [ends[0], *line, ends[1]])
            for shift in (0.0, 0.7 * unit):  # an anti-aliased line is one pixel wide
                pygame.draw.aalines(canvas, FORCE, False, [(x, y - shift) for x, y in line])
        for z in peaks.tolist():
            self._brush.write(canvas, "•", (z.real, z.imag), 40, FORCE, "center")
        if self.peaks:
            above = min(peaks[-1].real, plot.right - 10 * unit), peaks[-1].imag - 6 * unit
            self._brush.write(canvas, f"{self.peaks[-1][1] / 1000:.2f}", above, 21, FORCE, "midbottom")


def _nice(force: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is at least `force`."""
    power = 10.0 ** np.floor(np.log10(force))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m >= force * (1 - 1e-12)))

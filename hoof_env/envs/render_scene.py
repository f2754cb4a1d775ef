"""The scene: trunk, linkage, hoof, ground, the path of the toe and the force on the hoof.

The camera follows the crank centre O along x. It keeps its height, and there is room for every angle that the
leg can reach; only when O leaves its usual heights does the camera follow it up or down.
"""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

from hoof_env.envs.render_body import Body
from hoof_env.envs.render_paint import CRANK, FINE, FORCE, GREY, PAPER, TOE, Brush, arrow, bar
from hoof_env.gait.parameters import LIMITS
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS

SKY_TOP, SKY_BOTTOM = (219, 231, 242), (249, 250, 252)
SOIL, SOIL_LINE, SOIL_VEIL = (214, 200, 174), (112, 95, 66), 110

HEIGHT_SLACK_M = 0.2
"""How far O may rise or sink from the paper's hip height before the camera follows [m]."""

SOIL_M = 0.4
"""Least depth of soil in the picture [m]."""

MARGIN_M = 0.1
"""Room around the leg at its furthest reach [m]."""

PATH_SECONDS = 1.0
"""Length of the toe's path [s]."""

ARROW_M = 1.3
"""Length in the scene of an arrow for the panel's full scale [m]."""


class Scene:
    """Draws one row of a trace; see the module docstring.

    Args:
        brush: the paint box.
        geometry: the leg.
        size: of the picture [pixels].
        right: width on the right that the leg leaves free [pixels].
        suspended: the trunk hangs from a spring; else a rail holds it.
    """

    def __init__(
        self, brush: Brush, geometry: Geometry, size: tuple[int, int], right: int, suspended: bool
    ) -> None:
        self._brush, self._geometry, self._size = brush, geometry, size
        out, up = _reach(geometry)
        spare = HEIGHT_SLACK_M + MARGIN_M
        soil = max(out + spare - geometry.hip_height, SOIL_M)
        sky = geometry.hip_height + up + spare
        self._centre = (size[0] - right) / 2
        self._scale = min(size[1] / (soil + sky), self._centre / (out + MARGIN_M))
        self._level = size[1] - soil * self._scale  # of the ground [pixels] while the camera keeps its height
        self._camera = 0j
        self._path: deque[tuple[float, complex]] = deque()
        self._body = Body(brush, geometry, self._scale, suspended)
        self._sky = self._paint_sky()
        self._veil = pygame.Surface(size, 0, 32)  # over what is inside the ground
        self._veil.fill(SOIL)
        self._veil.set_alpha(SOIL_VEIL)
        self._key = lru_cache(maxsize=8)(self._paint_key)

    def reset(self) -> None:
        """Forget the path of the toe."""
        self._path.clear()

    def add(self, trace: NDArray[np.void]) -> None:
        """Lengthen the path of the toe by the rows of a trace, about one point every 10 ms."""
        now = trace["t"][-1]
        step = max(1, round(0.01 * (len(trace) - 1) / max(now - trace["t"][0], 0.01)))
        rows = trace[::-step][::-1]
        toe = rows["toe_x"] - 1j * rows["toe_penetration"]
        self._path.extend(zip(rows["t"].tolist(), toe.tolist(), strict=True))
        while self._path[0][0] < now - PATH_SECONDS:
            self._path.popleft()

    def draw(self, canvas: Any, row: Any, full_scale: float) -> None:
        """Draw a row of dtype `TRACE`; the arrow of a force `full_scale` [N] is `ARROW_M` long."""
        pixels = self.look_at(row)
        canvas.blit(self._sky, (0, 0))
        ground = round(self._pixels(0j).imag)
        canvas.fill(SOIL, (0, ground, *self._size))
        self._body.draw_trunk(canvas, pixels["O"])
        self._draw_path(canvas)
        self._body.draw_leg(canvas, pixels)
        self._draw_ground(canvas, ground)
        self._draw_force(canvas, row, full_scale)
        canvas.blit(self._key(full_scale), (0, 0), special_flags=pygame.BLEND_PREMULTIPLIED)

    def look_at(self, row: Any) -> dict[str, complex]:
        """Point the camera at a row; returns where each named point of the leg lies [pixels]."""
        usual = self._geometry.hip_height
        x, y = float(row["trunk_x"]), float(row["trunk_y"])
        self._camera = complex(x, y - min(max(y, usual - HEIGHT_SLACK_M), usual + HEIGHT_SLACK_M))
        points = pose(self._geometry, row["theta"], frame=FrameMotion(phi=row["phi"], position=(x, y))).points
        return dict(zip(POINTS, self._pixels(points[:, 0] + 1j * points[:, 1]).tolist(), strict=True))

    def _pixels(self, z: Any) -> Any:
        """World position, complex [m], to position in the picture, complex with y down [pixels]."""
        return np.conj(z - self._camera) * self._scale + complex(self._centre, self._level)

    def _paint_sky(self) -> Any:
        ramp = pygame.Surface((1, 2), 0, 32)
        ramp.set_at((0, 0), SKY_TOP)
        ramp.set_at((0, 1), SKY_BOTTOM)
        return pygame.transform.smoothscale(ramp, self._size)

    def _draw_path(self, canvas: Any) -> None:
        if len(self._path) < 2:
            return
        times, places = zip(*self._path, strict=True)
        path = self._pixels(np.array(places))
        for first in range(0, len(path) - 1, 10):  # older parts fade into the sky
            fade = 0.75 * (times[-1] - times[first]) / PATH_SECONDS
            self._draw_line(canvas, path[first : first + 11], fade)

    def _draw_line(self, canvas: Any, line: NDArray[np.complex128], fade: float) -> None:
        colour = [round(c + fade * (sky - c)) for c, sky in zip(TOE, SKY_BOTTOM, strict=True)]
        width = round(2.8 * self._brush.unit * FINE)

        def paint(fine: Any, place: Any) -> None:
            pygame.draw.lines(fine, colour, False, [place(z) for z in line.tolist()], width)

        self._brush.smooth(canvas, line, 3, paint)

    def _draw_ground(self, canvas: Any, ground: int) -> None:
        (width, height), unit = self._size, self._brush.unit
        left = self._camera.real - self._centre / self._scale
        label = ground + height - self._level - 8 * unit
        thick = max(1, round(2 * unit))
        canvas.blit(self._veil, (0, ground))
        canvas.fill(SOIL_LINE, (0, ground, width, thick))
        for metre in range(int(np.floor(left)), int(np.ceil(left + width / self._scale)) + 1):
            x = self._pixels(complex(metre, 0)).real
            canvas.fill(SOIL_LINE, (round(x - thick / 2), ground, thick, round(10 * unit)))
            canvas.fill(SOIL_LINE, (round(x + self._scale / 2), ground, 1, round(6 * unit)))
            self._brush.write(canvas, f"{metre} m", (x, label), 18, SOIL_LINE, "midbottom")

    def _draw_force(self, canvas: Any, row: Any, full_scale: float) -> None:
        if row["normal"] <= 0:
            return
        moment = row["toe_normal"] * row["toe_penetration"] + row["heel_normal"] * row["heel_penetration"]
        foot = complex(row["cop_x"], -moment / row["normal"])
        force = complex(row["friction"], row["normal"])
        tail, tip = self._pixels(foot), self._pixels(foot + force * ARROW_M / full_scale)
        width = 6 * self._brush.unit * FINE

        def paint(fine: Any, place: Any) -> None:
            for colour, grow in ((PAPER, 1.2 * FINE), (FORCE, 0.0)):
                pygame.draw.circle(fine, colour, place(tail), 0.75 * width + grow)
                arrow(fine, colour, place(tail), place(tip), width, grow)

        self._brush.smooth(canvas, [tail, tip], 14 * self._brush.unit, paint)

    def _paint_key(self, full_scale: float) -> Any:
        unit = self._brush.unit
        force = full_scale / 5
        start, step = 20 * (1 + 1j) * unit, 22j * unit
        end = start + force / full_scale * ARROW_M * self._scale
        image = pygame.Surface((round(self._centre), round(90 * unit)), pygame.SRCALPHA, 32)

        def paint(fine: Any, place: Any) -> None:
            arrow(fine, FORCE, place(start), place(end), 6 * unit * FINE)
            for k, colour, radius in ((1, TOE, 1.1 * unit * FINE), (2, CRANK, 3.3 * unit * FINE)):
                bar(fine, colour, place(start + k * step), place(end + k * step), radius, radius)

        self._brush.smooth(image, [start, end + 2 * step], 10 * unit, paint)
        words = f"{force / 1000:g} kN on the hoof", f"toe, last {PATH_SECONDS:g} s", "crank"
        for k, text in enumerate(words):
            at = end + k * step + 12 * unit
            self._brush.write(image, text, (at.real, at.imag), 19, GREY)
        return image


def _reach(geometry: Geometry) -> tuple[float, float]:
    """How far from O, and how far above it, the leg gets at any crank and swing angle allowed [m]."""
    out, up = 0.0, 0.0
    bounds = [LIMITS[name] for name in ("swing_offset", "swing_sin", "swing_cos")]
    for theta in np.linspace(0, 2 * np.pi, 72, endpoint=False):
        z = pose(geometry, theta).points @ (1, 1j)
        phi = [offset + a * np.sin(theta) + b * np.cos(theta) for offset, a, b in product(*bounds)]
        turns = np.exp(1j * geometry.travel * np.linspace(min(phi), max(phi), 72))
        out, up = max(out, np.abs(z).max()), max(up, np.outer(z, turns).imag.max())
    return out, up

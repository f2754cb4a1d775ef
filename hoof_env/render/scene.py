"""The scene: sky, ground, trunk and leg, the paths of toe and heel, the forces on the hoof.

The camera follows the crank centre O along x. It keeps its height over the ground around O, and there is room
for every angle that the leg can reach; only when O leaves its usual heights does the camera follow it up or
down.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
import pygame

from hoof_env.gait.gait import LIMITS
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry, tables
from hoof_env.leg.kinematics import pose, solve_points
from hoof_env.leg.linkage import POINTS
from hoof_env.render.body import (
    CRANK,
    FINE,
    FORCE,
    GREY,
    HEEL,
    PAPER,
    TOE,
    Body,
    Brush,
    arrow,
    bar,
    mix,
)
from hoof_env.render.ground import SOIL_LINE, GroundPainter
from hoof_env.render.instant import Instant

SKY_TOP, SKY_BOTTOM = (219, 231, 242), (249, 250, 252)

HEIGHT_SLACK_M = 0.2  # how far O may rise or sink from the paper's hip height before the camera follows [m]
SOIL_M = 0.4  # least depth of soil in the picture [m]
MARGIN_M = 0.1  # room around the leg at its furthest reach [m]
PATH_SECONDS = 1.0  # length of the paths of toe and heel [s]
PATH_STEP = 0.01  # time between two places of a path [s]
ARROW_M = 1.3  # length in the scene of an arrow for the panel's full scale [m]
LEAST_FORCE = 0.004  # part of the full scale below which a force is not drawn [-]
AROUND_M = np.linspace(-1.5, 1.5, 31)  # where, from O, the ground is looked at for the camera's level [m]


class Scene:
    """Draws one instant into a picture of `size`, whose `right` pixels the leg leaves free."""

    def __init__(
        self,
        brush: Brush,
        geometry: Geometry,
        terrain: Terrain,
        size: tuple[int, int],
        right: int,
        trunk: str,
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
        self._heel: deque[tuple[float, complex]] = deque()  # its path
        self._toe: deque[tuple[float, complex]] = deque()
        self._leg = tables(geometry)
        self._ground = GroundPainter(brush, terrain, size, self._scale, 2 * self._centre)
        self._body = Body(brush, geometry, self._scale, trunk)
        self._sky = self._paint_sky()
        self._key = lru_cache(maxsize=8)(self._paint_key)

    def reset(self) -> None:
        """Forget the paths."""
        for path in (self._heel, self._toe):
            path.clear()

    def add(self, instants: Sequence[Instant]) -> None:
        """Lengthen the paths of toe and heel by instants in the order of time."""
        now = instants[-1].time
        toe, heel = self._toe, self._heel
        for instant in instants:
            if not toe or instant.time >= toe[-1][0] + PATH_STEP * (1 - 1e-6):
                toe.append((instant.time, complex(instant.toe_x, instant.toe_y)))
                heel.append((instant.time, complex(instant.heel_x, instant.heel_y)))
        while toe[0][0] < now - PATH_SECONDS:
            toe.popleft(), heel.popleft()

    def draw(self, canvas: Any, now: Instant, full_scale: float) -> None:
        """Draw an instant; the arrow of a force `full_scale` [N] is `ARROW_M` long."""
        pixels = self.look_at(now)
        canvas.blit(self._sky, (0, 0))
        self._body.draw_support(canvas, pixels["O"])
        self._ground.draw(canvas, now, self.corner)
        self._body.draw_trunk(canvas, pixels["O"], now.pitch)
        self._draw_paths(canvas, pixels)
        self._body.draw_leg(canvas, pixels)
        self._draw_forces(canvas, now, full_scale)
        canvas.blit(self._key(full_scale), (0, 0), special_flags=pygame.BLEND_PREMULTIPLIED)

    @property
    def corner(self) -> complex:
        """Place in the world of the picture's upper left corner [m]."""
        return self._camera + complex(-self._centre, self._level) / self._scale

    def look_at(self, now: Instant) -> dict[str, complex]:
        """Point the camera at an instant; returns where each named point of the leg lies [pixels]."""
        usual = self._geometry.hip_height
        hip = complex(now.trunk_x, now.trunk_y)
        level = float(self._ground.height(hip.real + AROUND_M).mean())
        high = hip.imag - level
        rise = high - min(max(high, usual - HEIGHT_SLACK_M), usual + HEIGHT_SLACK_M)
        self._camera = complex(hip.real, level + rise)
        z, dz, ddz = np.empty((3, len(POINTS)), np.complex128)
        crank, pivot = self._geometry.lengths["OP"], complex(*self._geometry.pivot)
        solve_points(now.crank_angle, crank, pivot, *self._leg, z, dz, ddz)
        z *= np.exp(1j * now.swing_angle)
        z.real *= self._geometry.travel
        points = hip + z * np.exp(1j * now.pitch)
        return dict(zip(POINTS, self._pixels(points).tolist(), strict=True))

    def _pixels(self, z: Any) -> Any:
        """World position, complex [m], to position in the picture, complex with y down [pixels]."""
        return np.conj(z - self._camera) * self._scale + complex(self._centre, self._level)

    def _paint_sky(self) -> Any:
        ramp = pygame.Surface((1, 2), 0, 32)
        ramp.set_at((0, 0), SKY_TOP)
        ramp.set_at((0, 1), SKY_BOTTOM)
        return pygame.transform.smoothscale(ramp, self._size)

    def _draw_paths(self, canvas: Any, pixels: dict[str, complex]) -> None:
        for colour, path, point in (
            (HEEL, self._heel, self._geometry.heel),
            (TOE, self._toe, self._geometry.toe),
        ):
            if len(path) < 2:
                continue
            times, places = zip(*path, strict=True)
            line = np.append(self._pixels(np.array(places)), pixels[point])
            points = list(zip(line.real.tolist(), line.imag.tolist(), strict=True))
            for first in range(0, len(points) - 1, 10):  # older parts fade into the sky
                part = points[first : first + 11]
                faded = mix(colour, SKY_BOTTOM, 0.75 * (times[-1] - times[first]) / PATH_SECONDS)
                for shift in (0.0, 0.8 * self._brush.unit):  # an anti-aliased line is one pixel wide
                    pygame.draw.aalines(canvas, faded, False, [(x, y + shift) for x, y in part])

    def _draw_forces(self, canvas: Any, now: Instant, full_scale: float) -> None:
        """Arrows of the forces on the hoof; where both points bear load, that of their sum behind them."""
        if now.grf < full_scale * LEAST_FORCE:
            return
        forces = [
            (TOE, 3.0, complex(now.toe_x, now.toe_y), complex(now.toe_force_x, now.toe_force_y)),
            (HEEL, 3.0, complex(now.heel_x, now.heel_y), complex(now.heel_force_x, now.heel_force_y)),
            (FORCE, 7.0, complex(now.cop_x, now.cop_y), complex(now.force_x, now.force_y)),
        ]
        ends = [
            (colour, width * self._brush.unit * FINE, self._pixels(foot),
             self._pixels(foot + force * ARROW_M / full_scale))
            for colour, width, foot, force in reversed(forces) if force
        ]  # fmt: skip

        def paint(fine: Any, place: Any) -> None:
            for colour, width, tail, tip in ends:
                for shade, grow in ((PAPER, 1.2 * FINE), (colour, 0.0)):
                    pygame.draw.circle(fine, shade, place(tail), 0.75 * width + grow)
                    arrow(fine, shade, place(tail), place(tip), width, grow)

        box = [z for end in ends for z in end[2:]]
        self._brush.smooth(canvas, box, 14 * self._brush.unit, paint)
        tip = ends[0][3]
        text = f"{now.grf / 1000:.2f} kN"
        self._brush.write(canvas, text, (tip.real + 12 * self._brush.unit, tip.imag), 21, FORCE)

    def _paint_key(self, full_scale: float) -> Any:
        unit = self._brush.unit
        force = full_scale / 5
        length = force / full_scale * ARROW_M * self._scale
        kinds = self._ground.kinds()
        words = f"{force / 1000:g} kN on the hoof", "toe: force and path", "heel: force and path", "crank"
        rows = [20 + (20 + 20 * k) * 1j for k in range(4)]
        places = [row * unit for row in rows] + [row * unit + self._centre for row in rows[: len(kinds)]]
        image = pygame.Surface((round(2 * self._centre), round(100 * unit)), pygame.SRCALPHA, 32)

        def paint(fine: Any, place: Any) -> None:
            arrow(fine, FORCE, place(places[0]), place(places[0] + length), 7 * unit * FINE)
            for at, (colour, radius) in zip(
                places[1:4], ((TOE, 1.2), (HEEL, 1.2), (CRANK, 3.3)), strict=True
            ):
                bar(fine, colour, place(at), place(at + length), radius * unit * FINE, radius * unit * FINE)
            for at, (_, colour) in zip(places[4:], kinds, strict=True):
                x, y = place(at - 6j * unit)
                swatch = pygame.Rect(x, y, length * FINE, 12 * unit * FINE)
                pygame.draw.rect(fine, SOIL_LINE, swatch)
                pygame.draw.rect(fine, colour, swatch.inflate(-2 * FINE, -2 * FINE))

        self._brush.smooth(image, [*places, places[-1] + length], 10 * unit, paint)
        for at, text in zip(places, (*words, *(name for name, _ in kinds)), strict=True):
            write_at = at + length + 12 * unit
            self._brush.write(image, text, (write_at.real, write_at.imag), 19, GREY)
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

"""The scene: sky, ground, trunk and legs, the paths of toe and heel, the forces on the hooves.

The camera follows the crank centre O along x. It stays at a constant height over the ground
around O, with room for every angle that the leg can reach; it follows O up or down only when O leaves its
usual heights.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pygame

from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.mechanism_list import flesh_of
from hoof_env.record.instant import BodyInstant, Instant
from hoof_env.record.surroundings import ONE_HIP, Hips
from hoof_env.render.brush import FINE, Brush, arrow, bar
from hoof_env.render.colours import (
    COAT,
    COAT_EDGE,
    CRANK,
    FORCE,
    GREY,
    HEEL,
    HOOF,
    INK,
    LINK,
    PAPER,
    PASTERN,
    PLATE,
    SKY_BOTTOM,
    SKY_TOP,
    SOIL_LINE,
    TOE,
    mix,
)
from hoof_env.render.ground import GroundPainter
from hoof_env.render.outline import (
    AROUND_M,
    ARROW_M,
    HORN_SHARE,
    MIN_FORCE_SHARE,
    USUAL_HIP_M,
    LegOutline,
    drawn_sole,
    reach,
)
from hoof_env.render.panel import KILONEWTONS, Unit
from hoof_env.render.trunk import TrunkPainter

HEIGHT_SLACK_M = 0.2  # distance of O from the nominal hip height beyond which the camera follows [m]
SOIL_M = 0.4  # least depth of soil in the picture [m]
MARGIN_M = 0.1  # room around the leg at its furthest reach [m]
PATH_SECONDS = 1.0  # length of the paths of toe and heel [s]
PATH_STEP = 0.01  # time between two places of a path [s]


class LegScene:
    """Scene in a picture of `size`, whose `right` pixels the legs at `hips` leave free.

    Attributes:
        small: size of trunk and arrows relative to their full size, at most 1.
    """

    small = 1.0
    _hoof_length = 0.0
    _unit, _newtons, _digits = KILONEWTONS

    def __init__(
        self,
        brush: Brush,
        geometry: Geometry,
        terrain: Terrain,
        size: tuple[int, int],
        right: int,
        trunk: str,
        forces: Unit = KILONEWTONS,
        hips: Hips = ONE_HIP,
        hoof_length: float = 0.0,
    ) -> None:
        self._unit, self._newtons, self._digits = forces
        self._brush = brush
        self._geometry = geometry
        self._hoof_length = hoof_length
        self._size = size
        self.small = min(1.0, geometry.hip_height / USUAL_HIP_M)
        out, up = reach(geometry)
        out += max(abs(x) for x, _ in hips.values())
        spare = (HEIGHT_SLACK_M + MARGIN_M) * self.small
        hip = geometry.hip_height + hoof_length
        soil = max(out + spare - hip, SOIL_M * self.small)
        sky = hip + up + spare
        self._centre = (size[0] - right) / 2
        self._scale = min(size[1] / (soil + sky), self._centre / (out + MARGIN_M * self.small))
        self._level = size[1] - soil * self._scale  # of the ground [pixels] at the camera's usual height
        self._camera = 0j
        # Of each leg time [s], heel and toe [m].
        self._paths: list[deque[tuple[float, complex, complex]]] = [deque() for _ in hips]
        self._ground = GroundPainter(brush, terrain, size, self._scale, 2 * self._centre)
        self._leg = LegOutline(geometry)
        self._girth = self.small
        self._trunk = TrunkPainter(brush, trunk, self._metre)
        self._sky = self._paint_sky()
        self._key = lru_cache(maxsize=8)(self._paint_key)

    @property
    def _metre(self) -> float:
        """Pixels per metre of trunk and arrows."""
        return self._scale * self.small

    def reset(self) -> None:
        for path in self._paths:
            path.clear()

    def add(self, instants: Sequence[BodyInstant]) -> None:
        """Lengthen the paths of toes and heels by instants in the order of time."""
        for i, path in enumerate(self._paths):
            for now in instants:
                if not path or now.time >= path[-1][0] + PATH_STEP * (1 - 1e-6):
                    leg = now.legs[i]
                    path.append((now.time, complex(leg.heel_x, leg.heel_y), complex(leg.toe_x, leg.toe_y)))
            while path[0][0] < instants[-1].time - PATH_SECONDS:
                path.popleft()

    def _soles(self, legs: Sequence[Instant]) -> Sequence[Instant]:
        """Return legs, with the heel at the toe if they have one foot, whose heel is (0, 0) in the engine."""
        if self._geometry.heel is not None:
            return legs
        return [leg._replace(heel_x=leg.toe_x, heel_y=leg.toe_y, heel_depth=leg.toe_depth) for leg in legs]

    def draw(self, canvas: Any, now: BodyInstant, full_scale: float) -> None:
        """Draw an instant; the arrow of a force `full_scale` [N] is `ARROW_M` long."""
        each = self.look_at(now)
        canvas.blit(self._sky, (0, 0))
        hip = complex(self._pixels(complex(now.x, now.y)))
        self._trunk.draw_support(canvas, hip)
        self._ground.draw(canvas, self._soles(now.legs), self.corner)
        self._trunk.draw(canvas, hip, now.pitch)
        for path, pixels, leg in zip(self._paths, each, now.legs, strict=True):
            self._draw_path(canvas, path, self._feet(pixels, leg))
        for pixels, leg in zip(each, now.legs, strict=True):
            self._draw_leg(canvas, pixels, self._sole(pixels, leg))
        for leg in now.legs:
            self._draw_forces(canvas, leg, full_scale)
        canvas.blit(self._key(full_scale), (0, 0), special_flags=pygame.BLEND_PREMULTIPLIED)

    @property
    def corner(self) -> complex:
        """Place in the world of the picture's upper left corner [m]."""
        return self._camera + complex(-self._centre, self._level) / self._scale

    def look_at(self, now: BodyInstant) -> list[dict[str, complex]]:
        """Point the camera at an instant; return for each leg where its named points lie [pixels]."""
        usual = self._geometry.hip_height + self._hoof_length
        hip = complex(now.x, now.y)
        level = float(self._ground.height(hip.real + self.small * AROUND_M).mean())
        high = hip.imag - level
        slack = HEIGHT_SLACK_M * self.small
        rise = high - min(max(high, usual - slack), usual + slack)
        self._camera = complex(hip.real, level + rise)
        return [self.points_of(leg) for leg in now.legs]

    def points_of(self, now: Instant) -> dict[str, complex]:
        """Return the place of each named point of a leg [pixels]."""
        points = self._pixels(self._leg.points(now)).tolist()
        return dict(zip(self._geometry.mechanism.points, points, strict=True))

    def _feet(self, pixels: dict[str, complex], now: Instant) -> dict[str, complex]:
        """Return the place of toe and heel by name [pixels]: of the soles, where springs hold them below the
        leg."""
        feet = self._geometry.corners
        if not self._hoof_length:
            return {name: pixels[name] for name in feet}
        places = (complex(now.toe_x, now.toe_y), complex(now.heel_x, now.heel_y))
        return {name: complex(self._pixels(place)) for name, place in zip(feet, places, strict=False)}

    def _sole(self, pixels: dict[str, complex], now: Instant) -> dict[str, complex]:
        """Return the ends of the drawn sole by the names of toe and heel [pixels]."""
        feet = self._feet(pixels, now)
        if not self._hoof_length or len(feet) < 2:
            return feet
        ends = drawn_sole(complex(now.toe_x, now.toe_y), complex(now.heel_x, now.heel_y))
        return {name: complex(self._pixels(end)) for name, end in zip(feet, ends, strict=True)}

    def _pixels(self, z: Any) -> Any:
        """Convert positions in the world, complex [m], to pixels of the picture, complex with y down."""
        return np.conj(z - self._camera) * self._scale + complex(self._centre, self._level)

    def _paint_sky(self) -> Any:
        ramp = pygame.Surface((1, 2), 0, 32)
        ramp.set_at((0, 0), SKY_TOP)
        ramp.set_at((0, 1), SKY_BOTTOM)
        return pygame.transform.smoothscale(ramp, self._size)

    def _draw_leg(
        self, canvas: Any, pixels: dict[str, complex], sole: dict[str, complex], lettered: bool = True
    ) -> None:
        """Draw a leg with its points and the ends of its sole at some `pixels`."""
        metre = self._girth * self._scale * FINE  # on the fine surface
        crank = self._geometry.crank_length / self._girth
        edge = 1.5 * FINE
        mechanism = self._geometry.mechanism
        fixed = mechanism.fixed
        feet = mechanism.feet
        flesh = flesh_of(mechanism)
        hoof = [
            plate for plate in mechanism.plates if len(plate) == 3 and {*feet} < {*plate} and len(feet) == 2
        ]

        def paint(fine: Any, place: Any) -> None:
            at = {name: place(z) for name, z in pixels.items()}
            for colour, grow in ((COAT_EDGE, edge), (COAT, 0.0)):
                for a, b, radius_a, radius_b in flesh:
                    bar(fine, colour, at[a], at[b], radius_a * metre + grow, radius_b * metre + grow)
            for plate in hoof:
                ankle = next(name for name in plate if name not in feet)
                horn = [place(sole[n] + HORN_SHARE * (pixels[ankle] - sole[n])) for n in feet]
                ends = [place(sole[n]) for n in reversed(feet)]
                pygame.draw.polygon(fine, PASTERN, [at[ankle], *ends])
                pygame.draw.polygon(fine, HOOF, [*ends, *horn])
            pygame.draw.circle(fine, CRANK, at[fixed[0]], crank * metre, round(1.3 * FINE))
            for pivot in fixed[1:]:
                bar(fine, PLATE, at[fixed[0]], at[pivot], 0.02 * metre, 0.02 * metre)
            for corners in mechanism.plates:
                if corners not in hoof:
                    pygame.draw.polygon(fine, PLATE, [at[name] for name in corners])
            for a, b in mechanism.edges:
                bar(fine, LINK, at[a], at[b], 0.015 * metre, 0.015 * metre)
            for i, link in enumerate(mechanism.bodies):
                colour, radius = (CRANK, 0.024 * metre) if i == mechanism.crank else (LINK, 0.015 * metre)
                bar(fine, colour, at[link.tail], at[link.head], radius, radius)
            for name, where in at.items():
                radius = (0.038 if name in fixed else 0.025) * metre
                pygame.draw.circle(fine, INK, where, radius)
                pygame.draw.circle(fine, PAPER, where, radius - edge)
            for pivot in fixed:
                pygame.draw.circle(fine, INK, at[pivot], 0.013 * metre)

        turn = self._geometry.crank_length * self._scale * (1 + 1j)
        hip = pixels[fixed[0]]
        box = [*pixels.values(), *sole.values(), hip - turn, hip + turn]
        self._brush.smooth(canvas, box, 0.16 * self._girth * self._scale + 2, paint)
        for pivot in fixed if lettered else ():
            side, shift = ("midbottom", -0.05j) if pivot == fixed[0] else ("midleft", 0.06)
            letter = pixels[pivot] + shift * self._metre
            self._brush.write(canvas, pivot, (letter.real, letter.imag), 18, INK, side)

    def _draw_path(
        self, canvas: Any, path: Sequence[tuple[float, complex, complex]], feet: dict[str, complex]
    ) -> None:
        """Draw the path of one leg's toe and heel up to where they are."""
        if len(path) < 2:
            return
        times, *paths = zip(*path, strict=True)
        points_now = [feet[point] for point in reversed(self._geometry.corners)]
        for colour, places, end in zip((HEEL, TOE), paths, points_now, strict=True):
            if colour == HEEL and self._geometry.heel is None:
                continue
            line = np.append(self._pixels(np.array(places)), end)
            points = list(zip(line.real.tolist(), line.imag.tolist(), strict=True))
            for first in range(0, len(points) - 1, 10):  # older parts fade into the sky
                part = points[first : first + 11]
                faded = mix(colour, SKY_BOTTOM, 0.75 * (times[-1] - times[first]) / PATH_SECONDS)
                for shift in (0.0, 0.8 * self._brush.unit):  # an anti-aliased line is one pixel wide
                    pygame.draw.aalines(canvas, faded, False, [(x, y + shift) for x, y in part])

    def _draw_forces(
        self, canvas: Any, now: Instant, full_scale: float, share: float = 1.0, is_told: bool = True
    ) -> None:
        """Draw the forces on toe and heel, and behind them their sum."""
        if now.grf < full_scale * MIN_FORCE_SHARE:
            return
        forces = [
            (TOE, 3.0, complex(now.toe_x, now.toe_y), complex(now.toe_force_x, now.toe_force_y)),
            (HEEL, 3.0, complex(now.heel_x, now.heel_y), complex(now.heel_force_x, now.heel_force_y)),
            (FORCE, 7.0, complex(now.cop_x, now.cop_y), complex(now.force_x, now.force_y)),
        ]
        ends = []
        for colour, width, foot, force in reversed(forces):
            if force:
                head = self._pixels(foot + force * share * self.small * ARROW_M / full_scale)
                ends.append((colour, width * self._brush.unit * FINE, self._pixels(foot), head))

        def paint(fine: Any, place: Any) -> None:
            for colour, width, tail, tip in ends:
                for shade, grow in ((PAPER, 1.2 * FINE), (colour, 0.0)):
                    pygame.draw.circle(fine, shade, place(tail), 0.75 * width + grow)
                    arrow(fine, shade, place(tail), place(tip), width, grow)

        box = [z for end in ends for z in end[2:]]
        self._brush.smooth(canvas, box, 14 * self._brush.unit, paint)
        if not is_told:
            return
        tip = ends[0][3]
        text = f"{now.grf / self._newtons:.{self._digits}f} {self._unit}"
        # On the side to which the arrow leans, where its shaft is not.
        is_left = ends[0][2].real > tip.real
        beside = tip.real + (-12 if is_left else 12) * self._brush.unit
        self._brush.write(canvas, text, (beside, tip.imag), 21, FORCE, "midright" if is_left else "midleft")

    def _paint_key(self, full_scale: float) -> Any:
        unit = self._brush.unit
        force = full_scale / 5
        length = force / full_scale * ARROW_M * self._metre
        kinds = self._ground.kinds()
        bars = [("toe: force and path", TOE, 1.2), ("heel: force and path", HEEL, 1.2), ("crank", CRANK, 3.3)]
        if self._geometry.heel is None:
            del bars[1]
        words = (f"{force / self._newtons:g} {self._unit} on the hoof", *(text for text, *_ in bars))
        left = [(20 + (20 + 20 * k) * 1j) * unit for k in range(len(words))]
        right = [self._centre + (20 + (20 + 20 * k) * 1j) * unit for k in range(len(kinds))]
        places = [*left, *right]
        image = pygame.Surface((round(2 * self._centre), round(100 * unit)), pygame.SRCALPHA, 32)

        def paint(fine: Any, place: Any) -> None:
            arrow(fine, FORCE, place(left[0]), place(left[0] + length), 7 * unit * FINE)
            for at, (_, colour, radius) in zip(left[1:], bars, strict=True):
                bar(fine, colour, place(at), place(at + length), radius * unit * FINE, radius * unit * FINE)
            for at, (_, colour) in zip(right, kinds, strict=True):
                x, y = place(at - 6j * unit)
                swatch = pygame.Rect(x, y, length * FINE, 12 * unit * FINE)
                pygame.draw.rect(fine, SOIL_LINE, swatch)
                pygame.draw.rect(fine, colour, swatch.inflate(-2 * FINE, -2 * FINE))

        self._brush.smooth(image, [*places, places[-1] + length], 10 * unit, paint)
        for at, text in zip(places, (*words, *(name for name, _ in kinds)), strict=True):
            write_at = at + length + 12 * unit
            self._brush.write(image, text, (write_at.real, write_at.imag), 19, GREY)
        return image

"""Drawing data of an instant: a row of numbers, and the place of each glyph's numbers in the row.

A row begins with time, the place that the camera looks at, and the numbers of the page; outlines follow, in
metres of the world. The script of a page hands the parts of a row to the glyphs by `Drawing.places`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.mechanism_list import flesh_of
from hoof_env.record.instant import BodyInstant, Instant
from hoof_env.record.surroundings import Surroundings
from hoof_env.render.outline import (
    AROUND_M,
    ARROW_M,
    BODY,
    EAR,
    FAR,
    HOLD_M,
    HORN_SHARE,
    HORSE_HIP_M,
    MIN_FORCE_SHARE,
    TAIL,
    TRUNK_M,
    USUAL_HIP_M,
    LegOutline,
    drawn_sole,
    reach,
)

Floats = NDArray[np.float64]
Points = NDArray[np.complex128]

HEAD = 3
"""Count of numbers at the front of a row: time [s], and the camera's x and ground level [m]."""

ARC = 9  # vertices of the round end of a part
ARROW_WIDTH_M = 0.035  # of the arrow of a whole hoof [m]; arrows of toe and heel are half as wide
COIL = np.linspace(0.0, 1.0, 17)


class Place(NamedTuple):
    """Place in a row of the numbers of one column of a glyph's source.

    Attributes:
        source, column: names.
        start, pieces, length: first number, how many lists there are, and the length of each; 0 pieces for
            one plain column.
    """

    source: str
    column: str
    start: int
    pieces: int
    length: int


def capsules(tails: Points, heads: Points, first: Floats, last: Floats) -> Points:
    """Return the outlines of parts with round ends, shape (n, 2 `ARC`) [m].

    Args:
        tails, heads: ends of the axes, shape (n,) [m].
        first, last: radii there, shape (n,) [m].
    """
    along = heads - tails
    along = along / np.maximum(np.abs(along), 1e-9)
    turn = np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, ARC))
    ahead = heads[:, None] + last[:, None] * along[:, None] * turn
    behind = tails[:, None] - first[:, None] * along[:, None] * turn
    return np.concatenate([ahead, behind], axis=1)


def arrows(tails: Points, forces: Points, widths: Floats) -> Points:
    """Return the outlines of arrows from points, shape (n, 7) [m]; arrows without length are points."""
    size = np.abs(forces)
    along = forces / np.maximum(size, 1e-9)
    head = np.minimum(3.0 * widths, size)
    side = 0.5j * widths * along * (size > 0)
    wing = 0.5j * head * along
    tips = tails + forces
    necks = tips - head * along
    shape = (tails + side, necks + side, necks + wing, tips, necks - wing, necks - side, tails - side)
    return np.stack(shape, axis=1)


class Drawing:
    """Rows of the instants of legs under the bar of a trunk.

    Args:
        setting: surroundings of the environment.
        numbers: how many numbers of the page follow the head of a row.

    Attributes:
        places: where glyphs find their numbers.
        has_heel: False for legs with one foot, which is called toe.
        full_scale: force of an arrow of `ARROW_M` at a leg of a horse's size [N].
        low, high, half_width: the camera's view around its place [m].
        size, girth: size of trunk and arrows, and of legs, relative to the usual one [-].
        weights, far, trunk_parts: full scale relative to the weight [-], legs behind the trunk, parts of
            the trunk.
    """

    weights = 4.0
    far: tuple[int, ...] = ()
    trunk_parts = 1
    low: float
    high: float
    half_width: float

    def __init__(self, setting: Surroundings, numbers: int) -> None:
        self._setting = setting
        self._leg = LegOutline(setting.geometry)
        self._geometry = setting.geometry
        self.has_heel = setting.geometry.heel is not None
        self._find_points()
        self.size = self.girth = 1.0
        self._measure()
        self.full_scale = nice(max(self.weights * setting.weight_n, 10.0))
        self.places: list[Place] = []
        self._used = HEAD + numbers
        legs = range(len(setting.hips))
        self._groups = {
            "far": [i for i in legs if i in self.far],
            "near": [i for i in legs if i not in self.far],
        }
        for group in self._groups:
            self._claim_legs(group)
        self._claim("trunk", self.trunk_parts, 2 * ARC)
        self._claim("support", 0, len(COIL))
        self._claim("arrows", 3 * len(legs), 7)

    def _measure(self) -> None:
        """Set the sizes and the camera's view."""
        hip = self._geometry.hip_height + self._setting.hoof_length
        self.size = self.girth = min(1.0, hip / USUAL_HIP_M)
        out, up = reach(self._geometry)
        out += max(abs(x) for x, _ in self._setting.hips.values())
        self.low = -max(out + 0.3 * self.size - hip, 0.4 * self.size)
        self.high = hip + up + 0.3 * self.size
        self.half_width = out + 0.1 * self.size

    def _find_points(self) -> None:
        """Find the points of flesh and hooves, if the legs have them."""
        points = self._geometry.mechanism.points
        self._number = {name: k for k, name in enumerate(points)}
        mechanism = self._geometry.mechanism
        self._flesh = flesh_of(mechanism)
        edges = [[self._number[name] for name in ends] for ends in zip(*mechanism.edges, strict=True)]
        tails, heads = edges or ([], [])
        self._rods = [*mechanism.tails, *tails], [*mechanism.heads, *heads]
        self._corners = [self._number[name] for name in self._geometry.corners]
        sole = self._geometry.mechanism.sole
        self._ankle = self._number[sole[0]] if sole else self._corners[0]

    def _claim(self, source: str, pieces: int, length: int) -> None:
        """Give the outlines of a source their places."""
        for column in ("xs", "ys") if pieces else ("x", "y"):
            self.places.append(Place(source, column, self._used, pieces, length))
            self._used += max(pieces, 1) * length

    def _claim_legs(self, group: str) -> None:
        legs = len(self._groups[group])
        if not legs:
            return
        self._claim(f"{group}_flesh", legs * max(len(self._flesh), 1), 2 * ARC)
        self._claim(f"{group}_hoof", 2 * legs, 4)
        self._claim(f"{group}_links", legs * len(self._rods[0]), 2)
        self._claim(f"{group}_joints", 0, legs * len(self._number))

    @property
    def length(self) -> int:
        """Length of a row."""
        return self._used

    def row(self, now: BodyInstant, numbers: Sequence[float]) -> Floats:
        """Return the row of an instant, shape (`length`,), with the numbers of the page."""
        terrain = self._setting.terrain
        level = float(terrain.height_at(now.x + self.size * AROUND_M).mean())
        parts: list[Any] = [(now.time, now.x, level), numbers]
        points = [self._leg.points(leg) for leg in now.legs]
        for group in self._groups.values():
            if group:
                parts += self._legs([points[i] for i in group], [now.legs[i] for i in group])
        trunk, support = self._trunk(now)
        for outline in (trunk, support, self._arrows(now.legs)):
            parts += [outline.real.ravel(), outline.imag.ravel()]
        return np.concatenate(parts)

    def _legs(self, points: list[Points], legs: Sequence[Instant]) -> list[Floats]:
        """Return the numbers of some legs: flesh, hooves, links and joints."""
        whole = np.stack(points)
        n = len(points)
        # A leg without these points has no flesh, drawn as a part without extent.
        parts = self._flesh or [(self._geometry.toe, self._geometry.toe, 0.0, 0.0)]
        first, last, one, other = zip(*parts, strict=True)
        flesh = capsules(
            whole[:, [self._number[name] for name in first]].ravel(),
            whole[:, [self._number[name] for name in last]].ravel(),
            self.girth * np.tile(one, n),
            self.girth * np.tile(other, n),
        )
        ankle = whole[:, self._ankle]
        sole, back = (whole[:, corner] for corner in self._corners)
        if self._setting.hoof_length:
            sole, back = np.array(
                [drawn_sole(complex(leg.toe_x, leg.toe_y), complex(leg.heel_x, leg.heel_y)) for leg in legs]
            ).T
        pastern = np.stack([ankle, sole, back, ankle], axis=1)
        horn = np.stack(
            [sole, back, back + HORN_SHARE * (ankle - back), sole + HORN_SHARE * (ankle - sole)], axis=1
        )
        hooves = np.stack([pastern, horn], axis=1)
        tails, heads = self._rods
        links = np.stack([whole[:, tails], whole[:, heads]], axis=-1)
        outlines = (flesh, hooves, links, whole)
        return [part.ravel() for outline in outlines for part in (outline.real, outline.imag)]

    def _trunk(self, now: BodyInstant) -> tuple[Points, Points]:
        """Return the outlines of the trunk and of its support."""
        hip = complex(now.x, now.y)
        turn = np.exp(1j * now.pitch)
        half, above, below = (self.size * length for length in TRUNK_M)
        radius = (above + below) / 2
        middle = hip + turn * 0.5j * (above - below)
        way = turn * (half - radius)
        barrel = capsules(*(np.array([z]) for z in (middle - way, middle + way)), *np.full((2, 1), radius))
        top = hip + turn * 1j * above
        sky = complex(top.real, self.high + 10.0)
        coil = top + (sky - top) * np.where(COIL < 1, COIL * 0.08 * self.size, 1.0)
        if self._setting.trunk == "suspended":
            coil[2:-2] += 0.06 * self.size * np.resize([1, -1], len(COIL) - 4)
        elif self._setting.trunk == "boom":  # its end, which comes towards the viewer
            coil = middle + HOLD_M * self.size * np.exp(2j * np.pi * np.linspace(0.0, 1.0, len(COIL)))
        elif self._setting.trunk == "floating":  # nothing holds it
            coil = np.full(len(COIL), middle)
        else:  # a rail or a plate
            coil = top + 0.1j * self.size + np.linspace(-9.0, 9.0, len(COIL))
        return barrel, coil

    def _arrows(self, legs: Sequence[Instant]) -> Points:
        """Return the arrows of toe, heel and whole hoof of each leg."""
        tails: list[complex] = []
        forces: list[complex] = []
        for now in legs:
            tails += [complex(now.toe_x, now.toe_y), complex(now.heel_x, now.heel_y)]
            tails.append(complex(now.cop_x, now.cop_y))
            forces += [complex(now.toe_force_x, now.toe_force_y), complex(now.heel_force_x, now.heel_force_y)]
            forces.append(complex(now.force_x, now.force_y))
        lengths = np.array(forces) / self.full_scale
        hoof = np.abs(lengths[2::3])
        drawn = np.repeat(hoof >= MIN_FORCE_SHARE, 3) & (np.abs(lengths) > 0)
        shown: Any = ARROW_M * self.size * np.where(drawn, lengths, 0j)
        # An arrow that is not drawn is a point at the toe: a centre of pressure without load is at 0, 0.
        start = np.where(drawn, np.array(tails), np.repeat(np.array(tails)[::3], 3))
        widths = ARROW_WIDTH_M * self.size * np.tile([0.5, 0.5, 1.0], len(legs))
        return arrows(start, shown, widths)


class HorseDrawing(Drawing):
    """Rows of the instants of a horse."""

    weights = 1.0
    far = FAR
    trunk_parts = len(BODY) + 2

    def _measure(self) -> None:
        """Set the sizes and the camera's view."""
        self.size = self.girth = self._geometry.hip_height / HORSE_HIP_M
        self.low = -0.35 * self.size
        self.high = 2.75 * self.size
        self.half_width = 2.05 * self.size

    def _trunk(self, now: BodyInstant) -> tuple[Points, Points]:
        """Return the outlines of tail, ear, barrel, neck and head; a horse needs no support."""
        centre = complex(now.x, now.y)
        turn = np.exp(1j * now.pitch)
        parts = (TAIL, EAR, *BODY)
        ends = np.array([[complex(*a), complex(*b)] for a, b, _, _ in parts])
        radii = self.size * np.array([[one, other] for _, _, one, other in parts])
        at = centre + self.size * turn * ends
        return capsules(at[:, 0], at[:, 1], *radii.T), np.full(len(COIL), np.nan + 0j)


def nice(force: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is at least `force` [N]."""
    power = 10.0 ** np.floor(np.log10(force))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m >= force * (1 - 1e-12)))

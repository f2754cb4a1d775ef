"""Kinds of ground: stretches that are stiffer, softer or more slippery than usual, and their colours."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hoof_env.ground.terrain import Terrain
from hoof_env.render.colours import (
    PAPER,
    ROUGHER,
    SLIPPERY,
    SOFTER,
    SOIL,
    STIFFER,
    Colour,
    mix,
)

STRONG = 4.0  # a factor of stiffness or friction of this, or its inverse, has the full colour [-]
ALIKE = 0.02  # relative difference of a factor from 1 below which the ground counts as usual [-]


class Patch(NamedTuple):
    """A stretch of ground of one kind: from and to [m], factors of stiffness and friction [-]."""

    start: float
    end: float
    stiffness: float
    friction: float


def find_patches(terrain: Terrain) -> list[Patch]:
    """Stretches of one kind, all but the usual; a change over one spacing counts half to either side."""
    factors = np.array([terrain.stiffness, terrain.friction])
    differs = (np.diff(np.round(factors / ALIKE), axis=1) != 0).any(axis=0)
    changes = [0, *(np.flatnonzero(differs) + 1).tolist(), factors.shape[1]]
    patches = []
    for first, end in pairwise(changes):
        stiffness, friction = factors[:, (first + end) // 2].tolist()
        if max(abs(stiffness - 1), abs(friction - 1)) > ALIKE:
            left = -np.inf if first == 0 else terrain.start + (first - 0.5) * terrain.spacing
            right = np.inf if end == factors.shape[1] else terrain.start + (end - 0.5) * terrain.spacing
            patches.append(Patch(left, right, stiffness, friction))
    return patches


def kinds_of(terrain: Terrain) -> list[tuple[str, Colour]]:
    """Return name and colour of every kind of ground in the terrain but the usual."""
    stiffness = np.array(terrain.stiffness)
    friction = np.array(terrain.friction)
    all_kinds = (
        ("stiffer ground", STIFFER, stiffness.max() > 1 + ALIKE),
        ("softer ground", SOFTER, stiffness.min() < 1 - ALIKE),
        ("more slippery", SLIPPERY, friction.min() < 1 - ALIKE),
        ("less slippery", ROUGHER, friction.max() > 1 + ALIKE),
    )
    return [(name, colour) for name, colour, there in all_kinds if there]


def shade(factor: Any) -> Any:
    """Index of the colour for a factor of stiffness or friction: `SHADES` where it is 1."""
    strength = np.log(np.maximum(factor, 1e-3)) / np.log(STRONG)
    usual = np.abs(np.asarray(factor) - 1) <= ALIKE
    steps = np.sign(strength) * np.maximum(np.ceil(np.minimum(np.abs(strength), 1) * SHADES - 1e-9), 1)
    return np.where(usual, 0, steps).astype(int) + SHADES


SHADES = 5  # of a colour between the usual and the full one

BODY: tuple[Colour | None, ...] = tuple(
    mix(SOIL, SOFTER if k < 0 else STIFFER, abs(k) / SHADES) for k in range(-SHADES, SHADES + 1)
)
SKIN: tuple[Colour | None, ...] = tuple(
    mix(PAPER, SLIPPERY if k < 0 else ROUGHER, 0.35 + 0.65 * abs(k) / SHADES) if k else None
    for k in range(-SHADES, SHADES + 1)
)
"""Colours by `shade`: of the soil for stiffness, of its surface for friction."""

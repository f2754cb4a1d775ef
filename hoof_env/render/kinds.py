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

FULL_COLOUR_FACTOR = 4.0  # factor of stiffness or friction that, like its inverse, has the full colour [-]
TOLERANCE = 0.02  # largest difference of a factor from 1 on usual ground [-]


class Patch(NamedTuple):
    """A stretch of ground of one kind: from and to [m], factors of stiffness and friction [-]."""

    start: float
    end: float
    stiffness: float
    friction: float


def find_patches(terrain: Terrain) -> list[Patch]:
    """Return the unusual stretches of a terrain; a change over one spacing belongs half to either side."""
    factors = np.array([terrain.stiffness, terrain.friction])
    differs = (np.diff(np.round(factors / TOLERANCE), axis=1) != 0).any(axis=0)
    changes = [0, *(np.flatnonzero(differs) + 1).tolist(), factors.shape[1]]
    patches = []
    for first, end in pairwise(changes):
        stiffness, friction = factors[:, (first + end) // 2].tolist()
        if max(abs(stiffness - 1), abs(friction - 1)) > TOLERANCE:
            left = -np.inf if first == 0 else terrain.start + (first - 0.5) * terrain.spacing
            right = np.inf if end == factors.shape[1] else terrain.start + (end - 0.5) * terrain.spacing
            patches.append(Patch(left, right, stiffness, friction))
    return patches


def kinds_of(terrain: Terrain) -> list[tuple[str, Colour]]:
    """Return the name and colour of each unusual kind of ground in the terrain."""
    stiffness = np.array(terrain.stiffness)
    friction = np.array(terrain.friction)
    all_kinds = (
        ("stiffer ground", STIFFER, stiffness.max() > 1 + TOLERANCE),
        ("softer ground", SOFTER, stiffness.min() < 1 - TOLERANCE),
        ("more slippery", SLIPPERY, friction.min() < 1 - TOLERANCE),
        ("less slippery", ROUGHER, friction.max() > 1 + TOLERANCE),
    )
    return [(name, colour) for name, colour, there in all_kinds if there]


def shade(factor: Any) -> Any:
    """Return the index of the colour for a factor of stiffness or friction; `SHADES` for a factor of 1."""
    strength = np.log(np.maximum(factor, 1e-3)) / np.log(FULL_COLOUR_FACTOR)
    usual = np.abs(np.asarray(factor) - 1) <= TOLERANCE
    steps = np.sign(strength) * np.maximum(np.ceil(np.minimum(np.abs(strength), 1) * SHADES - 1e-9), 1)
    return np.where(usual, 0, steps).astype(int) + SHADES


SHADES = 5  # number of steps from the usual to the full colour

BODY: tuple[Colour | None, ...] = tuple(
    mix(SOIL, SOFTER if k < 0 else STIFFER, abs(k) / SHADES) for k in range(-SHADES, SHADES + 1)
)
SKIN: tuple[Colour | None, ...] = tuple(
    mix(PAPER, SLIPPERY if k < 0 else ROUGHER, 0.35 + 0.65 * abs(k) / SHADES) if k else None
    for k in range(-SHADES, SHADES + 1)
)
"""Colours by `shade`: of the soil for stiffness, of its surface for friction."""

"""Segment masses of a horse's fore and hind limb on the links of a leg.

The masses are published; `hoof_env/data/limbs` has them with their sources. Which link carries
which segment is assumed there, for the mechanism of the paper: it has no bones. Links are taken from the hip
down to the ground, as high as their centres are on average in the walk of `identified`;
`docs/evidence/limb_masses.md` has them.

Scapula, brachium and thigh are carried by the links. Parts above, such as muscles of the croup where they
were weighed with the trunk, belong to the trunk: `trunk_mass`.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

from hoof_env.errors import ParameterError, check_choice, check_number, one_of
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.mechanism_list import PAPER

LIMBS = ("fore", "hind")

BODY_MASS = 475.0
"""Default mass of the animal [kg]. Shares of it are the same up to 600 kg (Nauwelaerts et al. 2011)."""


@cache
def _measured() -> dict[str, Any]:
    file = resources.files("hoof_env").joinpath("data", "limbs", "warmblood.json")
    return dict(json.loads(file.read_text(encoding="utf-8")))


def carriers() -> list[list[str]]:
    """Return the links, by name, that carry each segment from proximal to distal (assumed)."""
    links: list[list[str]] = _measured()["carriers"]
    return links


def segment_masses(limb: str, body_mass: float = BODY_MASS) -> dict[str, float]:
    """Masses of one limb's segments [kg], by name, from proximal to distal.

    Args:
        limb: "fore" or "hind".
        body_mass: of the animal [kg]; published for 538 kg, and proportional to it.

    Raises:
        ParameterError: another limb, or a mass that is not finite or not above 0.
    """
    check_choice("limb", limb, LIMBS)
    body_mass = check_number("body_mass", body_mass, low=0, exclusive_low=True)
    measured = _measured()
    return {name: mass * body_mass / measured["body_mass"] for name, mass in measured[limb].items()}


def trunk_mass(body_mass: float = BODY_MASS) -> float:
    """Return the mass of a trunk with head and neck, without its two fore and two hind limbs [kg].

    Raises:
        ParameterError: a mass that is not finite or not above 0.
    """
    body_mass = check_number("body_mass", body_mass, low=0, exclusive_low=True)
    return body_mass - 2 * sum(sum(segment_masses(limb, body_mass).values()) for limb in LIMBS)


def with_limb_masses(geometry: Geometry, limb: str, body_mass: float = BODY_MASS) -> Geometry:
    """Return the leg with the masses of a horse's limb instead of its own.

    The mass of each segment lies evenly along the links that carry it (`carriers`).

    Args:
        geometry: of any size; lengths stay.
        limb: "fore" or "hind".
        body_mass: of the animal [kg], as of `segment_masses`.

    Returns:
        The leg, by the same name; `provenance` has the source of its masses.

    Raises:
        ParameterError: another limb, a mass that is not finite or not above 0, or a leg of another mechanism
            than the paper's.
    """
    if one_of("geometry", geometry, Geometry).mechanism != PAPER:
        raise ParameterError(
            f"geometry {geometry.name!r}: expected the paper's mechanism, for whose links it is known which "
            "segment each carries; give other legs `masses`"
        )
    by_link: dict[str, float] = {}
    for links, mass in zip(carriers(), segment_masses(limb, body_mass).values(), strict=True):
        whole = sum(geometry.lengths[name] for name in links)
        by_link |= {name: mass * geometry.lengths[name] / whole for name in links}
    said = f"Masses of the {limb} limb of a horse of {float(body_mass):g} kg (Buchner and others 1997)."
    return geometry.replace(
        masses=tuple(by_link[name] for name in PAPER.body_lengths),
        provenance=f"{geometry.provenance} {said}".lstrip(),
    )

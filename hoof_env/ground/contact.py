"""Settings of the ground, also from presets, and contacts of hoof points (Eqs. 10 to 15) for the paper's
solver."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS, damping, friction_part, normal_force
from hoof_env.leg.presets import DEFAULT_PRESET, Preset, preset_error_type, preset_label, read_preset
from hoof_env.simd.math import EXPONENT_UNIT

TOE = 0
HEEL = 1


@dataclass(slots=True)
class Contact:
    """State of one hoof point; contacts are lists of two, toe first."""

    penetration: float = 0.0  # [m], negative above the ground (Eq. 10)
    rate: float = 0.0  # [m/s], positive while going in (Eq. 12)
    approach: float = 0.0  # [m/s], rate at touch-down, latched until the point leaves; 0 outside
    normal: float = 0.0  # [N], upward on the hoof (Eq. 14)
    friction: float = 0.0  # [N], along x on the hoof (Eq. 15)
    x: float = 0.0  # [m], place of the point
    vx: float = 0.0  # [m/s], sliding speed (Eq. 13)
    inside: bool = False


class GroundRecord(NamedTuple):
    """Settings of a `Ground` as numbers."""

    stiffness: float
    exponent: float
    approach_floor: float
    friction: float
    friction_slow: float
    friction_fast: float
    chi: float  # damping factor [-]
    dashpot: float  # its coefficient [N s/m]
    friction_law: int  # index into `FRICTION_LAWS`
    is_interpolated: bool


@dataclass(frozen=True)
class Ground:
    """Flat ground at y = 0 with one normal law and one friction law.

    Attributes:
        stiffness: K [N/m^n]; the paper's 2e4 ('no smaller than').
        exponent: n [-], a multiple of 1/8; 1.5 is Hertz's and Lankarani-Nikravesh's. The paper does not print
            it.
        normal_law: one of `NORMAL_LAWS`.
        restitution: nominal coefficient of restitution cr, 0 ('inelastic') to 1 ('elastic').
        approach_floor: smallest approach speed [m/s] that Eq. 14 divides by.
        approach: "interpolated" takes the approach speed at the interpolated crossing, "sampled" at the first
            sample inside, as a loop with a fixed step does.
        friction_law: one of `FRICTION_LAWS`.
        friction: mu_k [-]; the paper's 0.4.
        friction_slow, friction_fast: threshold speeds of the friction law [m/s], assumed (not in the paper);
            only "ambrosio" uses the first.
        reference_mass: mass [kg] for which "kelvin-voigt" has this restitution; the other laws do not use it.

    Raises:
        ParameterError: an unknown law or a value out of range.
    """

    stiffness: float = 2e4
    exponent: float = 1.5
    normal_law: str = "lankarani-nikravesh"
    restitution: float = 1.0
    approach_floor: float = 1e-4
    approach: str = "interpolated"
    friction_law: str = "ambrosio"
    friction: float = 0.4
    friction_slow: float = 1e-3
    friction_fast: float = 1e-2
    reference_mass: float = 80.0

    def __post_init__(self) -> None:
        check_number("stiffness", self.stiffness, low=0, high=1e12, exclusive_low=True)
        check_number("exponent", self.exponent, low=1, high=3)
        if self.exponent * EXPONENT_UNIT % 1:
            raise ParameterError(
                f"exponent: expected a multiple of 1/{EXPONENT_UNIT}, whose power is made of square roots and"
                f" so has the same bits alone and in a batch, got {brief(self.exponent)}"
            )
        check_choice("normal_law", self.normal_law, NORMAL_LAWS)
        check_number("approach_floor", self.approach_floor, low=0, high=1e6, exclusive_low=True)
        check_choice("approach", self.approach, ("interpolated", "sampled"))
        check_choice("friction_law", self.friction_law, FRICTION_LAWS)
        check_number("friction", self.friction, low=0, high=10)
        slow = check_number("friction_slow", self.friction_slow, low=0)
        fast = self.friction_fast
        for name in ("friction_fast", "reference_mass"):
            check_number(name, getattr(self, name), low=0, exclusive_low=True)
        if self.friction_law == "ambrosio" and fast <= slow:
            raise ParameterError(
                f"friction_fast: expected more than friction_slow = {slow:g} m/s, got {fast:g}"
            )
        # computed for its check: it refuses a restitution that the law cannot represent
        _ = self.damping

    @property
    def damping(self) -> tuple[float, float]:
        """Damping factor chi [-] and dashpot coefficient c [N s/m]; see `laws.damping`."""
        return damping(self.normal_law, self.restitution, self.stiffness, self.reference_mass)

    def to_record(self) -> GroundRecord:
        """Return the settings as numbers."""
        chi, dashpot = self.damping
        return GroundRecord(
            stiffness=float(self.stiffness),
            exponent=float(self.exponent),
            approach_floor=float(self.approach_floor),
            friction=float(self.friction),
            friction_slow=float(self.friction_slow),
            friction_fast=float(self.friction_fast),
            chi=chi,
            dashpot=dashpot,
            friction_law=FRICTION_LAWS.index(self.friction_law),
            is_interpolated=self.approach == "interpolated",
        )


def new_contacts() -> list[Contact]:
    """Return contacts of toe and heel above the ground."""
    return [Contact(), Contact()]


def latch(contact: Contact, penetration: float, rate: float, ground: GroundRecord) -> None:
    """Update penetration and rate of a point; on entering the ground, latch its approach speed (floored)."""
    if penetration > 0.0 and not contact.inside:
        speed = rate
        if ground.is_interpolated and contact.penetration < 0.0:
            # part of the step up to the crossing of the surface
            part = contact.penetration / (contact.penetration - penetration)
            speed = contact.rate + part * (rate - contact.rate)
        contact.approach = max(speed, ground.approach_floor)
    contact.inside = penetration > 0.0
    if not contact.inside:
        contact.approach = 0.0
    contact.penetration = penetration
    contact.rate = rate


def touch(contact: Contact, position: complex, velocity: complex, ground: GroundRecord) -> complex:
    """Return the force of the ground, y = 0, on one hoof point, as the complex number friction + i normal
    [N]; update `contact`. Position and velocity of the point are complex [m, m/s]."""
    latch(contact, -position.imag, -velocity.imag, ground)  # Eqs. 10 and 12
    contact.x = position.real
    contact.vx = velocity.real  # Eq. 13
    contact.normal = 0.0
    contact.friction = 0.0
    if contact.inside:
        # Eq. 14
        spring = ground.stiffness * _power(contact.penetration, ground.exponent)
        contact.normal = normal_force(spring, ground.chi, ground.dashpot, contact.rate, 1 / contact.approach)
        speed = abs(contact.vx)
        part = friction_part(speed, ground.friction_law, ground.friction_slow, ground.friction_fast)
        # Eq. 15; at rest it has no direction, and the law no friction
        if speed > 0.0:
            contact.friction = -math.copysign(ground.friction * part * contact.normal, contact.vx)
    return complex(contact.friction, contact.normal)


def _power(base: float, exponent: float) -> float:
    """Return a power, infinite where it is too large for a number, as in a solution that diverges."""
    try:
        return base**exponent
    except OverflowError:
        return math.inf


HERTZ = 1.5
"""Exponent n of Hertz's contact and of Lankarani and Nikravesh's law [-]."""

SETTINGS = ("stiffness", "exponent")
"""Entries of a preset's section: K [N/m^n] and n [-] of Eq. 14. The paper prints only a lower limit of K."""


def load_ground(preset: Preset = DEFAULT_PRESET, **overrides: Any) -> Ground:
    """Return the ground of a preset by name, of a file by path, or of such a file's content.

    Args:
        preset: name, path or content; settings that it does not have are the defaults of `Ground`.
        overrides: attributes of `Ground` that replace the preset's, unless None.

    Raises:
        ParameterError: unknown preset name, an override out of range, or content that is wrong as below.
        DataFileError: the file is unreadable, or its ground has unknown entries or bad values.
    """
    section = read_preset(preset).get("ground", {})
    if not isinstance(section, Mapping) or set(section) - set(SETTINGS):
        raise preset_error_type(preset)(
            f"{preset_label(preset)}: ground: expected an object with only the entries "
            f"{', '.join(SETTINGS)}, got {brief(section)}"
        )
    try:
        ground = Ground(**section)
    except ParameterError as error:
        raise preset_error_type(preset)(f"{preset_label(preset)}: ground: {error}") from None
    return replace(ground, **{name: value for name, value in overrides.items() if value is not None})

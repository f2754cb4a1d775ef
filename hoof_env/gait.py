"""Gaits: parameters that a policy commands, with units, limits and the paper's presets; the filters that they
pass through; and the motion of crank and swing that results."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.presets import DEFAULT_PRESET, Preset, preset_error_type, preset_label, read_preset

Gait = TypeVar("Gait")

LIMITS = MappingProxyType(
    {
        "crank_speed": (0.0, 4 * np.pi),
        "swing_offset": (-0.4, 1.4),
        "swing_sin": (-0.9, 0.9),
        "swing_cos": (-0.9, 0.9),
    }
)
"""Lowest and highest value of each gait parameter of the published leg [rad/s, rad, rad, rad]; `limits_of`
scales them to other legs. Both gaits of the paper lie inside, and so do the best learned gaits:
docs/evidence/actions.md has the sweep."""

FASTEST_CRANK = 1000.0
"""Largest crank speed of any leg [rad/s], which a leg of a quarter of a millimetre reaches."""


@cache
def _published_hip_height() -> float:
    return load_geometry(DEFAULT_PRESET).hip_height


def speed_scale_of(geometry: Geometry) -> float:
    """Return the speed of a leg relative to the published leg's at the same Froude number [-]: the root
    of the ratio of their hip heights. A similar motion takes this many times as long."""
    return math.sqrt(geometry.hip_height / _published_hip_height())


def limits_of(geometry: Geometry) -> dict[str, tuple[float, float]]:
    """Return the `LIMITS` of a leg: the angles of the published leg, and at one Froude number crank speeds
    scaled by the root of the inverse ratio of the sizes."""
    low, high = LIMITS["crank_speed"]
    speed_scale = speed_scale_of(geometry)
    return {**LIMITS, "crank_speed": (low / speed_scale, high / speed_scale)}


@dataclass(frozen=True)
class GaitParameters:
    """One steady gait: the crank turns at `crank_speed` and the leg's frame swings about the crank centre by

        phi = swing_offset + swing_sin * sin(theta) + swing_cos * cos(theta),   theta the crank angle.

    The paper says that running 'controls the leg orientation by swinging motion with respect to the body' and
    does not print the law; one harmonic is this project's assumption.

    How fast a crank may be commanded to turn depends on the size of the leg; environments check it.

    >>> import hoof_env
    >>> slow = hoof_env.GaitParameters(crank_speed=3.0, swing_offset=0.7, swing_sin=-0.2, swing_cos=-0.3)
    >>> slow.to_array().tolist()
    [3.0, 0.7, -0.2, -0.3]

    Attributes:
        crank_speed: theta's rate [rad/s], 0 to `FASTEST_CRANK`; to 4 pi in environments of the published leg.
        swing_offset: phi0 [rad], -0.4 to 1.4.
        swing_sin: A [rad], -0.9 to 0.9.
        swing_cos: B [rad], -0.9 to 0.9.

    Raises:
        ParameterError: a value is not finite or outside these limits.
    """

    crank_speed: float
    swing_offset: float
    swing_sin: float
    swing_cos: float

    def __post_init__(self) -> None:
        self._check(LIMITS)

    def _check(self, limits: Mapping[str, tuple[float, float]]) -> None:
        for name in PARAMETERS:
            low, high = limits[name] if name != "crank_speed" else (0.0, FASTEST_CRANK)
            # the dataclass is frozen: `__post_init__` cannot assign
            object.__setattr__(self, name, check_number(name, getattr(self, name), low=low, high=high))

    def to_array(self) -> NDArray[np.float64]:
        """Return the four values in the order of the fields, shape (4,)."""
        return np.array([getattr(self, name) for name in PARAMETERS])

    @classmethod
    def from_array(cls, values: Any) -> GaitParameters:
        """Return the gait of four values, the inverse of `to_array`.

        Raises:
            ParameterError: there are not four values, or one is outside its limits.
        """
        array = np.asarray(values, dtype=np.float64)
        if array.shape != (4,):
            raise ParameterError(f"gait parameters: expected 4 values {PARAMETERS}, got shape {array.shape}")
        return cls(*array.tolist())


PARAMETERS = tuple(item.name for item in fields(GaitParameters))
"""Names of the gait parameters, in the order used by actions and filters."""

MAX_HARMONICS = 3
"""Largest number of harmonics of a swing law."""

WIDEST = MappingProxyType(
    {
        "crank_speed": (0.0, 6 * np.pi),
        "swing_offset": (-1.5, 2.0),
        "swing_sin": (-1.5, 1.5),
        "swing_cos": (-1.5, 1.5),
        "higher": (-0.6, 0.6),
    }
)  # fmt: skip
"""The `LIMITS` of a `HarmonicGait`, of a leg of a horse's size."""


@dataclass(frozen=True)
class HarmonicGait(GaitParameters):
    """Gait with higher harmonics of the swing, so that a hoof can follow a level stance; an engine made with
    `harmonics` takes it, and no environment of one leg does:

        phi = swing_offset + sum over k of A_k sin(k theta) + B_k cos(k theta).

    Attributes:
        higher: A2, B2 and perhaps A3, B3 [rad], -0.6 to 0.6; the others are as in `GaitParameters`.

    Raises:
        ParameterError: a value is not finite, an angle is outside `WIDEST`, or there are not 2 or 4 of
            `higher`.
    """

    higher: tuple[float, ...] = (0.0, 0.0)

    def __post_init__(self) -> None:
        self._check(WIDEST)
        values: Any = self.higher
        try:
            higher = tuple(values)
        except TypeError:
            higher = ()
        if len(higher) not in (2, 4):
            raise ParameterError(
                "higher: expected the sine and cosine coefficients of the second harmonic, or of the second "
                f"and the third, got {brief(values)}"
            )
        low, high = WIDEST["higher"]
        numbers = (check_number(f"higher[{k}]", x, low=low, high=high) for k, x in enumerate(higher))
        object.__setattr__(self, "higher", tuple(numbers))

    def to_array(self) -> NDArray[np.float64]:
        """Return the values in the order of `parameter_names`, shape (6,) or (8,)."""
        return np.append(super().to_array(), self.higher)

    @classmethod
    def from_array(cls, values: Any) -> HarmonicGait:
        """Return the gait of six or eight values, the inverse of `to_array`.

        Raises:
            ParameterError: there are not six or eight values, or one is outside its limits.
        """
        array = np.asarray(values, dtype=np.float64)
        if array.shape not in ((6,), (8,)):
            raise ParameterError(f"gait parameters: expected 6 or 8 values, got shape {array.shape}")
        speed, offset, sine, cosine, *higher = array.tolist()
        return cls(speed, offset, sine, cosine, tuple(higher))


def gait_array(gait: GaitParameters, harmonics: int) -> NDArray[np.float64]:
    """Return the values of a gait for an engine with `harmonics` harmonics, shape (2 + 2 harmonics,); those
    that the gait does not have are 0.

    Raises:
        ParameterError: it has more.
    """
    values = gait.to_array()
    if len(values) > 2 + 2 * harmonics:
        raise ParameterError(
            f"gait: expected a swing of at most {harmonics} harmonic{'s' * (harmonics > 1)}, got"
            f" {brief(gait)}"
        )
    return np.append(values, np.zeros(2 + 2 * harmonics - len(values)))


def parameter_names(harmonics: int = 1) -> tuple[str, ...]:
    """Return the names of the gait parameters of a swing with `harmonics` harmonics, in their order."""
    higher: list[str] = []
    for k in range(2, harmonics + 1):
        higher += (f"swing_sin_{k}", f"swing_cos_{k}")
    return (*PARAMETERS, *higher)


def gait_names(preset: Preset = DEFAULT_PRESET) -> list[str]:
    """Return the names of the gaits in a preset: the paper's walk and run, and others that were found for
    that leg.

    Raises:
        ParameterError: unknown preset name, or content that lacks the part.
        DataFileError: a file lacks it.
    """
    return sorted(_read_gaits(preset))


def load_gait(name: str, preset: Preset = DEFAULT_PRESET) -> GaitParameters:
    """Return a gait of a preset by name, of a file by path, or of such a file's content.

    >>> import hoof_env
    >>> round(hoof_env.load_gait("run").crank_speed, 2)  # [rad/s]
    6.28

    Raises:
        ParameterError: unknown preset or gait name, a value outside its limits, or content that lacks a part.
        DataFileError: a file lacks it.
    """
    gaits = _read_gaits(preset)
    check_choice("gait", name, gaits)
    try:
        return (HarmonicGait if "higher" in gaits[name] else GaitParameters)(**gaits[name])
    # an entry is missing or unknown, or a gait is not an object
    except TypeError:
        raise preset_error_type(preset)(
            f"{preset_label(preset)}, gait {name!r}: expected {', '.join(PARAMETERS)}, perhaps higher, "
            f"got {brief(gaits[name])}"
        ) from None
    except ParameterError as error:
        raise ParameterError(f"{preset_label(preset)}, gait {name!r}: {error}") from None


def paper_gaits(gaits: Mapping[str, Gait]) -> dict[str, Gait]:
    """Return the paper's own gaits among the gaits of a preset, by name and in alphabetical order; all of
    them if it has neither.

    Environments draw or derive from these: their behaviour must not change when a gait is added to a preset.
    """
    names = sorted(set(gaits) & {"walk", "run"} or gaits)
    return {name: gaits[name] for name in names}


def _read_gaits(preset: Preset) -> dict[str, Any]:
    gaits = read_preset(preset).get("gaits")
    if not isinstance(gaits, Mapping) or not gaits:
        raise preset_error_type(preset)(
            f"{preset_label(preset)}: expected an object 'gaits' with at least one gait, got {brief(gaits)}"
        )
    if not all(isinstance(name, str) for name in gaits):
        raise preset_error_type(preset)(
            f"{preset_label(preset)}: gaits: expected names that are strings, got {brief([*gaits])}"
        )
    return dict(gaits)


INNER = 5.0
"""Ratio of the gain of a filter's rate to the gain of its value; above 4 the approach does not oscillate."""

SPEED, OFFSET, SIN, COS = range(4)
"""Order of the four filters, as in `PARAMETERS`."""


@dataclass(slots=True)
class Filter:
    """State of one filter: a parameter, its rate and its acceleration (per s, per s^2)."""

    value: float = 0.0
    rate: float = 0.0
    acc: float = 0.0


@dataclass(slots=True)
class Motion:
    """Crank angle (clockwise positive, not wrapped) and swing angle, with two derivatives each [rad, s]."""

    theta: float = 0.0
    theta_rate: float = 0.0
    theta_acc: float = 0.0
    phi: float = 0.0
    phi_rate: float = 0.0
    phi_acc: float = 0.0


@dataclass(frozen=True)
class FilterSettings:
    """Bounds of the command filters.

    Attributes:
        gain: rate per difference between a parameter and its command [1/s]; the rate follows `INNER` times as
            fast.
        crank_rate, crank_acc: bounds on the crank speed's rate [rad/s^2] and its acceleration [rad/s^3].
        swing_rate, swing_acc: the same for the three swing parameters [rad/s, rad/s^2].

    A horse needs faster changes within a stride than the paper's leg: `QUICK`.

    Raises:
        ParameterError: a value is not positive and finite, or the acceleration bound does not allow the
            approach: unless gain * rate <= acc, a parameter could overshoot its command.
    """

    gain: float = 20.0
    crank_rate: float = 20.0
    crank_acc: float = 400.0
    swing_rate: float = 6.0
    swing_acc: float = 120.0

    def __post_init__(self) -> None:
        for name in ("gain", "crank_rate", "crank_acc", "swing_rate", "swing_acc"):
            check_number(f"filters.{name}", getattr(self, name), low=0, exclusive_low=True)
        for part in ("crank", "swing"):
            rate = getattr(self, f"{part}_rate")
            acc = getattr(self, f"{part}_acc")
            # 1e-12: `sped_up` rounds each of the three by itself
            if self.gain * rate > acc * (1 + 1e-12):
                raise ParameterError(
                    f"filters: expected gain * {part}_rate <= {part}_acc so that a command is not overshot, "
                    f"got {self.gain:g} * {rate:g} > {acc:g}"
                )

    def sped_up(self, speed_scale: float) -> FilterSettings:
        """Return the filters of a motion that is `speed_scale` times as fast [-]."""
        return FilterSettings(
            gain=self.gain * speed_scale,
            crank_rate=self.crank_rate * speed_scale**2,
            crank_acc=self.crank_acc * speed_scale**3,
            swing_rate=self.swing_rate * speed_scale,
            swing_acc=self.swing_acc * speed_scale**2,
        )

    @property
    def longest_step(self) -> float:
        """Longest time step [s] at which the filters respect their bounds and do not overshoot."""
        return 1.0 / (INNER * self.gain)

    def to_array(self) -> NDArray[np.float64]:
        """Return rows (gain, rate bound, acceleration bound) for the four filters, shape (4, 3)."""
        crank = (self.gain, self.crank_rate, self.crank_acc)
        swing = (self.gain, self.swing_rate, self.swing_acc)
        return np.array([crank, swing, swing, swing])


QUICK = FilterSettings(gain=100.0, crank_rate=100.0, crank_acc=1e4, swing_rate=15.0, swing_acc=1500.0)
"""Filters that let the crank follow a level stance: it slows down and speeds up within every stride."""


def command_filters(
    filters: Sequence[Filter], command: Sequence[float], settings: Sequence[Sequence[float]]
) -> None:
    """Set each filter's acceleration: bounded, towards a bounded rate, towards the command.

    `settings` are rows of `FilterSettings.to_array`.
    """
    for one, wanted, (gain, rate_bound, acc_bound) in zip(filters, command, settings, strict=True):
        # a cascade: the outer loop sets a rate, the inner loop, `INNER` times as fast, follows it
        wanted_rate = _clip(gain * (wanted - one.value), rate_bound)
        one.acc = _clip(INNER * gain * (wanted_rate - one.rate), acc_bound)


def _clip(x: float, bound: float) -> float:
    return min(max(x, -bound), bound)


def advance_motion(motion: Motion, filters: Sequence[Filter], h: float) -> None:
    """Advance filters and crank angle by `h` [s], exactly for constant filter accelerations."""
    # before the filters: the angle is the integral of the speed from the step's start
    speed = filters[SPEED]
    motion.theta += h * (speed.value + h * (speed.rate / 2.0 + h * speed.acc / 6.0))
    for one in filters:
        one.value += h * (one.rate + h * one.acc / 2.0)
        one.rate += h * one.acc


def evaluate_motion(motion: Motion, filters: Sequence[Filter]) -> None:
    """Fill rates and accelerations of crank and swing from crank angle and filters.

    phi = phi0 + A sin(theta) + B cos(theta), differentiated twice with phi0, A, B and theta all moving.
    """
    s = math.sin(motion.theta)
    c = math.cos(motion.theta)
    speed, offset, a, b = filters
    w = speed.value
    w_rate = speed.rate
    motion.theta_rate = w
    motion.theta_acc = w_rate
    # (E1), as in `mechanics.place_frame`, but with the crank's acceleration
    motion.phi = offset.value + a.value * s + b.value * c
    slope = a.value * c - b.value * s
    motion.phi_rate = offset.rate + a.rate * s + b.rate * c + slope * w
    motion.phi_acc = (
        offset.acc
        + a.acc * s
        + b.acc * c
        + 2.0 * (a.rate * c - b.rate * s) * w
        + slope * w_rate
        - (a.value * s + b.value * c) * w * w
    )


def steady_filters(parameters: Iterable[float]) -> list[Filter]:
    """Return filters at rest at four parameters."""
    return [Filter(float(value)) for value in parameters]

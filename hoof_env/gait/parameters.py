"""Gait parameters: what a policy may ask of the leg, with units, limits and the paper's presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.leg.geometry import DEFAULT_PRESET, Preset, named, read_preset, wrong

Gait = TypeVar("Gait")

LIMITS = MappingProxyType(
    {
        "crank_speed": (0.0, 4 * np.pi),
        "swing_offset": (0.0, 1.4),
        "swing_sin": (-0.8, 0.4),
        "swing_cos": (-0.8, 0.2),
    }
)
"""Lowest and highest value of each gait parameter [rad/s, rad, rad, rad]. Both gaits of the paper lie inside,
and the middle of all four moves the identified leg forward at the paper's crank speed, 2 pi."""


@dataclass(frozen=True)
class GaitParameters:
    """One steady gait: the crank turns at `crank_speed` and the leg's frame swings about the crank centre by

        phi = swing_offset + swing_sin * sin(theta) + swing_cos * cos(theta),   theta the crank angle.

    The paper says that running 'controls the leg orientation by swinging motion with respect to the body' and
    does not print the law; one harmonic is this project's assumption.

    Attributes:
        crank_speed: theta's rate [rad/s], 0 to 4 pi.
        swing_offset: phi0 [rad], 0 to 1.4.
        swing_sin: A [rad], -0.8 to 0.4.
        swing_cos: B [rad], -0.8 to 0.2.

    Raises:
        ParameterError: a value is not finite or outside `LIMITS`.
    """

    crank_speed: float
    swing_offset: float
    swing_sin: float
    swing_cos: float

    def __post_init__(self) -> None:
        for item in fields(self):
            low, high = LIMITS[item.name]
            object.__setattr__(
                self, item.name, check_number(item.name, getattr(self, item.name), low=low, high=high)
            )

    def to_array(self) -> NDArray[np.float64]:
        """The four values in the order of the fields, shape (4,)."""
        return np.array([getattr(self, item.name) for item in fields(self)])

    @classmethod
    def from_array(cls, values: Any) -> GaitParameters:
        """Inverse of `to_array`."""
        array = np.asarray(values, dtype=np.float64)
        if array.shape != (4,):
            raise ParameterError(f"gait parameters: expected 4 values {PARAMETERS}, got shape {array.shape}")
        return cls(*array.tolist())


PARAMETERS = tuple(item.name for item in fields(GaitParameters))
"""Names of the gait parameters, in the order used by actions and filters."""


def gait_names(preset: Preset = DEFAULT_PRESET) -> list[str]:
    """Names of the gaits in a preset: the paper's walk and run, and what was found for that leg beside them.

    Raises:
        ParameterError: unknown preset name, or content that lacks the part.
        DataFileError: a file lacks it.
    """
    return sorted(_read_gaits(preset))


def load_gait(name: str, preset: Preset = DEFAULT_PRESET) -> GaitParameters:
    """A gait of a preset by name, of a file by path, or of such a file's content.

    Raises:
        ParameterError: unknown preset or gait name, a value outside its limits, or content that lacks a part.
        DataFileError: a file lacks it.
    """
    gaits = _read_gaits(preset)
    check_choice("gait", name, gaits)
    try:
        return GaitParameters(**gaits[name])
    except TypeError as error:
        raise wrong(preset)(
            f"{named(preset)}, gait {name!r}: expected {', '.join(PARAMETERS)}: {error}"
        ) from None


def paper_gaits(gaits: Mapping[str, Gait]) -> dict[str, Gait]:
    """The paper's own gaits among those of a preset, by name and in alphabetic order; all, if it has neither.

    What an environment draws or derives from the gaits of a preset must not change when one is added.
    """
    names = sorted(set(gaits) & {"walk", "run"} or gaits)
    return {name: gaits[name] for name in names}


def _read_gaits(preset: Preset) -> dict[str, Any]:
    gaits = read_preset(preset).get("gaits")
    if not isinstance(gaits, Mapping) or not gaits:
        raise wrong(preset)(
            f"{named(preset)}: expected an object 'gaits' with at least one gait, got {gaits!r}"
        )
    if not all(isinstance(name, str) for name in gaits):
        raise wrong(preset)(f"{named(preset)}: gaits: expected names that are texts, got {[*gaits]!r}")
    return dict(gaits)

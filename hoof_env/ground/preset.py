"""The ground that a leg was identified on: the section "ground" of a preset file, which may be left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import DEFAULT_PRESET, Preset, named, read_preset, wrong

HERTZ = 1.5
"""Exponent n of Hertz's contact and of Lankarani and Nikravesh's law [-]."""

SETTINGS = ("stiffness", "exponent")
"""What the section may give: K [N/m^n] and n [-] of Eq. 14. The paper prints a lower limit of one and nothing
of the other."""


def load_ground(preset: Preset = DEFAULT_PRESET, **overrides: Any) -> Ground:
    """The ground of a preset by name, of a file by path, or of such a file's content.

    Args:
        preset: whose ground; what its file does not say is as in `Ground`.
        overrides: attributes of `Ground` that replace the preset's; None keeps them.

    Raises:
        ParameterError: unknown preset name, an override out of range, or content that is wrong as below.
        DataFileError: the file is unreadable, or its ground has unknown entries or bad values.
    """
    try:
        ground = read_ground(read_preset(preset), named(preset))
    except DataFileError as error:
        raise wrong(preset)(error) from None
    return replace(ground, **{name: value for name, value in overrides.items() if value is not None})


def read_ground(data: Mapping[str, Any], source: str) -> Ground:
    """The ground in the content of a file; `source` is how an error names the file.

    Raises:
        DataFileError: unknown entries or bad values.
    """
    section = data.get("ground", {})
    if not isinstance(section, Mapping) or set(section) - set(SETTINGS):
        raise DataFileError(
            f"{source}: ground: expected an object with no other entries than {', '.join(SETTINGS)}, "
            f"got {section!r}"
        )
    try:
        return Ground(**section)
    except ParameterError as error:
        raise DataFileError(f"{source}: ground: {error}") from None


def write_ground(ground: Ground) -> dict[str, float]:
    """The section of a file that `read_ground` reads."""
    return {name: getattr(ground, name) for name in SETTINGS}

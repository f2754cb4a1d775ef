"""Files of legs: presets of this package by name, and files of the same form.

Presets are JSON files with a provenance line. The default one is *identified* from the paper's results,
because the paper prints no lengths.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from hoof_env._input import read_text
from hoof_env.errors import DataFileError, ParameterError, brief, check_choice

DEFAULT_PRESET = "identified"
"""The leg of the paper's reproduction."""

Preset = str | Path | Mapping[str, Any]
"""Preset of a leg: its name, the path of a file, or the content of such a file."""

PARTS = ("provenance", "units", "geometry", "ground", "gaits", "gait_provenance")
"""Parts of a preset; docs/own_task.md describes each."""


def preset_names() -> list[str]:
    """Return the names accepted by `load_geometry`."""
    return list(_shipped())


@cache
def _shipped() -> tuple[str, ...]:
    """List the presets of this package, once, in alphabetical order."""
    files = resources.files("hoof_env").joinpath("data").iterdir()
    return tuple(sorted(f.name.removesuffix(".json") for f in files if f.name.endswith(".json")))


@cache
def _shipped_text(name: str) -> str:
    """Read a preset of this package, once."""
    return resources.files("hoof_env").joinpath("data", f"{name}.json").read_text(encoding="utf-8")


def presets_of_paper() -> list[str]:
    """Return the names of the presets with the paper's mechanism, read without solving their legs."""
    return [name for name in preset_names() if "mechanism" not in read_preset(name)["geometry"]]


def preset_label(preset: Preset) -> str:
    """Return the name that error messages give a preset."""
    return "preset" if isinstance(preset, Mapping) else f"preset {preset}"


def preset_error_type(preset: Preset) -> type[ParameterError] | type[DataFileError]:
    """Return the type of an error in a preset: of an argument, or of a file."""
    return ParameterError if isinstance(preset, Mapping) else DataFileError


def read_preset(source: Preset) -> dict[str, Any]:
    """Return the content of a preset by name, or of a file by path (ends in .json); content comes back as it
    is."""
    data = source if isinstance(source, Mapping) else _read_file(source)
    if unknown := sorted(str(name) for name in data if name not in PARTS):
        said = f"unknown entries {', '.join(unknown)}; expected some of {', '.join(PARTS)}"
        raise preset_error_type(source)(f"{preset_label(source)}: {said}")
    return dict(data)


def _read_file(source: str | Path) -> dict[str, Any]:
    """Return the content of a preset by name or path."""
    if not isinstance(source, (str, Path)):
        raise ParameterError(
            f"preset: expected one of {', '.join(_shipped())}, a file that ends in .json, as"
            f" Geometry.save writes it with gaits, or the content of one, got {brief(source)}"
        )
    is_path = isinstance(source, Path) or str(source).endswith(".json")
    label = Path(source) if is_path else check_choice("preset", source, _shipped())
    try:
        data = json.loads(read_text(Path(source)) if is_path else _shipped_text(str(label)))
    except OSError as error:
        raise DataFileError(f"cannot read {label}: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise DataFileError(f"{label}: expected a JSON preset file, but it does not parse: {error}") from None
    if not isinstance(data, dict):
        got = type(data).__name__
        raise DataFileError(f"{label}: expected a JSON object with 'geometry' and 'gaits', got {got}")
    return data

"""Files of legs: presets of this package, by name, and others of the same form."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, ParameterError, check_choice

DEFAULT_PRESET = "identified"
"""The leg of the paper's reproduction."""

Preset = str | Path | Mapping[str, Any]
"""Preset of a leg: its name, the path of a file, or the content of such a file."""

PARTS = ("provenance", "units", "geometry", "ground", "gaits", "gait_provenance")
"""Parts of a preset; docs/own_task.md describes each."""


def preset_names() -> list[str]:
    """Names accepted by `load_geometry`."""
    return sorted(_shipped())


@cache
def _shipped() -> dict[str, str]:
    """Return the texts of the presets of this package by name."""
    files = resources.files("hoof_env").joinpath("data").iterdir()
    texts = (file for file in files if file.name.endswith(".json"))
    return {file.name.removesuffix(".json"): file.read_text(encoding="utf-8") for file in texts}


def presets_of_paper() -> list[str]:
    """Return the names of the presets with the paper's mechanism, read without solving their legs."""
    return [name for name in preset_names() if "mechanism" not in read_preset(name)["geometry"]]


def preset_label(preset: Preset) -> str:
    """Return the name of a preset in an error."""
    return "preset" if isinstance(preset, Mapping) else f"preset {preset}"


def preset_error_type(preset: Preset) -> type[ParameterError] | type[DataFileError]:
    """Return the type of an error in a preset: of an argument, or of a file."""
    return ParameterError if isinstance(preset, Mapping) else DataFileError


def read_preset(source: Preset) -> dict[str, Any]:
    """The content of a preset by name, or of a file by path (ends in .json); content comes back as it is."""
    data = source if isinstance(source, Mapping) else _read_file(source)
    if unknown := sorted(str(name) for name in data if name not in PARTS):
        said = f"unknown entries {', '.join(unknown)}; expected some of {', '.join(PARTS)}"
        raise preset_error_type(source)(f"{preset_label(source)}: {said}")
    return dict(data)


def _read_file(source: str | Path) -> dict[str, Any]:
    if not isinstance(source, Path) and not str(source).endswith(".json"):
        shipped: dict[str, Any] = json.loads(_shipped()[check_choice("preset", source, preset_names())])
        return shipped
    path = Path(source)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise DataFileError(f"{path}: expected a JSON preset file, but it does not parse: {error}") from None
    if not isinstance(data, dict):
        got = type(data).__name__
        raise DataFileError(f"{path}: expected a JSON object with 'geometry' and 'gaits', got {got}")
    return data

"""What the paper prints: numbers with units and bars for their reproduction, and claims about shape."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, ParameterError

CONDITIONS = {"elastic": 1.0, "inelastic": 0.0}
"""Coefficient of restitution cr of each condition of the paper [-]."""

_BAR = re.compile(r"(\d+(?:\.\d+)?)(?: (s|deg|%|point))?")
_BAR_OF_UNIT = {"s": ("s",), "deg": ("deg",), "N": ("%",), "%": ("point",), "-": ("",)}


@dataclass(frozen=True)
class Bar:
    """How far a simulated value may lie from the published one.

    Attributes:
        limit: largest error accepted, or None where the error is only reported.
        measure: "s", "deg", "%" (relative to the published value), "point" (difference of two percentages) or
            "" (plain difference).
    """

    limit: float | None
    measure: str

    def error(self, simulated: float, published: float) -> float:
        """Signed error in the bar's own measure."""
        difference = simulated - published
        return 100 * difference / published if self.measure == "%" else difference

    def holds(self, error: float | None) -> bool | None:
        """Whether an error is within the bar: None if it is only reported, False if there is no value."""
        if self.limit is None:
            return None
        return error is not None and abs(error) <= self.limit


def parse_bar(text: str, unit: str) -> Bar:
    """Read the bar of a row in a unit: "0.005 s", "1 deg", "2 %", "1 point", "0.01" or "reported".

    Raises:
        ParameterError: another form, or a measure that does not fit the unit.
    """
    allowed = _BAR_OF_UNIT.get(unit)
    if allowed is None:
        raise ParameterError(f"unit: expected one of {', '.join(_BAR_OF_UNIT)}, got {unit!r}")
    if text == "reported":
        return Bar(None, allowed[0])
    match = _BAR.fullmatch(text) if isinstance(text, str) else None
    if match is None or (match[2] or "") not in allowed:
        form = f"0.5 {allowed[0]}".strip()
        raise ParameterError(
            f"bar: expected 'reported' or a number like {form!r} for unit {unit!r}, got {text!r}"
        )
    return Bar(float(match[1]), match[2] or "")


@dataclass(frozen=True)
class PublishedRow:
    """One number of the paper.

    Attributes:
        id: "gait.quantity".
        gait: "walk", "run" or "both".
        quantity, unit: what it is, and in which unit it is printed.
        printed: the number in print.
        value: the number as read; the two differ where the print is a slip.
        bar: margin of its reproduction, and `bar_text` as written.
        condition: "elastic", "inelastic" or None where the contact law does not matter.
        reading: which of several readings is taken, or "".
    """

    id: str
    gait: str
    quantity: str
    unit: str
    printed: float
    value: float
    bar: Bar
    bar_text: str
    condition: str | None
    reading: str


@dataclass(frozen=True)
class Claim:
    """One claim about shape: `id`, the `claim` in words and the `reading` of it, or ""."""

    id: str
    claim: str
    reading: str


@dataclass(frozen=True)
class Published:
    """The paper's numbers, its claims and its simulation parameters (see the file for their units)."""

    source: str
    parameters: dict[str, Any]
    rows: tuple[PublishedRow, ...]
    claims: tuple[Claim, ...]

    def row(self, row_id: str) -> PublishedRow:
        """The row of this id (KeyError if there is none)."""
        return {row.id: row for row in self.rows}[row_id]


def load_published(path: Path | None = None) -> Published:
    """Read the published numbers, by default those of this package; `DataFileError` if they are not whole."""
    file: Any = path or resources.files("hoof_env.paper").joinpath("published.json")
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        published = Published(
            data["source"],
            data["parameters"],
            tuple(read_row(entry) for entry in data["rows"]),
            tuple(Claim(entry["id"], entry["claim"], entry.get("reading", "")) for entry in data["shapes"]),
        )
    except OSError as error:
        raise DataFileError(f"cannot read {file}: {error.strerror or error}") from None
    except ParameterError as error:
        raise DataFileError(f"{file}: {error}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise DataFileError(f"{file}: expected source, parameters, rows and shapes: {error!r}") from None
    ids = [row.id for row in published.rows] + [claim.id for claim in published.claims]
    if len(ids) != len(set(ids)):
        raise DataFileError(
            f"{file}: expected every id once, got {', '.join(sorted({i for i in ids if ids.count(i) > 1}))}"
        )
    return published


def read_row(entry: dict[str, Any]) -> PublishedRow:
    """A row from its JSON object; `ParameterError` for a bar or condition that is none."""
    condition = entry.get("condition")
    if condition not in (None, *CONDITIONS):
        raise ParameterError(f"condition: expected one of {', '.join(CONDITIONS)} or none, got {condition!r}")
    return PublishedRow(
        id=entry["id"],
        gait=entry["gait"],
        quantity=entry["quantity"],
        unit=entry["unit"],
        printed=float(entry["published"]),
        value=float(entry.get("read_as", entry["published"])),
        bar=parse_bar(entry["bar"], entry["unit"]),
        bar_text=entry["bar"],
        condition=condition,
        reading=entry.get("reading", ""),
    )

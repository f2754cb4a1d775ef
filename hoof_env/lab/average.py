"""The mean stance of several trials: `hoof-env average`.

Each whole stance, from the first to the last sample above the threshold, is interpolated linearly to points
that are evenly spaced in its duration. Mean and standard deviation (of a sample, over n - 1) are those of all
stances of a limb; every stance counts the same, of whichever trial it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import markdown_table, staged
from hoof_env.errors import DataFileError, ParameterError, check_choice, check_number, count
from hoof_env.lab.compare import ONE_PERCENT, why_none
from hoof_env.lab.doubts import for_one
from hoof_env.lab.forces import THRESHOLD
from hoof_env.lab.read import ForceRecord
from hoof_env.lab.stances import whole_stances

Floats = NDArray[np.float64]

POINTS = 101
"""Of a stance, from 0 to 100 %."""


@dataclass(frozen=True)
class MeanStance:
    """Of a limb.

    Attributes:
        trials, stances: how many records have one, and how many there are in all.
        mean, sd: of the forces forward and upward, shape (points, 2); sd is not a number for one stance, and
            the forward force where a record has none.
        contact: how long each stance lasts, shape (stances,) [s].
    """

    trials: int
    stances: int
    mean: Floats
    sd: Floats
    contact: Floats


@dataclass(frozen=True)
class Average:
    """What `average` finds.

    Attributes:
        unit: of all forces, "N" or "BW".
        limbs: by limb, in the order of the records.
        warnings: limbs that a record lacks, and what is doubtful about the records.
    """

    unit: str
    limbs: dict[str, MeanStance]
    warnings: list[str]


def average(
    records: Sequence[ForceRecord], threshold: float | None = None, units: str = "auto", points: int = POINTS
) -> Average:
    """The mean stance of each limb over records.

    Args:
        records: trials; limbs of the same name belong together.
        threshold: vertical force that makes a stance [N]; None is `THRESHOLD`, or 1 % of the weight where
            forces are in body weights of a weight that is not known.
        units: "N" or "BW"; "auto" is N where all records can be in N, else BW.
        points: of a stance.

    Raises:
        ParameterError: an argument is wrong, or the records have no unit in common.
        DataFileError: no record has a whole stance.
    """
    check_choice("units", units, ("auto", "N", "BW"))
    count("points", points, 2)
    if not records:
        raise ParameterError("records: expected one file or more, got none")
    unit = _common_unit(records, units)
    found: dict[str, list[list[Floats]]] = {}
    contact: dict[str, list[float]] = {}
    reasons = {}
    for record in records:
        level = _level(record, threshold, unit)
        for limb, forces in record.limbs.items():
            force = forces * (record.per(unit) or 1.0)
            spans = whole_stances(force[:, 1], level, record.rate)
            found.setdefault(limb, []).append([_normalised(force[i:j], points) for i, j in spans])
            contact.setdefault(limb, []).extend((j - i) / record.rate for i, j in spans)
            if not spans:
                why = why_none([force[:, 1]], record.time, level, unit)
                reasons[record.name, limb] = f"{record.name}: {limb}: expected a whole stance {why}"
    if not any(contact.values()):
        raise DataFileError("; ".join(reasons.values()))
    warnings = [f"{record.name}: {for_one(note, '')}" for record in records for note in record.notes]
    warnings += [
        f"{record.name}: has no {limb}"
        for limb in found for record in records if limb not in record.limbs
    ]  # fmt: skip
    warnings += reasons.values()
    limbs = {}
    for limb, trials in found.items():
        curves = [curve for trial in trials for curve in trial]
        if not curves:
            continue
        together = np.array(curves)
        sd = together.std(axis=0, ddof=1) if len(curves) > 1 else np.full(together.shape[1:], np.nan)
        if len(curves) == 1:
            warnings.append(f"{limb}: one stance has no standard deviation")
        limbs[limb] = MeanStance(
            sum(map(bool, trials)), len(curves), together.mean(axis=0), sd, np.array(contact[limb])
        )
    return Average(unit, limbs, warnings)


def _common_unit(records: Sequence[ForceRecord], units: str) -> str:
    for unit in ("N", "BW") if units == "auto" else (units,):
        if all(record.per(unit) for record in records):
            return unit
    wanted = "N" if units == "auto" else units
    lacking = next(record for record in records if not record.per(wanted))
    raise ParameterError(
        f"mass: expected the mass [kg] of the animal of {lacking.name}, to have {lacking.unit} in {wanted}"
    )


def _level(record: ForceRecord, threshold: float | None, unit: str) -> float:
    """The vertical force that makes a stance, in `unit`."""
    newtons = THRESHOLD if threshold is None else check_number("threshold", threshold, low=0.0, high=1e6)
    if unit == "N":
        return newtons
    if record.weight:
        return newtons / record.weight
    if threshold is None:
        return ONE_PERCENT
    raise ParameterError(
        f"mass: expected the mass [kg] of the animal of {record.name}, to know {newtons:g} N in body "
        "weights, or no threshold"
    )


def _normalised(force: Floats, points: int) -> Floats:
    """A stance at evenly spaced points of its duration, shape (points, 2)."""
    own = np.arange(len(force))
    at = np.linspace(0.0, len(force) - 1.0, points)
    return np.column_stack([np.interp(at, own, column) for column in force.T])


def write_table(found: Average, path: Path) -> Path:
    """Write a CSV table, a row a point: `stance [%]`, and of each limb the mean and the standard deviation of
    the forces, as `left_force_y_mean [N]` and `left_force_y_sd [N]`, and how many stances it has. Errors are
    those of `check_table`."""
    check_table(path)
    rows = len(next(iter(found.limbs.values())).mean)
    columns: dict[str, Floats] = {"stance [%]": np.linspace(0.0, 100.0, rows)}
    for limb, stance in found.limbs.items():
        for k, axis in enumerate("xy"):
            if np.isfinite(stance.mean[:, k]).all():
                columns[f"{limb}_force_{axis}_mean [{found.unit}]"] = stance.mean[:, k]
                columns[f"{limb}_force_{axis}_sd [{found.unit}]"] = stance.sd[:, k]
        columns[f"{limb}_stances"] = np.full(rows, float(stance.stances))
    with staged(path.parent) as stage:
        np.savetxt(
            stage / path.name, np.column_stack([*columns.values()]), "%.10g", delimiter=",",
            header=",".join(columns), comments="", encoding="utf-8",
        )  # fmt: skip
    return path


def check_table(path: Path) -> None:
    """Raise `ParameterError` unless a table can be written at `path` by its suffix."""
    if path.suffix.lower() != ".csv":
        raise ParameterError(f"out: expected a file that ends in .csv, got {str(path)!r}")


def report(found: Average) -> str:
    """A table of how many stances there are, how long they last and how high they peak; and the warnings."""
    places = 1 if found.unit == "N" else 4
    head = ("limb", "trials", "stances", "contact [ms]", f"highest mean of force_y [{found.unit}]", "at [%]")
    rows = []
    for limb, stance in found.limbs.items():
        spread = 1e3 * stance.contact.std(ddof=1) if stance.stances > 1 else np.nan
        k = int(stance.mean[:, 1].argmax())
        rows.append([
            limb, str(stance.trials), str(stance.stances),
            f"{1e3 * stance.contact.mean():.0f} ± {spread:.0f}",
            f"{stance.mean[k, 1]:.{places}f} ± {stance.sd[k, 1]:.{places}f}",
            f"{100 * k / (len(stance.mean) - 1):.0f}",
        ])  # fmt: skip
    table = markdown_table(head, rows).replace("± nan", "± -")
    return "\n".join([table, *(f"warning: {text}" for text in found.warnings)])

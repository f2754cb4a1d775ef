"""Mean stance of several trials: `hoof-env average`.

Each whole stance, from the first to the last sample above the threshold, is interpolated linearly to points
that are evenly spaced in its duration. Mean and standard deviation (of a sample, over n - 1) are those of all
stances of a limb; every stance has the same weight, whatever its trial.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env._input import as_path
from hoof_env._output import markdown_table, staged
from hoof_env.errors import DataFileError, ParameterError, brief, check_choice, check_number, count
from hoof_env.lab.axis_checks import for_one
from hoof_env.lab.compare import RELATIVE_THRESHOLD, why_none
from hoof_env.lab.forces import THRESHOLD
from hoof_env.lab.read import ForceRecord
from hoof_env.lab.stances import whole_stances

Floats = NDArray[np.float64]

POINTS = 101
"""Number of points of a stance, from 0 to 100 % of its duration."""

MOST_POINTS = 100_000
"""Largest number of points of a mean stance."""


@dataclass(frozen=True)
class MeanStance:
    """Mean stance of a limb.

    Attributes:
        trials: number of records that have a whole stance of the limb.
        stances: number of stances in all records.
        mean, sd: mean and standard deviation of the forces forward and upward, shape (points, 2); `sd` is NaN
            for one stance, and the forward force is NaN if a record has none.
        contact: duration of each stance, shape (stances,) [s].
    """

    trials: int
    stances: int
    mean: Floats
    sd: Floats
    contact: Floats


@dataclass(frozen=True)
class Average:
    """Result of `average`.

    Attributes:
        unit: unit of all forces, "N" or "BW".
        limbs: mean stances by limb, in the order of the records.
        warnings: limbs that a record lacks, and warnings about the records.
    """

    unit: str
    limbs: dict[str, MeanStance]
    warnings: list[str]


def average(
    records: Sequence[ForceRecord], threshold: float | None = None, units: str = "auto", points: int = POINTS
) -> Average:
    """Compute the mean stance of each limb over records.

    Args:
        records: trials; limbs of the same name belong together.
        threshold: vertical force that makes a stance [N]; None is `THRESHOLD`, or 1 % of the weight if forces
            are in body weights and the weight is unknown.
        units: "N" or "BW"; "auto" is N if all records can be in N, else BW.
        points: number of points of a stance.

    Raises:
        ParameterError: an argument is wrong, or the records have no unit in common.
        DataFileError: no record has a whole stance.
    """
    check_choice("units", units, ("auto", "N", "BW"))
    count("points", points, 2, MOST_POINTS)
    if not records:
        raise ParameterError("records: expected one file or more, got none")
    for record in records:
        if not isinstance(record, ForceRecord):
            raise ParameterError(f"records: expected what read_record returns, got {brief(record)}")
    unit = _common_unit(records, units)
    # By limb, a list of curves for each record that has the limb.
    curves_by_trial: dict[str, list[list[Floats]]] = {}
    contact: dict[str, list[float]] = {}
    reasons = {}
    for record in records:
        level = _level(record, threshold, unit)
        for limb, forces in record.limbs.items():
            force = forces * (record.per(unit) or 1.0)  # not None: `_common_unit` has checked it
            spans = whole_stances(force[:, 1], level, record.rate)
            curves = [_normalised(force[i:j], points) for i, j in spans]
            curves_by_trial.setdefault(limb, []).append(curves)
            contact.setdefault(limb, []).extend((j - i) / record.rate for i, j in spans)
            if not spans:
                why = why_none([force[:, 1]], record.time, level, unit)
                reasons[record.name, limb] = f"{record.name}: {limb}: expected a whole stance {why}"
    if not any(contact.values()):
        raise DataFileError("; ".join(reasons.values()))
    warnings = [f"{record.name}: {for_one(note, '')}" for record in records for note in record.notes]
    for limb in curves_by_trial:
        warnings += [f"{record.name}: has no {limb}" for record in records if limb not in record.limbs]
    warnings += reasons.values()
    limbs = {}
    for limb, trials in curves_by_trial.items():
        curves = [curve for trial in trials for curve in trial]
        if not curves:
            continue
        stacked = np.array(curves)
        if len(curves) > 1:
            sd = stacked.std(axis=0, ddof=1)
        else:
            # NumPy would warn of a division by zero.
            sd = np.full(stacked.shape[1:], np.nan)
            warnings.append(f"{limb}: one stance has no standard deviation")
        with_stance = sum(map(bool, trials))
        limbs[limb] = MeanStance(with_stance, len(curves), stacked.mean(axis=0), sd, np.array(contact[limb]))
    return Average(unit, limbs, warnings)


def _common_unit(records: Sequence[ForceRecord], units: str) -> str:
    """Return the unit that all records can have, newtons first; raise `ParameterError` if there is none."""
    for unit in ("N", "BW") if units == "auto" else (units,):
        if all(record.per(unit) for record in records):
            return unit
    wanted = "N" if units == "auto" else units
    lacking = next(record for record in records if not record.per(wanted))
    raise ParameterError(
        f"mass: expected the mass [kg] of the animal of {lacking.name}, to have {lacking.unit} in {wanted}"
    )


def _level(record: ForceRecord, threshold: float | None, unit: str) -> float:
    """Return the vertical force that makes a stance of a record, in `unit`."""
    newtons = THRESHOLD if threshold is None else check_number("threshold", threshold, low=0.0, high=1e6)
    if unit == "N":
        return newtons
    if record.weight:
        return newtons / record.weight
    if threshold is None:
        return RELATIVE_THRESHOLD
    raise ParameterError(
        f"mass: expected the mass [kg] of the animal of {record.name}, to know {newtons:g} N in body "
        "weights, or no threshold"
    )


def _normalised(force: Floats, points: int) -> Floats:
    """Interpolate a stance of shape (n, 2) at evenly spaced points of its duration, shape (points, 2)."""
    samples = np.arange(len(force))
    at = np.linspace(0.0, len(force) - 1.0, points)
    return np.column_stack([np.interp(at, samples, column) for column in force.T])


def write_table(found: Average, path: Path | str) -> Path:
    """Write a CSV table with one row for each point.

    Its columns are `stance [%]` and, for each limb, mean and standard deviation of the forces, as
    `left_force_y_mean [N]` and `left_force_y_sd [N]`, and the number of stances. Errors are those of
    `check_table`.
    """
    path = as_path("path", path)
    check_table(path)
    rows = len(next(iter(found.limbs.values())).mean)
    columns: dict[str, Floats] = {"stance [%]": np.linspace(0.0, 100.0, rows)}
    for limb, stance in found.limbs.items():
        for k, axis in enumerate("xy"):
            # A record may have no forward force; a column of NaN would say nothing.
            if np.isfinite(stance.mean[:, k]).all():
                columns[f"{limb}_force_{axis}_mean [{found.unit}]"] = stance.mean[:, k]
                columns[f"{limb}_force_{axis}_sd [{found.unit}]"] = stance.sd[:, k]
        columns[f"{limb}_stances"] = np.full(rows, float(stance.stances))
    with staged(path.parent) as stage:
        table = np.column_stack([*columns.values()])
        header = ",".join(columns)
        np.savetxt(
            stage / path.name, table, "%.10g", delimiter=",", header=header, comments="", encoding="utf-8"
        )
    return path


def check_table(path: Path) -> None:
    """Raise `ParameterError` unless a table can be written at `path` by its suffix."""
    if path.suffix.lower() != ".csv":
        raise ParameterError(f"out: expected a file that ends in .csv, got {str(path)!r}")


def report(found: Average) -> str:
    """Return a table of the number of stances, their durations and the highest mean forces, and the warnings,
    as text."""
    places = 1 if found.unit == "N" else 4
    head = ("limb", "trials", "stances", "contact [ms]", f"highest mean of force_y [{found.unit}]", "at [%]")
    rows = []
    for limb, stance in found.limbs.items():
        spread = 1e3 * stance.contact.std(ddof=1) if stance.stances > 1 else np.nan
        k = int(stance.mean[:, 1].argmax())
        row = [
            limb,
            str(stance.trials),
            str(stance.stances),
            f"{1e3 * stance.contact.mean():.0f} ± {spread:.0f}",
            f"{stance.mean[k, 1]:.{places}f} ± {stance.sd[k, 1]:.{places}f}",
            f"{100 * k / (len(stance.mean) - 1):.0f}",
        ]
        rows.append(row)
    # The standard deviation of one stance is NaN, which a reader would take for an error.
    table = markdown_table(head, rows).replace("± nan", "± -")
    return "\n".join([table, *(f"warning: {text}" for text in found.warnings)])

"""Mean stance of several trials: `hoof-env average`.

Each whole stance, from the first to the last sample above the threshold, is interpolated linearly to points
that are evenly spaced in its duration. Mean and standard deviation (of a sample, over n - 1) are taken over
all stances of a limb; every stance has the same weight, whatever its trial.

Stances of odd length, the first of an episode, those that the ends of records cut off and a baseline that
drifts are counted and said; `drop` leaves stances out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env._input import as_path
from hoof_env._output import markdown_table, staged
from hoof_env.errors import DataFileError, ParameterError, brief, check_choice, check_number, count
from hoof_env.lab.axis_checks import for_one, of_model
from hoof_env.lab.compare import RELATIVE_THRESHOLD, why_none
from hoof_env.lab.doubts import ODD_SHARE, baseline, cut_spans, odd_stances
from hoof_env.lab.forces import THRESHOLD
from hoof_env.lab.read import ForceRecord
from hoof_env.lab.stances import whole_stances

Floats = NDArray[np.float64]

POINTS = 101
"""Number of points of a stance, from 0 to 100 % of its duration."""

MAX_POINTS = 100_000
"""Largest number of points of a mean stance."""


MAX_SHOWN = 5
"""Largest number of stances or limbs that a message names."""

DROPPED = ("first", "odd")
"""Stances that may be left out: the first of each record, and stances of odd length."""


@dataclass(frozen=True)
class MeanStance:
    """Mean stance of a limb.

    Attributes:
        trials: number of records that have a whole stance of the limb.
        stances: number of stances in all records.
        mean, sd: mean and standard deviation of the forces forward and upward, shape (points, 2); `sd` is NaN
            for one stance, and the forward force is NaN if a record has none.
        contact: duration of each stance, shape (stances,) [s].
        dropped: number of whole stances that were left out on demand.
        cut: number of stances that the ends of records cut off, which are left out, too.
    """

    trials: int
    stances: int
    mean: Floats
    sd: Floats
    contact: Floats
    dropped: int = 0
    cut: int = 0


@dataclass(frozen=True)
class Average:
    """Result of `average`.

    Attributes:
        unit: unit of all forces, "N" or "BW".
        limbs: mean stances by limb, in the order of the records.
        warnings: limbs that a record lacks, doubtful stances, and warnings about the records.
        remarks: lines on braking and propulsion of exports of this package.
    """

    unit: str
    limbs: dict[str, MeanStance]
    warnings: list[str]
    remarks: list[str]


@dataclass
class _Stance:
    """Whole stance: number of its record, its start and duration [s], and its curve, shape (points, 2)."""

    trial: int
    start: float
    contact: float
    curve: Floats
    is_first: bool


def average(
    records: Sequence[ForceRecord],
    threshold: float | None = None,
    units: str = "auto",
    points: int = POINTS,
    drop: Collection[str] = (),
) -> Average:
    """Compute the mean stance of each limb over records.

    Args:
        records: trials; limbs of the same name belong together.
        threshold: vertical force that makes a stance [N]; None is `THRESHOLD`, or 1 % of the weight if forces
            are in body weights and the weight is unknown.
        units: "N" or "BW"; "auto" is N if all records can be in N, else BW.
        points: number of points of a stance.
        drop: stances that are left out, of `DROPPED`.

    Raises:
        ParameterError: an argument is wrong, or the records have no unit in common.
        DataFileError: no record has a whole stance.
    """
    check_choice("units", units, ("auto", "N", "BW"))
    count("points", points, 2, MAX_POINTS)
    for name in drop:
        check_choice("drop", name, DROPPED)
    if not records:
        raise ParameterError("records: expected one file or more, got none")
    for record in records:
        if not isinstance(record, ForceRecord):
            raise ParameterError(f"records: expected what read_record returns, got {brief(record)}")
    unit = _common_unit(records, units)
    found: dict[str, list[_Stance]] = {}
    cut: Counter[str] = Counter()
    reasons = []
    doubts = []
    for trial, record in enumerate(records):
        level = _level(record, threshold, unit)
        for limb, forces in record.limbs.items():
            force = forces * (record.per(unit) or 1.0)  # not None: `_common_unit` has checked it
            vertical = force[:, 1]
            spans = whole_stances(vertical, level, record.rate)
            cut[limb] += len(cut_spans(vertical, level, record.rate))
            for k, (i, j) in enumerate(spans):
                curve = _normalised(force[i:j], points)
                stance = _Stance(trial, float(record.time[i]), (j - i) / record.rate, curve, k == 0)
                found.setdefault(limb, []).append(stance)
            found.setdefault(limb, [])
            doubts += [
                f"{record.name}: {limb}: {text}"
                for text in baseline(vertical, spans, level, record.time, unit)
            ]
            if not spans:
                why = why_none([vertical], record.time, level, unit)
                reasons.append(f"{record.name}: {limb}: expected a whole stance {why}")
    if not any(found.values()):
        more = f"; and {len(reasons) - MAX_SHOWN} more" if len(reasons) > MAX_SHOWN else ""
        raise DataFileError("; ".join(reasons[:MAX_SHOWN]) + more)
    warnings = [f"{record.name}: {for_one(note, '')}" for record in records for note in record.notes]
    for limb in found:
        warnings += [f"{record.name}: has no {limb}" for record in records if limb not in record.limbs]
    warnings += reasons + doubts
    limbs = {}
    for limb, stances in found.items():
        kept, said = _kept(stances, records, drop)
        warnings += [f"{limb}: {text}" for text in said]
        if kept:
            limbs[limb] = _mean(kept, len(stances) - len(kept), cut[limb])
            if len(kept) == 1:
                warnings.append(f"{limb}: one stance has no standard deviation")
    if not limbs:
        names = ", ".join(record.name for record in records)
        raise DataFileError(f"drop: expected stances of {names} besides the dropped ones, found none")
    remarks = [
        f"{record.name}: {text}"
        for record in records
        if record.own
        for text in of_model(record.limbs, record.time)
    ]
    return Average(unit, limbs, warnings, remarks)


def _kept(
    stances: list[_Stance], records: Sequence[ForceRecord], drop: Collection[str]
) -> tuple[list[_Stance], list[str]]:
    """Return the stances of a limb that count, and messages about doubtful ones."""
    said = []
    kept = stances
    first = [one for one in stances if one.is_first and _is_episode(records[one.trial])]
    if first and "first" not in drop:
        said.append(
            f"{len(first)} of {len(stances)} stances are the first of an episode, which depends on its "
            "start; --drop first leaves them out"
        )
    if "first" in drop:
        kept = [stance for stance in stances if not stance.is_first]
    odd = odd_stances(np.array([stance.contact for stance in kept]))
    if odd.any():
        those = [stance for stance, is_odd in zip(kept, odd, strict=True) if is_odd]
        usual = float(np.median([stance.contact for stance in kept]))
        shown = ", ".join(
            f"{1e3 * one.contact:.0f} ms at {one.start:.4g} s of {records[one.trial].name}"
            for one in those[:MAX_SHOWN]
        )
        more = f" and {len(those) - MAX_SHOWN} more" if len(those) > MAX_SHOWN else ""
        fate = "are left out" if "odd" in drop else "are counted; --drop odd leaves them out"
        said.append(
            f"{len(those)} of {len(kept)} stances differ from the median duration, {1e3 * usual:.0f} ms, by "
            f"more than {100 * ODD_SHARE:.0f} % and {fate}: {shown}{more}"
        )
    if "odd" in drop:
        kept = [stance for stance, is_odd in zip(kept, odd, strict=True) if not is_odd]
    return kept, said


def _is_episode(record: ForceRecord) -> bool:
    """Return True if a record is an export of this package that begins with its episode."""
    return record.own and abs(float(record.time[0])) < 1 / record.rate


def _mean(stances: list[_Stance], dropped: int, cut: int) -> MeanStance:
    """Return the mean of stances of a limb."""
    stacked = np.array([stance.curve for stance in stances])
    # NumPy would warn of a division by zero.
    sd = stacked.std(axis=0, ddof=1) if len(stances) > 1 else np.full(stacked.shape[1:], np.nan)
    contact = np.array([stance.contact for stance in stances])
    trials = len({stance.trial for stance in stances})
    return MeanStance(trials, len(stances), stacked.mean(axis=0), sd, contact, dropped, cut)


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
    `left_force_y_mean [N]` and `left_force_y_sd [N]`, and the number of stances. Errors are as in
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
    """Return a table of the number of stances, their durations and the highest mean forces, the number of
    stances that are left out, and the warnings, as text."""
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
    lines = [table]
    for what in ("dropped", "cut"):
        counts = {limb: getattr(stance, what) for limb, stance in found.limbs.items()}
        if any(counts.values()):
            ends = " off by the ends of records" if what == "cut" else ""
            lines.append(f"\nStances {what}{ends}: {', '.join(f'{limb} {n}' for limb, n in counts.items())}.")
    lines += ["", *found.remarks] if found.remarks else []
    return "\n".join([*lines, *(f"warning: {text}" for text in found.warnings)])

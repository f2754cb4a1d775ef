"""Comparison of two force records, limb by limb: `hoof-env compare`.

Both are resampled by linear interpolation to the higher of both rates, so that neither loses a peak.
`lab.stances` defines a stance. Times in results and messages are as in the files.

There are three ways to align B with A:

- "none": the times of the files.
- "shift": one shift for all limbs. Candidates are the differences between touchdowns of A and of B under
  which the shorter record lies within the other, but for half a stride: no stride that both have is left
  out. The shift is the candidate under which the vertical forces of all limbs differ least (root mean square;
  of candidates within 10 % of the least difference, the shortest, as strides repeat), moved within two
  sampling intervals to the least difference. If strides vary, a shift that leaves some out is taken where the
  others agree three times as well as one stride with the next, as in records that began at different times.
- "stances": under that shift, stances of a limb with the nearest touchdowns, less than half a stride apart,
  make pairs, and each pair is laid touchdown on touchdown. If stride periods differ by more than 10 %, all
  stances of the record that has fewer are paired in order.

Stances without a partner are counted and said.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, ParameterError, brief, check_choice, check_number
from hoof_env.lab.doubts import baseline
from hoof_env.lab.forces import THRESHOLD
from hoof_env.lab.read import ForceRecord
from hoof_env.lab.stances import MIN_STANCE_SECONDS, Pair, Side, Spans, best_shift, pairs_of, whole_stances

Floats = NDArray[np.float64]

ALIGNMENTS = ("stances", "shift", "none")
"""Ways to align B with A, see above."""

RELATIVE_THRESHOLD = 0.01
"""Threshold of a stance in body weights, if the weight of the animal is unknown."""

MAX_TOUCHDOWN_SPREAD = 0.1
"""Largest spread of touchdowns without a warning, as a share of a stride."""

MAX_SAMPLES = 20_000_000
"""Largest number of samples of a record at the common rate, some hours of a force plate."""


@dataclass(frozen=True)
class Force:
    """Errors of B against A in one component of a limb's force, means over the pairs; an error is B less A.

    Attributes:
        rmse: root mean square difference over all pairs, from the earlier touchdown to the later lift-off
            [the records' unit].
        r: Pearson's correlation there; NaN if a force is constant.
        peak, peak_error: largest force of A, and its error [the records' unit].
        impulse, impulse_error: impulse of A, and its error [that unit times s].
    """

    rmse: float
    r: float
    peak: float
    peak_error: float
    impulse: float
    impulse_error: float


@dataclass(frozen=True)
class LimbErrors:
    """Errors of a limb of B against the limb of A, means over the pairs; an error is B less A.

    Attributes:
        pairs: number of pairs of stances.
        stances: number of whole stances in A and in B.
        forces: errors by component: "vertical", "fore-aft", and of the latter "braking" and "propulsion"
            alone, with positive peaks and impulses; "vertical" alone if a record has no fore-aft force.
        contact, contact_error: duration of a stance in A, and its error [s].
        touchdown_error: delay of touchdown in B after the shift [s].
        touchdown_spread: standard deviation of that delay over the pairs [s].
        peak_time_error: error of the time from touchdown to the vertical peak [s].
    """

    pairs: int
    stances: tuple[int, int]
    forces: dict[str, Force]
    contact: float
    contact_error: float
    touchdown_error: float
    touchdown_spread: float
    peak_time_error: float


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`.

    Attributes:
        a, b: the records.
        unit: unit of all forces, "N" or "BW".
        rate: rate to which both records are resampled [Hz].
        levels: vertical force of A and of B that makes a stance [unit].
        shift: time that is added to the times of B, by the clocks of both files [s].
        limbs: errors by limb, in the order of A.
        curves: pairs of stances by limb: time from A's touchdown, shape (n,) [s], and the forces of A and of
            B at that time, forward and upward, shape (n, 2).
        missing: limbs that are not compared, with the reason.
        warnings: warnings about the errors of limbs.
    """

    a: ForceRecord
    b: ForceRecord
    unit: str
    rate: float
    levels: tuple[float, float]
    shift: float
    limbs: dict[str, LimbErrors]
    curves: dict[str, list[tuple[Floats, Floats, Floats]]]
    missing: dict[str, str]
    warnings: list[str]


def compare(
    a: ForceRecord,
    b: ForceRecord,
    align: str = "stances",
    threshold: float | None = None,
    units: str = "auto",
) -> Comparison:
    """Compute the errors of B against A.

    Args:
        a, b: the records; limbs of the same name are compared, or the two limbs if both records have only
            one.
        align: one of `ALIGNMENTS`, see the module.
        threshold: vertical force that makes a stance [N]; None is `THRESHOLD`, or 1 % of the weight if forces
            are in body weights and the weight is unknown.
        units: "N" or "BW" for the errors; "auto" is N if both records can be in N, else BW.

    Raises:
        ParameterError: an argument is wrong, or the records have no limb or no unit in common, do not
            overlap, or would be too long at the common rate.
        DataFileError: a record has no whole stance of the limbs that are compared.
    """
    for name, record in (("a", a), ("b", b)):
        if not isinstance(record, ForceRecord):
            raise ParameterError(f"{name}: expected a record, as read_record returns it, got {brief(record)}")
    check_choice("align", align, ALIGNMENTS)
    check_choice("units", units, ("auto", "N", "BW"))
    unit, (by_a, by_b) = _common_unit(a, b, units)
    names = _common_limbs(a, b)
    levels = _levels(a, b, threshold, unit)
    rate = max(a.rate, b.rate)
    _check_length(a, b, rate)
    start = _start_of_b(a, b, rate, align)
    time_a, forces_a = _resampled(a, [of_a for of_a, _ in names], by_a, rate, float(a.time[0]))
    time_b, forces_b = _resampled(b, [of_b for _, of_b in names], by_b, rate, start)
    stances = [
        _stances(a, time_a, forces_a, levels[0], unit, rate),
        _stances(b, time_b, forces_b, levels[1], unit, rate),
    ]
    shift = 0.0
    if align != "none":
        # Touchdowns are known to a sampling interval of the slower record; two of them are searched.
        near = math.ceil(2 * rate / min(a.rate, b.rate))
        shift = float(time_a[0] - time_b[0]) + best_shift(forces_a, forces_b, stances, rate, near)
    limbs = {}
    curves = {}
    missing = _unshared(a, b, names)
    warnings = []
    for k, (name, _) in enumerate(names):
        sides = (
            Side(time_a, forces_a[k], stances[0][k]),
            Side(time_b + shift, forces_b[k], stances[1][k]),
        )
        pairs = pairs_of(*sides, rate, by_touchdown=align == "stances")
        if pairs:
            limbs[name] = _errors(pairs, sides, rate)
            curves[name] = [(pair.time, pair.a, pair.b) for pair in pairs]
            warnings += [f"{name}: {text}" for text in _warnings(sides, limbs[name], align)]
            for which, side, level, moved in zip("AB", sides, levels, (0.0, shift), strict=True):
                texts = baseline(side.force[:, 1], side.stances, level, side.time - moved, unit)
                warnings += [f"{name}: {which}: {text}" for text in texts]
        else:
            missing[name] = _why_missing(sides, levels, unit)
    if not limbs:
        raise _no_pairs(a, b, align)
    return Comparison(a, b, unit, rate, levels, shift, limbs, curves, missing, warnings)


def _no_pairs(a: ForceRecord, b: ForceRecord, align: str) -> ParameterError:
    """Return the error of records without a pair of stances."""
    return ParameterError(
        f"align: expected stances of a limb in {a.name} ({_span(a)}) and {b.name} ({_span(b)}) at the "
        f"same times, found none with align={align!r}"
    )


def _start_of_b(a: ForceRecord, b: ForceRecord, rate: float, align: str) -> float:
    """Return the time [s] of the first sample that B is resampled at; raise if the records do not overlap
    though their times are compared."""
    if align != "none":
        return float(b.time[0])
    if not max(a.time[0], b.time[0]) < min(a.time[-1], b.time[-1]):
        raise ParameterError(
            f"align: expected records that overlap, got {_span(a)} of {a.name} and {_span(b)} of {b.name}"
        )
    # B is resampled at the instants of A's samples, from the first of them within B on.
    first = float(a.time[0])
    return first + math.ceil((float(b.time[0]) - first) * rate - 1e-6) / rate


def _stances(
    record: ForceRecord, times: Floats, forces: list[Floats], level: float, unit: str, rate: float
) -> list[Spans]:
    """Find the whole stances of each limb of a resampled record; raise if none has one."""
    stances = [whole_stances(force[:, 1], level, rate) for force in forces]
    if not any(stances):
        why = why_none([force[:, 1] for force in forces], times, level, unit)
        raise DataFileError(f"record {record.name!r}: expected a whole stance {why}")
    return stances


def _levels(a: ForceRecord, b: ForceRecord, threshold: float | None, unit: str) -> tuple[float, float]:
    """Return the vertical force of A and of B that makes a stance, in `unit`, each by its own weight."""
    newtons = THRESHOLD if threshold is None else check_number("threshold", threshold, low=0.0, high=1e6)
    if unit == "N":
        return newtons, newtons
    if a.weight and b.weight:
        return newtons / a.weight, newtons / b.weight
    if threshold is None:
        return RELATIVE_THRESHOLD, RELATIVE_THRESHOLD
    lacking, record = ("b", b) if a.weight else ("a", a)
    raise ParameterError(
        f"mass-{lacking}: expected the mass [kg] of the animal of {record.name}, to know {newtons:g} N in "
        "body weights, or no threshold"
    )


def _check_length(a: ForceRecord, b: ForceRecord, rate: float) -> None:
    """Raise `ParameterError` if a record would have more than `MAX_SAMPLES` at `rate` [Hz]."""
    longest = max(float(record.time[-1] - record.time[0]) for record in (a, b))
    if longest * rate > MAX_SAMPLES:
        raise ParameterError(
            f"rate: expected at most {MAX_SAMPLES} samples of a record at the higher of both rates, got "
            f"{longest:g} s at {rate:g} Hz"
        )


def _why_missing(sides: tuple[Side, Side], levels: tuple[float, float], unit: str) -> str:
    """Return the reason why a limb has no pair of stances."""
    for name, side, level in zip("AB", sides, levels, strict=True):
        if not side.stances:
            why = why_none([side.force[:, 1]], side.time, level, unit)
            return f"{name} has no whole stance: expected one {why}"
    return "no stance of A has one of B at the same time"


def _span(record: ForceRecord) -> str:
    """Return the first and the last time of a record as text."""
    return f"{record.time[0]:.4g} to {record.time[-1]:.4g} s"


def why_none(verticals: list[Floats], time: Floats, level: float, unit: str) -> str:
    """Return the reason why vertical forces have no whole stance, and a remedy, for messages.

    Args:
        verticals: vertical forces of limbs, shape (n,).
        time: their times, shape (n,) [s].
        level: vertical force that makes a stance [unit].
        unit: unit of the forces.
    """
    samples = np.concatenate(verticals)
    # A percentile, as a few low samples do not make a swing.
    low = float(np.percentile(samples, 5))
    high = float(samples.max())
    why = f"above {level:g} {unit}, found none"
    if low > level:
        why += f": it hardly falls below {low:.4g} {unit}; subtract the plate's offset, or raise --threshold"
        if min(float(force.min()) for force in verticals) > level:
            why += (
                f"; or the stance is cut off by both ends of the record ({time[0]:.4g} and {time[-1]:.4g} s)"
            )
        return why
    if high <= level:
        return f"{why}: the highest force is {high:.4g} {unit}"
    ends = {"start": (0, time[0]), "end": (-1, time[-1])}
    cut = []
    for which, (k, at) in ends.items():
        if any(force[k] > level for force in verticals):
            cut.append(f"{which} ({at:.4g} s)")
    if cut:
        return (
            f"{why}: what it has is cut off by the {' and the '.join(cut)} of the record, where the limb "
            "is still loaded; a longer record has whole stances"
        )
    return f"{why}: the force stays above that for less than {1e3 * MIN_STANCE_SECONDS:.0f} ms at a time"


def _unshared(a: ForceRecord, b: ForceRecord, names: list[tuple[str, str]]) -> dict[str, str]:
    """Return the limbs that only one of the records has, with the reason."""
    of_a = {limb for limb, _ in names}
    of_b = {limb for _, limb in names}
    missing = {limb: "only A has it" for limb in a.limbs if limb not in of_a}
    return missing | {limb: "only B has it" for limb in b.limbs if limb not in of_b}


def _warnings(sides: tuple[Side, Side], errors: LimbErrors, align: str) -> list[str]:
    """Return warnings about the errors of a limb: stances that one record lacks or that have no partner,
    touchdowns that scatter."""
    a, b = sides
    period = a.period if a.period > 0 else b.period
    # Near the ends a stance may be whole in one record and cut off in the other.
    edge = 0.1 * period if period > 0 else 0.0
    low = max(a.time[0], b.time[0]) + edge
    high = min(a.time[-1], b.time[-1]) - edge
    counts = [side.whole_between(low, high) for side in sides]
    warnings = []
    if counts[0] != counts[1] and errors.pairs < max(counts):
        warnings.append(
            f"A has {counts[0]} whole stances and B {counts[1]} in the same time, {errors.pairs} are "
            "compared; if noise makes or splits stances, raise --threshold; other causes are steps that one "
            "record lacks, and limbs that share a plate"
        )
    fewer = min(errors.stances)
    if errors.pairs < fewer:
        remedy = (
            "--align stances shifts B" if align == "none" else "--align none takes the times of the files"
        )
        warnings.append(
            f"{fewer - errors.pairs} of {fewer} stances are not compared, as the other record has none at "
            f"their time (A has {errors.stances[0]} whole stances, B {errors.stances[1]}); {remedy}"
        )
    if period > 0 and errors.touchdown_spread > MAX_TOUCHDOWN_SPREAD * period:
        warnings.append(
            f"touchdowns scatter by {1e3 * errors.touchdown_spread:.0f} ms, of a stride of "
            f"{1e3 * period:.0f} ms: the records differ in pace, or stances are paired wrongly"
        )
    return warnings


def _common_unit(a: ForceRecord, b: ForceRecord, units: str) -> tuple[str, tuple[float, float]]:
    """Return the unit that both records can have, newtons first, and the factors that convert them to it;
    raise `ParameterError` if there is none."""
    for unit in ("N", "BW") if units == "auto" else (units,):
        by_a = a.per(unit)
        by_b = b.per(unit)
        if by_a and by_b:
            return unit, (by_a, by_b)
    wanted = "N" if units == "auto" else units
    lacking = next(name for name, record in (("a", a), ("b", b)) if not record.per(wanted))
    raise ParameterError(
        f"mass-{lacking}: expected the mass [kg] of the animal of {a.name if lacking == 'a' else b.name}, to "
        f"compare {a.unit} with {b.unit}{'' if units == 'auto' else f' in {units}'}"
    )


def _common_limbs(a: ForceRecord, b: ForceRecord) -> list[tuple[str, str]]:
    """Return pairs of limbs of A and of B that are compared; raise `ParameterError` if there is none."""
    if shared := [(limb, limb) for limb in a.limbs if limb in b.limbs]:
        return shared
    if len(a.limbs) == len(b.limbs) == 1:
        return [(*a.limbs, *b.limbs)]  # type: ignore[list-item]
    raise ParameterError(
        f"map: expected a limb that both records have; {a.name} has {', '.join(a.limbs)}, {b.name} has "
        f"{', '.join(b.limbs)}; name one as in left_fore=plate_1"
    )


def _resampled(
    record: ForceRecord, limbs: list[str], factor: float, rate: float, start: float
) -> tuple[Floats, list[Floats]]:
    """Resample a record.

    Args:
        record: the record.
        limbs: its limbs in the order of the result.
        factor: factor of the forces.
        rate: rate of the result [Hz].
        start: first time of the result, by the clock of the file [s].

    Returns:
        Times by the clock of the file, shape (m,) [s], and the forces of each limb, shape (m, 2).
    """
    first = record.time[0]
    # A little more, as rounding must not lose the last sample.
    steps = int((record.time[-1] - start) * rate + 1e-6) + 1
    # Relative to the first sample: large times of a clock would lose digits in the interpolation.
    elapsed = start - first + np.arange(steps) / rate
    forces = []
    for limb in limbs:
        columns = [np.interp(elapsed, record.time - first, column) for column in record.limbs[limb].T]
        forces.append(np.column_stack(columns) * factor)
    return first + elapsed, forces


PARTS: dict[str, Callable[[Floats], Floats]] = {
    "vertical": lambda force: force[:, 1],
    "fore-aft": lambda force: force[:, 0],
    "braking": lambda force: np.maximum(-force[:, 0], 0.0),
    "propulsion": lambda force: np.maximum(force[:, 0], 0.0),
}
"""Components by name, functions of forces forward and upward of shape (n, 2)."""


def _errors(pairs: list[Pair], sides: tuple[Side, Side], rate: float) -> LimbErrors:
    """Compute the errors of a limb over pairs of the stances of both sides at `rate` [Hz]."""
    forces = {}
    has_fore_aft = all(np.isfinite(force).all() for pair in pairs for force in (pair.a, pair.b))
    for name, part in PARTS.items():
        if name != "vertical" and not has_fore_aft:
            continue
        x = np.concatenate([part(pair.a) for pair in pairs])
        y = np.concatenate([part(pair.b) for pair in pairs])
        # Peak and impulse of each stance alone, shape (pairs, 2 records, 2).
        figures = [[(part(force).max(), part(force).sum() / rate) for force in pair.own] for pair in pairs]
        means = np.array(figures).mean(axis=0)
        peak, impulse = means[0]
        peak_error, impulse_error = means[1] - means[0]
        # Pearson's correlation by hand: NumPy's warns of a force that does not change.
        spread = x.std() * y.std()
        r = float(((x - x.mean()) * (y - y.mean())).mean() / spread) if spread > 0 else math.nan
        rmse = math.sqrt(((x - y) ** 2).mean())
        forces[name] = Force(
            rmse=rmse,
            r=r,
            peak=float(peak),
            peak_error=float(peak_error),
            impulse=float(impulse),
            impulse_error=float(impulse_error),
        )
    contacts = [[len(force) / rate for force in pair.own] for pair in pairs]
    contact = np.array(contacts).mean(axis=0)
    peak_times = [[int(force[:, 1].argmax()) / rate for force in pair.own] for pair in pairs]
    peak_time = np.array(peak_times).mean(axis=0)
    late = np.array([pair.late for pair in pairs])
    return LimbErrors(
        pairs=len(pairs),
        stances=(len(sides[0].stances), len(sides[1].stances)),
        forces=forces,
        contact=float(contact[0]),
        contact_error=float(contact[1] - contact[0]),
        touchdown_error=float(late.mean()),
        touchdown_spread=float(late.std()),
        peak_time_error=float(peak_time[1] - peak_time[0]),
    )

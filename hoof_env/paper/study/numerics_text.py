"""What part 1 says, phrased from its numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.paper.published import Published, PublishedRow
from hoof_env.paper.report import format_number
from hoof_env.paper.solvers import slowest_root
from hoof_env.paper.study.conditions_text import conditions_text, number
from hoof_env.paper.study.section import listed, table

GAIT_WORDS = {"walk": "walking", "run": "running"}


def numerics_text(published: Published, data: Mapping[str, Any]) -> str:
    """The part's text and tables."""
    return "\n\n".join(
        [
            "### How far Euler drifts",
            *_drift(data),
            "![Hoof error over time and over the step](numerics_drift.png)",
            "### What that does to the rows",
            *_rows(published, data),
            *_causes(data),
            "![Inelastic normal force, exact and by Euler](numerics_forces.png)",
            "### Over beta, step and ground level",
            *_sweep(data),
            "![Hoof error and peaks over beta](numerics_beta.png)",
            "![Inelastic peaks over the time step and the ground level](numerics_step.png)",
            "### Condition of each row",
            conditions_text(published, data["conditions"]),
            "![Bars that each row spans as a parameter moves a little](numerics_conditions.png)",
        ]
    )


def observed_order(errors: list[float]) -> float:
    """Order of convergence from errors at steps that halve: how fast log2(error) falls; NaN if one is 0."""
    if min(errors) <= 0:
        return math.nan
    return float(-np.polyfit(range(len(errors)), np.log2(errors), 1)[0])


def _steps(data: Mapping[str, Any]) -> list[str]:
    return [f"{1e3 / n:g} ms" for n in data["ladder"]]


def _drift(data: Mapping[str, Any]) -> list[str]:
    steps, lines, orders = _steps(data), [], []
    first: dict[str, dict[str, float]] = {}
    for name, ladder in data["drift"].items():
        for gait, word in GAIT_WORDS.items():
            errors = [entry[gait]["cycle_mm"] for entry in ladder]
            orders.append(observed_order(errors))
            first.setdefault(name, {})[word] = errors[0]
            line = [f"{name}, {data['betas'][name]:.2f}", word, *(f"{error:.3g}" for error in errors)]
            start = ladder[0][gait]
            lines.append(
                [*line, number(orders[-1], ".2f"), f"{start['stance_mm']:.3g}", f"{start['closure_mm']:.3g}"]
            )
    roots = listed(
        f"{slowest_root(data['alpha'], beta):.2f} 1/s for the {name} β = {beta:.2f} 1/s"
        for name, beta in data["betas"].items()
    )
    errors_at_first = listed(
        f"{error:.2f} mm ({word}, {name} β)" for name, by in first.items() for word, error in by.items()
    )
    gains = listed(
        f"{first['printed'][word] / error:.1f} ({word})" for word, error in first["probable"].items()
    )
    head = ["β [1/s]", "gait", *(f"hoof error at {step} [mm]" for step in steps), "order"]
    return [
        "The paper integrates Eq. 8 by explicit Euler. A closure error decays by the roots of "
        f"s² + 2αs + β² = 0; with α = {data['alpha']:g} 1/s the slowest has a real part of {roots}. "
        f"At {steps[0]} toe or heel is up to {errors_at_first} away from where the closed form puts it: the "
        f"printed β multiplies the error of the probable one by {gains}. Both converge to the exact motion; "
        f"the order observed is {_span(orders)}, 1 being expected.",
        table([*head, f"in stance at {steps[0]} [mm]", f"closure error at {steps[0]} [mm]"], lines),
    ]


def _span(values: list[float]) -> str:
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def _rows(published: Published, data: Mapping[str, Any]) -> list[str]:
    steps, lines = _steps(data), []
    outside: dict[str, list[str]] = {name: [] for name in data["betas"]}
    for row in published.rows:
        entry = data["rows"][row.id]
        line = [f"`{row.id}`", row.unit, format_number(entry["exact"], row.unit)]
        for name in data["betas"]:
            errors = [_error(row, value, entry["exact"]) for value in entry[name]]
            line += [_formatted(row, error) for error in errors]
            if row.bar.holds(errors[0]) is False:
                outside[name].append(row.id)
        lines.append(line)
    barred = sum(row.bar.limit is not None for row in published.rows)
    head = [f"{name} β, {step}" for name in data["betas"] for step in steps]
    counts = listed(
        f"{len(rows)} with the {name} β" + (f" ({listed(f'`{row}`' for row in rows)})" if rows else "")
        for name, rows in outside.items()
    )
    return [
        "Errors of each row against the exact solver (not against the paper), in % of the row for forces, "
        f"in its unit for the others. Of {barred} rows with a bar, Euler at {steps[0]} alone moves further "
        f"than the bar {counts}.",
        table(["row", "unit", "exact", *head], lines),
    ]


def _error(row: PublishedRow, value: float | None, exact: float | None) -> float | None:
    return None if value is None or exact is None else row.bar.error(value, exact)


def _formatted(row: PublishedRow, error: float | None) -> str:
    return format_number(error, row.bar.measure, "+")


def _causes(data: Mapping[str, Any]) -> list[str]:
    lines, words = [], []
    for gait, word in GAIT_WORDS.items():
        peaks = data["causes"][gait]
        for motion, by in peaks.items():
            name = "exact" if motion == "exact" else f"Euler, {motion} β"
            lines.append([word, name, f"{by['interpolated']:.1f}", f"{by['sampled']:.1f}"])
        truth = peaks["exact"]["interpolated"]
        drift = listed(
            f"{100 * (peaks[name]['interpolated'] / truth - 1):+.1f} % ({name} β)" for name in data["betas"]
        )
        sampling = 100 * (peaks["exact"]["sampled"] / truth - 1)
        words.append(f"{word}: drift alone {drift}, sampling alone {sampling:+.1f} %")
    return [
        "The inelastic peak has two sources of error: the drift of the motion, and the approach speed, "
        "which a loop with a fixed step takes at its first sample inside the ground instead of at "
        f"touch-down. Taken apart at {_steps(data)[0]}, {'; '.join(words)}.",
        table(["gait", "motion", "peak, approach speed interpolated [N]", "sampled [N]"], lines),
    ]


def _sweep(data: Mapping[str, Any]) -> list[str]:
    sweep = data["beta_sweep"]
    beta = np.array(sweep["beta"])
    found = {gait: int(np.argmin(errors)) for gait, errors in sweep["hoof_mm"].items()}
    best = listed(
        f"{beta[k]:g} 1/s{', the end of the range,' if k == beta.size - 1 else ''} in {GAIT_WORDS[gait]} "
        f"({sweep['hoof_mm'][gait][k]:.2f} mm)"
        for gait, k in found.items()
    )
    ranges = {key: (min(ratios), max(ratios)) for key, ratios in sweep["peak_ratio"].items()}
    worst = max(ranges, key=lambda key: ranges[key][1] / ranges[key][0])
    low, high = ranges.pop(worst)
    others = [bound for pair in ranges.values() for bound in pair]
    gait, condition = worst.split(".")
    return [
        f"With β from {beta.min():g} to {beta.max():g} 1/s at {_steps(data)[0]} the hoof error is smallest "
        f"at {best}. The {GAIT_WORDS[gait]} {condition} peak runs from {low:.2f} to {high:.2f} of its exact "
        f"value over that range, the other three from {min(others):.2f} to {max(others):.2f}.",
        _level(data),
        *_failures(data["step_sweep"]),
    ]


def _failures(sweep: Mapping[str, Any]) -> list[str]:
    """Steps with which the integration does not come to the end of the cycle, if there are any."""
    shortest = {
        (gait, name): min(step for step, peak in zip(sweep["step_ms"], peaks, strict=True) if peak is None)
        for gait, by_name in sweep["peaks"].items()
        for name, peaks in by_name.items()
        if None in peaks
    }
    words = listed(f"{step:.2f} ms ({GAIT_WORDS[gait]}, {name} β)" for (gait, name), step in shortest.items())
    return [f"Euler does not come to the end of the cycle with steps from {words} on."] if shortest else []


SPIKE = 1.5
"""A peak over the ground level is a spike if its top is this many times as high as both ends of the sweep."""


def _level(data: Mapping[str, Any]) -> str:
    rise = np.array(data["level_sweep"]["rise_mm"])
    peaks = np.array(data["level_sweep"]["peaks"]["walk"]["exact"])
    low, high = peaks.min(), peaks.max()
    text = (
        f"As the ground moves by ±{rise.max():g} mm, the exact walking inelastic peak runs from {low:.0f} "
        f"to {high:.0f} N"
    )
    if high < SPIKE * max(peaks[0], peaks[-1]):
        return f"{text}, without a spike."
    top = float(rise[int(peaks.argmax())])
    placed = (
        "The identified level lies on its top"
        if abs(top) < 0.1
        else f"It is highest with the ground {top:+.2f} mm from this leg's level"
    )
    wide = rise[peaks >= (low + high) / 2]
    width = wide.max() - wide.min()
    drifts = {name: ladder[0]["walk"]["stance_mm"] for name, ladder in data["drift"].items()}
    drift = listed(f"{error:.2f} mm ({name} β)" for name, error in drifts.items())
    verdict = (
        "the drift decides where on the spike the row lies"
        if max(drifts.values()) > width
        else "more than the drift"
    )
    return (
        f"{text}: a spike, where a point of the hoof touches the ground so gently that Eq. 14 divides by "
        f"next to nothing. {placed}; it is {width:.2f} mm wide at half height, against a drift of {drift} in "
        f"stance: {verdict}. A published peak that this leg meets only within so narrow a band is fitted, "
        "and no prediction."
    )

"""Slips of the results as printed: angles that contradict each other, and words that name two quantities."""

from __future__ import annotations

from typing import Any

from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.reproduce import GAITS, Reproduction
from hoof_env.paper.study.slip import CHANGES, HARMLESS, Slip
from hoof_env.paper.study.slips_contact import NAMES, SOLVER


def result_slips(reproduction: Reproduction) -> list[Slip]:
    """The slips of section 3's numbers."""
    rows = {row["id"]: row for row in reproduction.rows if row["solver"] == SOLVER}
    return [
        _lift_off(reproduction, rows),
        _variation(reproduction, rows),
        _reached(reproduction),
        _average(rows),
        _maximum(rows),
        _symbols(),
    ]


def _lift_off(reproduction: Reproduction, rows: dict[str, Any]) -> Slip:
    row, flat = rows["walk.angle_liftoff"], reproduction.published.row("walk.angle_flat").value
    printed = reproduction.published.row("walk.angle_liftoff").printed
    bar = reproduction.published.row("walk.angle_liftoff").bar
    errors = {"read": row["error"], "literal": row["beside"]["error_against_printed"]}
    literal_better = abs(errors["literal"]) < abs(errors["read"])
    verdict = (
        "the leg meets the letter better"
        if literal_better
        else "within its bar as read"
        if bar.holds(errors["read"])
        else "outside its bar both ways"
    )
    return Slip(
        "walk.angle_liftoff",
        "section 3",
        f"walking leaves the ground at {printed} deg",
        f"{row['published']:+} deg, heel up",
        f"after {flat} deg (flat) the letter lifts the toe first; the text says 'toe-off'",
        f"the leg lifts off at {row['simulated']:+.1f} deg: {errors['read']:+.1f} deg from the reading, "
        f"{errors['literal']:+.1f} deg from the letter; {verdict}. The reading was a target of the "
        "identification",
        CHANGES,
        {"simulated_deg": row["simulated"], "errors_deg": errors, "literal_better": literal_better},
    )


def _variation(reproduction: Reproduction, rows: dict[str, Any]) -> Slip:
    printed = {
        name: reproduction.published.row(f"walk.{name}").printed
        for name in ("angle_contact", "angle_flat", "angle_liftoff", "angle_variation")
    }
    run = reproduction.published.row("run.angle_variation").value
    read = abs(printed["angle_liftoff"]) - printed["angle_contact"]
    literal = printed["angle_liftoff"] - printed["angle_contact"]
    angles = [printed[name] for name in ("angle_contact", "angle_flat", "angle_liftoff")]
    extent = max(angles) - min(angles)
    row = rows["walk.angle_variation"]
    ratio = reproduction.published.row("ratio.angle_variation").value
    ratios = {name: run / value for name, value in (("printed", printed["angle_variation"]), ("read", read))}
    return Slip(
        "walk.angle_variation",
        "section 3",
        f"angular variation 'reached {printed['angle_variation']:g}°'",
        f"reported without a bar; {read:.1f} deg follows from the angles as read",
        "it contradicts the angles beside it",
        f"the printed angles differ by {read:.2f} deg with lift-off read as heel up, by {abs(literal):.2f} "
        f"deg by the letter, and span {extent:.2f} deg then; the leg gives {row['simulated']:.1f} deg "
        f"(range {row['beside']['range_deg']:.1f}). The ratio of {ratio:g} is {ratios['printed']:.2f} with "
        f"the printed variation and {ratios['read']:.2f} with the angles as read",
        CHANGES,
        {"from_angles_deg": {"read": read, "literal": literal, "extent": extent}, "ratios": ratios},
    )


def _reached(reproduction: Reproduction) -> Slip:
    value = {name: reproduction.published.row(f"run.{name}").value for name in
             ("angle_contact", "angle_liftoff", "angle_variation")}  # fmt: skip
    difference = value["angle_liftoff"] - value["angle_contact"]
    return Slip(
        "run.angle_variation",
        "section 3",
        f"'finally, the hoof angle was reached {value['angle_variation']}°'",
        "the variation from contact to lift-off",
        f"lift-off is at {value['angle_liftoff']} deg one sentence before",
        f"the printed angles differ by {difference:.2f} deg, which fits the variation to "
        f"{difference - value['angle_variation']:.2f} deg; as an angle it would be "
        f"{value['angle_variation'] - value['angle_liftoff']:+.2f} deg off",
        HARMLESS,
        {"difference_deg": difference},
    )


def _average(rows: dict[str, Any]) -> Slip:
    parts, data = [], {}
    for gait in GAITS:
        for condition in CONDITIONS:
            row = rows[f"{gait}.mean_{condition}"]
            cycle, stance = row["simulated"], row["beside"]["mean_over_stance_N"]
            data[row["id"]] = {"cycle_N": cycle, "stance_N": stance, "published_N": row["published"]}
            parts.append(
                f"{NAMES[gait]} {condition} {cycle:.0f} and {stance:.0f} N (print {row['published']:g})"
            )
    closer = all(
        abs(d["cycle_N"] - d["published_N"]) < abs(d["stance_N"] - d["published_N"]) for d in data.values()
    )
    return Slip(
        "mean",
        "section 3",
        "'average normal force', without a window",
        "mean over the whole cycle",
        "the printed ratios of mean to peak fit it" if closer else "assumed; the numbers do not decide",
        f"over the cycle and over stance alone: {'; '.join(parts)}",
        CHANGES,
        data,
    )


def _maximum(rows: dict[str, Any]) -> Slip:
    parts, data = [], {}
    for gait in GAITS:
        for condition in CONDITIONS:
            row = rows[f"{gait}.peak_{condition}"]
            normal, resultant = row["simulated"], row["beside"]["resultant_N"]
            errors = [100 * (value - row["published"]) / row["published"] for value in (normal, resultant)]
            data[row["id"]] = {"normal_N": normal, "resultant_N": resultant, "errors_%": errors}
            parts.append(
                f"{NAMES[gait]} {condition} {normal:.0f} and {resultant:.0f} N ({errors[0]:+.1f} and "
                f"{errors[1]:+.1f} %)"
            )
    return Slip(
        "maximum",
        "section 3",
        "'maximum contact force' in walking, 'maximum GRF' in running",
        "the normal force, summed over toe and heel, in both",
        "one quantity must be meant: the two peaks are compared",
        f"normal and resultant: {'; '.join(parts)}. The leg was identified with the normal force, so its "
        "smaller error there is no evidence for that reading",
        CHANGES,
        data,
    )


def _symbols() -> Slip:
    twice = {
        "α": "Baumgarte's parameter and every hoof angle (α1 in both gaits at all instants)",
        "K": "stiffness and the toe",
        "n": "exponent and normal",
        "t": "time and tangent",
        "L10": "half-length of link 12 (of link 10 it is L91)",
    }
    return Slip(
        "symbols",
        "throughout",
        "one symbol for several things: " + "; ".join(f"{symbol} is {use}" for symbol, use in twice.items()),
        "as the context asks",
        "names only",
        "nothing to compute",
        HARMLESS,
    )

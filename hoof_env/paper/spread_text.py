"""The spread of an ensemble in words and tables, all from what `hoof_env.paper.spread` measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.spread_names import DIGITS, FOLLOWING, GAIT_NAMES, IDENTIFIED

TITLE = "Identified values and their spread"

Data = Mapping[str, Any]


def with_spread(data: Data, key: str) -> str:
    """A value of the preset with the ensemble's range, such as '1.523 m (1.401 to 1.688)'.

    Args:
        data: of a `hoof_env.paper.spread.Spread`.
        key: of `spread_names.IDENTIFIED` or `FOLLOWING`.
    """
    entry = data["quantities"][key]
    return (
        f"{_number(entry['preset'], entry['unit'])} {entry['unit']} ({_range(entry['range'], entry['unit'])})"
    )


def markdown(data: Data, figure: str | None = None) -> str:
    """A section with its heading of level 2; `figure` is the name of a picture to show, without suffix."""
    head = [
        "quantity",
        "unit",
        f"preset `{data['preset']}`",
        "median",
        "middle half",
        "range",
        "range / median",
    ]
    parts = [
        f"## {TITLE}",
        _who(data),
        "\n".join(f"- {line}" for line in _findings(data)),
        _what_not(data),
        *([f"![{TITLE}]({figure}.png)\n[{figure}.svg]({figure}.svg)"] if figure else []),
        "### What the paper does not print",
        "Lengths carry the letters of figure 1; C's coordinates and the swing angles are in the leg's own "
        "frame, as preset files have them. The middle half lies between the quartiles; the range is that of "
        "all members.",
        _table(head, (_line(data, key) for key in IDENTIFIED)),
        "### What follows from it",
        "One cycle of each gait, exact solver. Peaks and impulses of the force are held by the bars of the "
        "printed peaks and means; nothing printed holds the torques. These and the mass are for links of "
        f"{' or '.join(f'{d:g}' for d in data['linear_density'])} kg/m, which is assumed and not identified.",
        _table(head, (_line(data, key) for key in FOLLOWING)),
        "### How far the curves of two members are apart",
        "Largest and root mean square distance at the same instant, over all pairs of members and all "
        "instants. Paths are those of the sole's middle against the ground under O; 'in stance' is between "
        "the printed contacts. The last column divides the rms of forces by the published mean over the "
        "cycle, that of torques by the rms of all members' torques.",
        _table(
            ["curve", "unit", "largest", "rms", "rms, relative"],
            (
                [
                    d["name"],
                    d["unit"],
                    _number(d["largest"], d["unit"]),
                    _number(d["rms"], d["unit"]),
                    _percent(d["relative"]),
                ]
                for d in data["differences"].values()
            ),
        ),
    ]
    return "\n\n".join(parts)


def _who(data: Data) -> str:
    exact, paper = data["bar"]["exact"], data["bar"]["paper"]
    fit = (
        "each of which meets every printed number within its bar"
        if max(exact, paper) <= 1
        else "which meet a looser bar than that of the printed numbers"
    )
    demands = (
        "All satisfy the demands on plausibility"
        if not data["short"]
        else f"{data['short']} of them miss a demand on plausibility"
    )
    return (
        f"The printed numbers do not determine the leg. Beside preset `{data['preset']}` stands an ensemble "
        f"of {data['members']} legs with their own ground levels and swings, {fit}. The worst row of any of "
        f"them is {exact:.2f} bars off with the exact solver and {paper:.2f} with the paper's, whose "
        f"inelastic walking rows do not count. {demands}."
    )


def _findings(data: Data) -> list[str]:
    quantities, differences = data["quantities"], data["differences"]
    held = {entry["key"] for entry in data["held"]}
    lengths = [
        quantities[key]
        for key in IDENTIFIED
        if (key.startswith("length.") or key == "hip_height") and key not in held
    ]
    ranked = sorted(
        (entry for entry in lengths if entry["relative"] is not None), key=lambda e: e["relative"]
    )
    least, most = ranked[-1], ranked[0]
    lines = [
        f"Least determined of the lengths: {least['name']}, {_entry_range(least)}, "
        f"{_percent(least['relative'])} of its median. Best: {most['name']}, {_entry_range(most)}, "
        f"{_percent(most['relative'])}.",
        *(_held(entry, quantities[entry["key"]], data["members"]) for entry in data["held"]),
        *_one_sided(data["one_sided"]),
    ]
    for gait, name in GAIT_NAMES.items():
        cycle, stance, shape = (
            differences[f"{gait}.path{part}"] for part in ("", "_stance", "_stance_shape")
        )
        lines.append(
            f"Hoof path, {name}: two members' soles are up to {_cm(cycle['largest'])} apart at one instant "
            f"of the cycle (rms {_cm(cycle['rms'])}) and {_cm(stance['largest'])} in stance (rms "
            f"{_cm(stance['rms'])}); with the middles of their stances one above the other, "
            f"{_cm(shape['largest'])} (rms {_cm(shape['rms'])})."
        )
    for gait, name in GAIT_NAMES.items():
        torques, forces = [], []
        for condition in CONDITIONS:
            peak = quantities[f"{gait}.{condition}.crank_peak"]
            torques.append(f"{_entry_range(peak)} ({condition})")
            force = differences[f"{gait}.{condition}.normal"]
            forces.append(
                f"{_number(force['largest'], 'N')} N (rms {_number(force['rms'], 'N')} N, "
                f"{_percent(force['relative'])} of the published mean; {condition})"
            )
        lines.append(f"Largest crank torque, {name}: {' and '.join(torques)}.")
        lines.append(f"Force of the ground, {name}: two members differ by up to {' and '.join(forces)}.")
    return lines


def _held(entry: Data, quantity: Data, members: int) -> str:
    side = "at most" if entry["most"] else "at least"
    return (
        f"Held by a demand and not by the numbers: {quantity['name']}, {_entry_range(quantity)}. The search "
        f"asks for {side} {_number(entry['bound'], quantity['unit'])} {quantity['unit']} ({entry['why']}), "
        f"and {entry['members']} of {members} members lie within 1 % of that: the range ends there by "
        "request."
    )


def _one_sided(rows: Iterable[Data]) -> list[str]:
    """Where the printed numbers pull against each other: rows that no member has on the other side."""
    words = [f"`{row['row']}` {row['low']:+.1f} to {row['high']:+.1f} %" for row in rows]
    if not words:
        return []
    return [
        f"Every member errs the same way, by more than half the bar, in {', '.join(words)}: no member has "
        "these printed numbers in the middle of their bars together with the others, so their narrow ranges "
        "show where the bars end and not what a leg must have."
    ]


def _what_not(data: Data) -> str:
    kinds = data["assemblies"]
    shared = (
        "all share one assembly, toe and direction of travel"
        if len(kinds) == 1
        else f"they have {len(kinds)} combinations of assembly, toe and direction of travel"
    )
    source = f" The ensemble's own account: {data['provenance']}" if data["provenance"] else ""
    return (
        "**What the ensemble is not.** It is not a posterior: its members have no weights, and where many "
        "lie shows how the searches went, not what is likely. They descend from searches that began near a "
        f"leg already known, and {shared}; the ground's K and n, the masses' rule, the law of the swing and "
        "the linkage itself are the same in all. So its spread is a lower bound for what the numbers leave "
        f"open, and a value with a narrow range is not thereby known.{source}"
    )


def _line(data: Data, key: str) -> list[str]:
    entry = data["quantities"][key]
    unit = entry["unit"]
    return [
        entry["name"], unit, _number(entry["preset"], unit), _number(entry["median"], unit),
        _range(entry["middle_half"], unit), _range(entry["range"], unit), _percent(entry["relative"]),
    ]  # fmt: skip


def _number(value: float, unit: str) -> str:
    return f"{value:.{DIGITS[unit]}f}"


def _range(ends: Iterable[float], unit: str) -> str:
    return " to ".join(_number(end, unit) for end in ends)


def _entry_range(entry: Data) -> str:
    return f"{_range(entry['range'], entry['unit'])} {entry['unit']}"


def _cm(metres: float) -> str:
    return f"{100 * metres:.1f} cm"


def _percent(part: float | None) -> str:
    return "" if part is None else f"{100 * part:.1f} %"


def _table(head: list[str], rows: Iterable[list[str]]) -> str:
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows))

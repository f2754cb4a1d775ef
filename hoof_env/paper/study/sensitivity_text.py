"""What part 3 says, phrased from its numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hoof_env.paper.published import Published
from hoof_env.paper.report import format_number
from hoof_env.paper.study.section import listed, table

NAMES = {
    "stiffness": "K",
    "exponent": "n",
    "friction": "μ",
    "friction_slow": "lower threshold",
    "friction_fast": "upper threshold",
    "crank_speed": "crank speed",
    "ground_level": "ground",
}
GAIT_WORDS = {"walk": "walking", "run": "running"}


def sensitivity_text(published: Published, data: Mapping[str, Any]) -> str:
    """The part's text and tables."""
    return "\n\n".join(
        [
            "### Every row against every parameter",
            *_answers(published, data),
            "![Change of each row in bars](sensitivity_map.png)",
            "### What follows from the construction",
            *_laws(data),
            "### Stiffness, friction, pace and level",
            *_stiffness(published, data),
            _friction(data),
            _speed(data),
            _level(data),
            "![Peaks over ground level and stiffness; resultants over friction](sensitivity_sweeps.png)",
        ]
    )


def _answers(published: Published, data: Mapping[str, Any]) -> list[str]:
    lines = []
    most: dict[str, tuple[float, str]] = {}
    for row, entry in data["rows"].items():
        of = published.row(row.removesuffix(".resultant"))
        measure = of.bar.measure
        cells = []
        for parameter in NAMES:
            change, bars = entry[parameter]["change"], entry[parameter]["bars"]
            cells.append(_change(change, measure))
            if bars is not None:
                most[parameter] = max(most.get(parameter, (0.0, "")), (abs(bars), row))
        unit = {"%": "%", "point": "points"}.get(measure, entry["unit"])
        lines.append(
            [
                f"`{row}`",
                f"{format_number(entry['value'], entry['unit'])} {entry['unit'].replace('-', '')}".strip(),
                unit,
                *cells,
            ]
        )
    step = f"+{100 * data['part']:g} %"
    leaders = listed(
        f"{NAMES[parameter]} `{row}` ({bars:.2g})" for parameter, (bars, row) in most.items() if bars > 1e-9
    )
    idle = [NAMES[parameter] for parameter, (bars, _) in most.items() if bars <= 1e-9]
    return [
        f"Change of each row, exact solver, as a parameter grows by {step} and as the ground rises by 1 mm, "
        "by central differences: forces in % of the row, which is the elasticity, reductions in points, "
        "the others in their unit. '.resultant' is the same row for the resultant instead of the normal "
        "force; means are over the cycle, however long it lasts. The row that moves by most bars under "
        f"each parameter: {leaders}. These are slopes: a row on a spike over the ground level moves far more "
        "within 1 mm than its slope says (part 1, 'Condition of each row')."
        + (f" No row answers to {listed(idle, 'or')}." if idle else ""),
        table(["row", "value", "change in", *(f"{name} {'+1 mm' if name == 'ground' else step}"
               for name in NAMES.values())], lines),
    ]  # fmt: skip


def _change(change: float | None, measure: str) -> str:
    if change is None or not math.isfinite(change):
        return "none"
    if abs(change) < 1e-9:
        return "0"
    return f"{change:+.2g}" if measure in ("s", "") else f"{change:+.3g}"


def _laws(data: Mapping[str, Any]) -> list[str]:
    laws = data["laws"]
    held = sum(law["holds"] for law in laws)
    lines = []
    for law in laws:
        parameters = listed(NAMES[name] for name in law["parameters"])
        measured = f"{law['deviation']:.1e}", "yes" if law["holds"] else "**no**"
        lines.append([law["rows"], parameters, f"{law['expected']:g}", law["reason"], *measured])
    return [
        f"Some answers follow from the construction, whatever the leg. {held} of {len(laws)} are confirmed:",
        table(["rows", "parameter", "elasticity", "because", "largest deviation measured", "holds"], lines),
    ]


SHOWN = (
    "walk.contact_start",
    "walk.contact_end",
    "walk.peak_inelastic",
    "run.contact_start",
    "run.contact_end",
    "run.peak_elastic",
    "run.peak_inelastic",
)


def _stiffness(published: Published, data: Mapping[str, Any]) -> list[str]:
    entries = data["stiffness"]
    lines = []
    for entry in entries:
        cells = [
            format_number(entry["rows"].get(row), published.row(row).unit) if row in entry["rows"] else "none"
            for row in SHOWN
        ]
        count = f"{entry['within']} of {entry['barred']}"
        lines.append([f"{entry['factor']:g}", f"{entry['rise_mm']:+.1f}", *cells, count])
    best = max(entries, key=lambda entry: entry["within"])
    first, last = entries[0], entries[-1]
    peaks = [entry["rows"].get("run.peak_elastic") for entry in (first, last)]
    change = "" if None in peaks else f" from {peaks[0]:.0f} to {peaks[1]:.0f} N"
    published_line = [
        "published",
        "",
        *(format_number(published.row(r).value, published.row(r).unit) for r in SHOWN),
    ]
    limit, own = published.parameters["stiffness"], data["parameters"]["stiffness"]
    where = "at the lower limit" if own == limit else f"at {own / limit:.3g} times the lower limit"
    return [
        f"The paper gives K as 'no smaller than' {limit:g}; this preset has {own:g} N/mⁿ with n = "
        f"{data['parameters']['exponent']:g}. With all else kept, all forces grow in "
        "proportion: ten times K, ten times every force. The ground level is not printed either, so a "
        "stiffer ground may lie lower. With the level chosen to keep the elastic walking peak at its "
        f"published value, {first['factor']:g} to {last['factor']:g} times K moves the ground by "
        f"{last['rise_mm']:+.1f} mm and the elastic running peak{change}. Most rows lie within their bar "
        f"({best['within']} of {best['barred']}) at {best['factor']:g} times K"
        + (
            f": on this leg, identified {where}, no stiffer ground tried does as well."
            if best is first
            else "."
        )
        + _own_level(first),
        table(["K over the preset's", "ground [mm]",
               *(f"`{row}` [{published.row(row).unit}]" for row in SHOWN), "rows within bar"],
              [*lines, [*published_line, ""]]),
    ]  # fmt: skip


def _own_level(first: Mapping[str, Any]) -> str:
    """Why the first line of the table is not the leg as identified."""
    if first["factor"] != 1 or abs(first["rise_mm"]) < 0.05:
        return ""
    return (
        f" The first line is not the leg as identified: its elastic walking peak is not quite the published "
        f"one, and the {first['rise_mm']:+.1f} mm that make it so move the inelastic walking rows, which "
        "hang on the level (part 1)."
    )


def _friction(data: Mapping[str, Any]) -> str:
    mu = data["parameters"]["friction"]
    answers = {
        row: entry["friction"]["elasticity"]
        for row, entry in data["rows"].items()
        if "peak" in row and row.endswith(".resultant")
    }
    low, high = f"{min(answers.values()):.3f}", f"{max(answers.values()):.3f}"
    measured = f"{high} throughout" if low == high else f"{low} to {high}"
    slip = mu**2 / (1 + mu**2)
    thresholds = [
        abs(entry[name]["elasticity"])
        for row, entry in data["rows"].items()
        if "peak" in row and row.endswith(".resultant")
        for name in ("friction_slow", "friction_fast")
    ]
    most = max(thresholds)
    effect = f"have elasticities up to {most:.1e}" if most > 1e-9 else "do not matter at the peaks"
    fast = data["friction"]
    lost = []
    for gait, ratios in fast["by_fast"].items():
        fallen = [
            v for v, ratio in zip(fast["fast"], ratios, strict=True) if ratio < 0.99 * math.sqrt(1 + mu**2)
        ]
        lost.append(
            f"{fallen[0]:.2g} m/s ({GAIT_WORDS[gait]})" if fallen else f"nowhere tried ({GAIT_WORDS[gait]})"
        )
    return (
        "Resultants do depend on friction. If the hoof slips fully at the peak the resultant is √(1 + μ²) "
        f"times the normal force and its elasticity to μ is μ²/(1 + μ²) = {slip:.3f}; the measured one is "
        f"{measured}. The thresholds, which the paper does not print, {effect}; the elastic resultant peak "
        f"falls by more than 1 % below full slip with an upper threshold from {listed(lost)}."
    )


def _speed(data: Mapping[str, Any]) -> str:
    changes = listed(
        f"{100 * entry['normal']:.2g} % (resultant peaks {100 * entry['resultant']:.2g} %) at {factor} "
        "times the crank speed"
        for factor, entry in data["speed"].items()
    )
    if max(entry["normal"] for entry in data["speed"].values()) < 1e-6:
        verdict = (
            "A gait at another pace has the same normal forces: the law knows the speed of impact only by "
            "its ratio to the speed in stance, so hitting the ground faster costs nothing here."
        )
    else:
        verdict = "Only the floor of the approach speed can do that."
    return f"Largest change of a normal force row: {changes}. {verdict}"


def _level(data: Mapping[str, Any]) -> str:
    rise = data["level"]["rise_mm"]
    spans = listed(
        f"{min(ratios):.2g} to {max(ratios):.2g} ({GAIT_WORDS[key.split('.')[0]]}, {key.split('.')[1]})"
        for key, ratios in data["level"]["peaks"].items()
    )
    return (
        f"With the ground from {min(rise):+g} to {max(rise):+g} mm the peaks run, as parts of the published "
        f"ones, from {spans}."
    )

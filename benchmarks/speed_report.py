"""The tables of `speed` as Markdown."""

from __future__ import annotations

from typing import Any

from benchmarks.speed_code import KINDS, WIDTHS
from benchmarks.speed_rounds import told

INTRO = """\
# How fast it is

Written by `make bench`; run it again for the numbers of your machine. Everything runs in one process on one
thread, interleaved: {rounds} rounds, each with every case once in a new order, {clock} time. A ratio is taken
within a round; given are the median and in brackets quartiles and extremes. Only ratios count. What limits it
and costs against size are in processor time. Every figure of this engine is of code with vectors of up to
{bits} bits, the widest that numba compiles here; MuJoCo and Exudyn are as they come."""

RATIOS = """\
## Ratios

Steps of 1 ms with contact and motors. MuJoCo: `mj_step` of many steps with its own contact. ALL is the
linkage body for body and joint for joint (14 hinges a leg); RIGID has the rigid triangles and the locked
shank welded (9 hinges), which is kinder to MuJoCo. The bars are judged on ALL. Rates are steps of the whole
animal. Bars with all joint reactions are half of those without."""

WALKING = """\
## Do they walk

{steps} steps from where every timed run begins; crank speeds in parts of the commanded one."""

SCALING = """\
## Cost against size

![Cost against steps, legs and environments](scaling.svg)

The straight line is a fixed cost and one for each step, leg or environment. Up to six environments of one leg
or of four are run one by one, more, or those with other numbers of legs, side by side, eight at a time."""

PASSES = """\
A pass is what a kernel's code does at a time: a leg, the four legs of a horse, or eight environments of a
batch. For each stage what all its calls in a step of a pass take, alone in a loop in the state where the
runs begin, and the instructions in its machine code, both sides of branches included (a touch-down is rare);
one that calculates with a number from memory is a load, too. Then what share of its time it would take if
nothing but its divisions and square roots, its arithmetic, its loads or its stores went at the machine's
ceiling."""

EXPERIMENTS = """\
### Experiments

Time per leg-step over that of what is named first, in the same round. Crank angles are in random order."""


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows))


def _steps(rate: float) -> str:
    return f"{rate / 1e6:.2f} M" if rate >= 1e6 else f"{rate / 1e3:.3g} k"


def _met(bar: float | None, ratio: dict[str, float] | None) -> str:
    if bar is None:
        return ""
    if ratio is None:
        return f"{bar:g}: not measured"
    return f"{bar:g}: {'met' if ratio['median'] >= bar else 'not met'}"


def speed_table(rows: list[dict[str, Any]]) -> str:
    """Every case: its rate, its ratios, and whether they meet the bars."""
    head = ["case", "bits", "steps/s", "ratio to MuJoCo ALL", "ratio to MuJoCo RIGID", "required", "aimed at"]
    lines = []
    for row in rows:
        ratios = row["ratios"]
        lines.append(
            [
                row["name"] + (f" ({row['note']})" if row["note"] else ""),
                str(row["bits"] or ""),
                _steps(row["rate"]["median"]),
                *(told(ratios[a]) if a in ratios else "" for a in ("ALL", "RIGID")),
                *(_met(row[bar], ratios.get("ALL")) for bar in ("required", "aimed")),
            ]
        )
    return table(head, lines)


def _walking(rows: list[dict[str, Any]]) -> str:
    head = [
        "scene",
        "engine",
        "hoof down",
        "mean crank speed",
        "slowest leg",
        "pitch at the end rad",
        "gap m",
    ]
    return table(
        head,
        [
            [
                row["scene"],
                row["engine"],
                *(
                    f"{100 * row[k]:.0f} %"
                    for k in ("contact_fraction", "crank_speed_mean", "crank_speed_slowest_leg")
                ),
                f"{row['pitch_rad']:.2f}",
                f"{row['closure_m']:.0e}" if "closure_m" in row else "0",
            ]
            for row in rows
        ],
    )


def _start(start: dict[str, Any]) -> str:
    cold, cached, warm = start["cold_s"], start["cached_s"], start["warm_one_leg_s"]
    rows = [[name, *(f"{s:.2f}" for s in (*cold[name], *cached[name])), ""] for name in cold if name != "all"]
    rows.append(["all", *(f"{s:.2f}" for s in (*cold["all"], *cached["all"])), _under(30, cold["all"][0])])
    rows.append(["one leg: import, first step", "", "", *map(told, warm), _under(1, warm[0]["median"])])
    head = ["in a fresh process", "compiled: wall s", "processor s", "cached: wall s", "processor s", "bar"]
    return "## Start\n\n" + table(head, rows)


def _under(bar: float, value: float) -> str:
    return f"under {bar:g}: {'met' if value < bar else 'not met'}"


def _scaling(curves: dict[str, dict[str, Any]]) -> str:
    head = ["curve", "from", "to", "largest departure from a straight line"]
    rows = [
        [title, f"{c['line_from']}", f"{c['x'][-1]}", f"{100 * c['line_error']:.0f} %"]
        for title, c in curves.items()
    ]
    return SCALING + "\n\n" + table(head, rows)


def _limits(limits: dict[str, Any]) -> list[str]:
    ceilings = limits["ceilings_per_ns"]
    rows = [[kind, *(f"{found[kind]['median']:.3g}" for found in ceilings.values())] for kind in KINDS]
    clock = f"; the clock has {told(limits['clock_GHz'])} GHz" if limits["clock_GHz"] else ""
    parts = [
        "### The machine's ceilings",
        f"Instructions a nanosecond by width in bits{clock}.",
        table(["kind", *map(str, ceilings)], rows),
        *limits["left_out"],
    ]
    if limits["widths"]:
        rows = [
            [kernel, kind, *map(str, found.values())]
            for kernel, kinds in limits["widths"].items()
            for kind, found in kinds.items()
        ]
        parts += ["### Vector width", "Instructions in the code of the kernels by width in bits."]
        parts.append(table(["kernel", "kind", *map(str, WIDTHS)], rows))
    if limits["passes"]:
        parts += ["### Stages of a step", PASSES]
    for name, found in limits["passes"].items():
        parts += [f"#### {name}", _pass(found)]
        parts.append(f"A step in the kernel: {told(found['step']['ns'], 4)} ns.")
    parts += [EXPERIMENTS] if limits["experiments"] else []
    for group, found in limits["experiments"].items():
        parts.append(table([group, "time"], [[name, told(s)] for name, s in found.items()]))
    return parts


def _pass(found: dict[str, Any]) -> str:
    head = ["stage", "ns", "instructions", "a cycle", *KINDS]
    head += [f"{bound}: share" for bound in found["step"]["of_ceiling"]]
    rows = [
        [
            name,
            f"{row['ns']['median']:.1f}",
            str(row["instructions"]),
            f"{row['per_cycle']['median']:.1f}",
            *(str(row[kind]) for kind in KINDS),
            *(f"{share['median']:.2f}" for share in row["of_ceiling"].values()),
        ]
        for name, row in (*found["rows"].items(), ("a step in the kernel", found["step"]))
    ]
    return table(head, rows)


def markdown(result: dict[str, Any]) -> str:
    """The whole page."""
    parts = [
        INTRO.format(**result),
        table(
            ["", ""], [["leg and ground", result["preset"]], *([k, v] for k, v in result["machine"].items())]
        ),
    ]
    parts += [RATIOS, speed_table(result["cases"]), *(f"- {note}" for note in result["notes"])]
    parts += [WALKING.format(steps=result["walking_steps"]), _walking(result["walking"])]
    if result["startup"]:
        parts.append(_start(result["startup"]))
    parts += [_scaling(result["scaling"]), "## What limits it", *_limits(result["limits"])]
    return "\n\n".join(parts) + "\n"

"""The tables of `speed` as Markdown."""

from __future__ import annotations

from typing import Any

from benchmarks.speed_code import KINDS
from benchmarks.speed_rounds import told

INTRO = """\
# How fast it is

Written by `make bench`; run it again for the numbers of your machine. Everything runs in one process on one
thread, interleaved: {rounds} rounds, each with every case once in a new order, {clock} time. A ratio is taken
within a round; given are the median and in brackets quartiles and extremes. Only ratios count. Stages and
costs against size are in processor time."""

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

The straight line is a fixed cost and one for each step, leg or environment. Up to six environments are run
one by one, more in tiles of 32."""

STAGES = """\
Nanoseconds per environment, each stage alone in a loop over a tile; then what it does to one environment,
in doubles, counted in its machine code, and what its operations alone, or its accesses to memory alone,
would take at the machine's ceiling."""

EXPERIMENTS = """\
### Experiments

Time per leg-step over that of the batch of 1024 legs, each at its own crank angle, in the same round."""


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
    head = ["case", "steps/s", "ratio to MuJoCo ALL", "ratio to MuJoCo RIGID", "required", "aimed at"]
    lines = []
    for row in rows:
        ratios = row["ratios"]
        lines.append(
            [
                row["name"] + (f" ({row['note']})" if row["note"] else ""),
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
    warm, cold, every = (start[f"{k}_s"] for k in ("warm_start", "first_compile", "warm_start_all_kernels"))
    rows = [
        ["import, construct, first step; cached", *map(told, warm), _under(1, warm[0]["median"])],
        ["the same with every kernel, cached", *(f"{s:.2f}" for s in every), ""],
        ["the same with every kernel, compiled", *(f"{s:.1f}" for s in cold), _under(30, cold[0])],
    ]
    return "## Start\n\n" + table(["in a fresh process", "wall time s", "processor s", "bar"], rows)


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
    ceilings = limits["ceilings_per_s"]
    rows = [[kind.replace("_", " "), told({k: v / 1e9 for k, v in ceilings[kind].items()})] for kind in KINDS]
    parts = ["### The machine's ceilings", table(["kind", "10^9 a second"], rows)]
    if "vector_instructions" in limits:
        widths = limits["vector_instructions"]
        said = ", ".join(f"{n} {'scalar' if w == 'scalar' else f'of {w} bit'}" for w, n in widths.items())
        both = "; ".join(
            f"{name} {limits[k + ' packed']} packed, {limits[k + ' scalar']} scalar"
            for k, name in (("div", "divisions"), ("sqrt", "square roots"))
        )
        parts += ["### Vector width", f"Floating-point instructions of the batch kernel: {said}. {both}."]
    middle = {kind: spread["median"] for kind, spread in ceilings.items()}
    for scene, found in limits["stages"].items():
        parts += [f"### Stages of one step: {scene}, in a batch", STAGES, _stages(found, middle)]
        shares = (told(found[k]) for k in ("division_share", "arithmetic_share", "access_share"))
        parts.append(
            "Share of the ceiling that the whole step reaches: divisions and square roots {}, other "
            "arithmetic {}, memory accesses {}.".format(*shares)
        )
    if limits["experiments"]:
        rows = [[name, told(s)] for name, s in limits["experiments"].items()]
        parts += [EXPERIMENTS, table(["changed", "time"], rows)]
    return parts


def _stages(found: dict[str, Any], ceilings: dict[str, float]) -> str:
    def line(name: str, ns: float, share: str, count: dict[str, Any]) -> list[str]:
        work = sum(count[k] / ceilings[k] for k in KINDS if k != "accesses")
        memory = count["accesses"] / ceilings["accesses"]
        counts = (str(count[k]) for k in KINDS)
        return [name, f"{ns:.2f}", share, *counts, f"{1e9 * work:.2f}", f"{1e9 * memory:.2f}"]

    rows = [line(name, r["ns"], f"{100 * r['share']:.0f} %", r) for name, r in found["rows"].items()]
    rows.append(line("all", sum(r["ns"] for r in found["rows"].values()), "", found["total"]))
    rows.append(["the whole step", told(found["whole_ns"]), *[""] * 7])
    head = ["stage", "ns", "share", *(k.replace("_", " ") for k in KINDS), "operations ns", "accesses ns"]
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

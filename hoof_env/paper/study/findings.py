"""The lead of the study's page: a few sentences, each chosen and filled from what the parts measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hoof_env.ground.normal_force import SMALLEST_RESTITUTION
from hoof_env.paper.measure import POINTS
from hoof_env.paper.published import Bar
from hoof_env.paper.reproduce import GAITS, SOLVERS, Reproduction
from hoof_env.paper.rows import counted
from hoof_env.paper.study.case import NAMES
from hoof_env.paper.study.claim import CONTRADICTED, STATUSES
from hoof_env.paper.study.conditions import LEVEL_WINDOW
from hoof_env.paper.study.laws_text import hardest_free
from hoof_env.paper.study.section import listed
from hoof_env.paper.study.slip import EFFECTS

Data = Mapping[str, Any]


def findings(reproduction: Reproduction, data: Mapping[str, Data]) -> list[str]:
    """One finding a line.

    Args:
        reproduction: the four conditions.
        data: of each part, by its short name.
    """
    return [
        _rows(reproduction),
        _numerics(reproduction, data["numerics"]),
        _laws(data["laws"]),
        _sensitivity(data["sensitivity"]),
        _slips(data["slips"]),
        _claims(data["claims"]),
        _prescribed(data["claims"], data["laws"]),
    ]


def _rows(reproduction: Reproduction) -> str:
    counts = (f"Solver `{s}`: {counted(reproduction.rows, reproduction.shapes, s)}." for s in SOLVERS)
    deepest = {
        gait: max(
            reproduction.traces[gait, "elastic", "exact"][f"{name}_penetration"].max() for name in POINTS
        )
        for gait in GAITS
    }
    depths = listed(f"{100 * deepest[gait]:.1f} cm ({NAMES[gait]})" for gait in GAITS)
    return (
        f"**One leg on one ground level** (preset `{reproduction.geometry.name}`). {' '.join(counts)} Claims "
        f"count in the readings of reproduction.md. The hoof sinks by {depths}."
    )


def _numerics(reproduction: Reproduction, data: Data) -> str:
    counts = {
        name: sum(
            _moved(reproduction.published.row(row).bar, values[name][0], values["exact"])
            for row, values in data["rows"].items()
        )
        for name in data["betas"]
    }
    words = listed(f"{count} rows ({name} β)" for name, count in counts.items())
    verdict = (
        "the paper's integration is part of its numbers"
        if max(counts.values())
        else "the paper's integration does not touch its numbers"
    )
    low, high = (data["conditions"]["walk.peak_inelastic"]["exact"]["ground"][end] for end in ("low", "high"))
    spike = (
        ""
        if None in (low, high)
        else " The inelastic walking peak hangs on the ground level: within "
        f"±{1e3 * LEVEL_WINDOW:g} mm the exact one runs from {low:.0f} to {high:.0f} N."
    )
    return f"**Method.** Euler at 1 ms alone moves {words} further than their bar: {verdict}.{spike}"


def _moved(bar: Bar, value: float | None, exact: float | None) -> bool:
    """Whether a value is further than a bar from the exact one; None is a leg without that feature."""
    if value is None or exact is None:
        return bar.limit is not None and value is not exact
    return bar.holds(bar.error(value, exact)) is False


def _laws(data: Data) -> str:
    by_law = data["exponents"][data["exponent"]]["laws"]
    paper, true = by_law[data["paper_law"]], by_law["exact"]
    k = paper["nominal"].index(data["paper_restitution"])
    honest = {f"{cr:g}": _nearest(true["nominal"], cr) for cr in (0.5, SMALLEST_RESTITUTION)}
    e = paper["delivered"][k]
    ours = listed(f"{paper[gait]['reduction'][k]:.1f} % ({NAMES[gait]})" for gait in GAITS)
    by_cr = {cr: [f"{true[gait]['reduction'][at]:.1f} %" for gait in GAITS] for cr, at in honest.items()}
    others = listed(f"{listed(both)} (e = {cr})" for cr, both in by_cr.items())
    inelastic = "is not inelastic" if e > 0.1 else "is nearly inelastic"
    return (
        f"**Law.** The paper's 'inelastic' ground {inelastic}: a free impact on it rebounds with e = "
        f"{e:.2f}. Elastic peaks are lower by {ours} under it, and by {others} against grounds that "
        "return what they say."
    )


def _nearest(values: Sequence[float], wanted: float) -> int:
    return min(range(len(values)), key=lambda k: abs(values[k] - wanted))


def _sensitivity(data: Data) -> str:
    rise = {gait: data["rows"][f"{gait}.peak_elastic"]["ground_level"]["change"] for gait in GAITS}
    words = listed(f"{rise[gait]:+.1f} % ({NAMES[gait]})" for gait in GAITS)
    paces = listed(f"{factor} times" for factor in data["speed"])
    most = 100 * max(by["normal"] for by in data["speed"].values())
    pace = "no normal force at all" if most < 0.05 else f"normal forces by up to {most:.1f} %"
    return (
        f"**Sensitivity.** The ground level, which is not printed, moves the elastic peaks by {words} for 1 "
        f"mm. {paces} the crank speed change {pace}: Eq. 14 knows the speed of impact only against the "
        "speed in stance."
    )


def _slips(data: Data) -> str:
    effects = [slip["effect"] for slip in data["slips"]]
    counts = listed(f"{effects.count(effect)} {effect}" for effect in EFFECTS if effect in effects)
    return f"**Print.** Of {len(effects)} slips taken by the letter {counts}."


def _claims(data: Data) -> str:
    status = [claim["status"] for claim in data["claims"]]
    counts = "; ".join(f"{name}: {status.count(name)}" for name in STATUSES if name in status)
    asked = sum(bool(claim["asked"]) for claim in data["claims"])
    against = [f"`{claim['id']}`" for claim in data["claims"] if claim["status"] == CONTRADICTED]
    return (
        f"**Text.** {len(status)} claims, {asked} of them asked for in the identification at least in part: "
        f"{counts}. Contradicted: {listed(against)}."
    )


def _prescribed(data: Data, laws: Data) -> str:
    """What the fixed trunk does to the paper's main comparison."""
    claim = next(claim for claim in data["claims"] if claim["id"] == "reduction")
    ratio = claim["data"]["free_impact_ratio"]
    lowered = any(
        f["holds"] for f in claim["findings"] if f["reading"].startswith("the damping of the contact")
    )
    prescribed = "lowers" if lowered else "raises"
    free = (
        f"lowers it by {100 * (1 - ratio):.0f} %" if ratio < 1 else f"raises it by {100 * (ratio - 1):.0f} %"
    )
    verdict = (
        "the comparison of elastic with inelastic ground is one of the prescribed motion, not of the ground"
        if lowered != (ratio < 1)
        else "both agree"
    )
    below = hardest_free(laws["exponents"][laws["exponent"]]["laws"]["exact"])
    limit = f" Damping so strong that e < {below:.2f} raises the peak of a free mass too." if below else ""
    return (
        "**Prescribed motion.** On the fixed trunk, where crank and ground meet without giving way, "
        f"damping {prescribed} the peak; under a free mass the same law {free}: {verdict}.{limit}"
    )

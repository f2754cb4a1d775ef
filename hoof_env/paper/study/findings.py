"""The lead of the study's page: a few sentences, each chosen and filled from what the parts measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hoof_env.ground.normal_force import SMALLEST_RESTITUTION
from hoof_env.paper.published import Bar
from hoof_env.paper.reproduce import GAITS, SOLVERS, Reproduction
from hoof_env.paper.rows import counted
from hoof_env.paper.study.case import NAMES
from hoof_env.paper.study.claim import CONTRADICTED, STATUSES
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
        _prescribed(data["claims"]),
    ]


def _rows(reproduction: Reproduction) -> str:
    counts = (f"Solver `{s}`: {counted(reproduction.rows, reproduction.shapes, s)}." for s in SOLVERS)
    return f"**One leg on one ground level** (preset `{reproduction.geometry.name}`). {' '.join(counts)}"


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
    return f"**Method.** Euler at 1 ms alone moves {words} further than their bar: {verdict}."


def _moved(bar: Bar, value: float | None, exact: float | None) -> bool:
    """Whether a value is further than a bar from the exact one; None is a leg without that feature."""
    if value is None or exact is None:
        return bar.limit is not None and value is not exact
    return bar.holds(bar.error(value, exact)) is False


def _laws(data: Data) -> str:
    by_law = data["exponents"][data["exponent"]]["laws"]
    paper, true = by_law[data["paper_law"]], by_law["exact"]
    k = paper["nominal"].index(data["paper_restitution"])
    low = true["nominal"].index(SMALLEST_RESTITUTION)
    e = paper["delivered"][k]
    ours = listed(f"{paper[gait]['reduction'][k]:.0f} % ({NAMES[gait]})" for gait in GAITS)
    others = listed(f"{true[gait]['reduction'][low]:.0f} %" for gait in GAITS)
    inelastic = "is not inelastic" if e > 0.1 else "is nearly inelastic"
    return (
        f"**Law.** The paper's 'inelastic' ground {inelastic}: a free impact on it rebounds with e = "
        f"{e:.2f}. Elastic peaks are lower by {ours} under it, and by {others} against a ground that "
        f"returns e = {SMALLEST_RESTITUTION:g}."
    )


def _sensitivity(data: Data) -> str:
    rise = {gait: data["rows"][f"{gait}.peak_elastic"]["ground_level"]["change"] for gait in GAITS}
    words = listed(f"{rise[gait]:+.1f} % ({NAMES[gait]})" for gait in GAITS)
    paces = listed(f"{factor} times" for factor in data["speed"])
    most = 100 * max(abs(change) for by in data["speed"].values() for change in by.values())
    pace = "no force at all" if most < 0.05 else f"forces by up to {most:.1f} %"
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


def _prescribed(data: Data) -> str:
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
    return (
        "**Prescribed motion.** On the fixed trunk, where crank and ground meet without giving way, "
        f"damping {prescribed} the peak; under a free mass the same law {free}: {verdict}."
    )

"""Every slip of the paper's print, and what changes if it is taken literally: a part of the study."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.reproduce import GAITS, Reproduction, reproduce
from hoof_env.paper.study.figures_slips import draw_drift, draw_literal_forces
from hoof_env.paper.study.printed_rows import ROWS
from hoof_env.paper.study.section import Section, listed, table
from hoof_env.paper.study.slip import EFFECTS, Slip
from hoof_env.paper.study.slips_contact import SOLVER, contact_slips
from hoof_env.paper.study.slips_friction import friction_slips
from hoof_env.paper.study.slips_linkage import linkage_slips
from hoof_env.paper.study.slips_motion import drifts, motion_slips
from hoof_env.paper.study.slips_results import result_slips

TITLE = "Slips of the print"


def examine_slips(
    preset: str | None, progress: Callable[[str], None], reproduction: Reproduction | None = None
) -> Section:
    """Take every slip at its word and measure what follows.

    Args:
        preset: leg and gaits; the default if None.
        progress: called with a line now and then.
        reproduction: the four conditions of this preset, if they are at hand.

    Raises:
        HoofEnvError: an unknown preset, or an integration that diverged.
    """
    result = reproduction or reproduce(progress, preset=preset)
    traces = {
        (gait, condition): result.traces[gait, condition, SOLVER]
        for gait in GAITS
        for condition in CONDITIONS
    }
    progress("slips: Eq. 2 as printed")
    slips = linkage_slips(result.geometry)
    progress("slips: Eq. 8 with gamma as printed")
    cycles = drifts(preset)
    slips += motion_slips(preset, cycles) + contact_slips(traces, result.published, result.ground)
    slips += friction_slips(traces) + result_slips(result)
    return Section(
        TITLE,
        _markdown(slips),
        {"slips": [asdict(slip) for slip in slips]},
        {
            "slips_drift": lambda: draw_drift(cycles),
            "slips_forces": lambda: draw_literal_forces(traces, result.ground),
        },
    )


def _with(slips: Sequence[Slip], effect: str) -> list[Slip]:
    return [slip for slip in slips if slip.effect == effect]


def _summary(slips: Sequence[Slip]) -> str:
    counts = [f"{len(_with(slips, effect))} {effect}" for effect in EFFECTS]
    worst = dict.fromkeys(slip.where for slip in _with(slips, EFFECTS[0]))
    return (
        f"Of {len(slips)} slips, each taken by its letter and run on the preset's leg, {listed(counts)}. "
        f"The first kind: {'; '.join(worst) or 'none'}."
    )


def _markdown(slips: Sequence[Slip]) -> str:
    parts = [
        _summary(slips),
        "The paper's text was read, not its figures; an index or a sign may have been lost on the way to "
        "the text. Forces are normal forces with solver `exact` unless said otherwise; 'as read' is what "
        "the rest of this project computes.",
    ]
    for effect in EFFECTS:
        found = _with(slips, effect)
        if found:
            parts += [f"### {effect.capitalize()}", "\n".join(_entry(slip) for slip in found)]
        if effect == EFFECTS[0]:
            parts += _misfit_table(slips)
    parts += [
        "![Crank error and widest joint gap under γ as printed](slips_drift.png)",
        "![Ground forces by the letter of Eqs. 11 and 15](slips_forces.png)",
    ]
    return "\n\n".join(parts)


def _entry(slip: Slip) -> str:
    return (
        f"- **{slip.where}** (`{slip.id}`)\n"
        f"  - printed: {slip.printed}\n"
        f"  - must be: {slip.read_as}\n"
        f"  - why: {slip.why}\n"
        f"  - by the letter: {slip.literal}"
    )


def _misfit_table(slips: Sequence[Slip]) -> list[str]:
    data: dict[str, Any] = next(slip.data for slip in slips if slip.id == "eq2.rows")
    rows = [
        [number, f"`{ROWS[int(number)]}`", f"{100 * value:.1f}"]
        for number, value in sorted(data["largest_m"].items(), key=lambda item: int(item[0]))
    ]
    return [
        "Printed rows of Eq. 2 that the decoded leg does not meet, with the largest value over a "
        "revolution [cm]; all other printed rows vanish to round-off:",
        table(["row", "in print", "largest value [cm]"], rows),
    ]

"""Claims about the size of the ground force."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from hoof_env.ground.normal_force import lankarani_nikravesh
from hoof_env.paper.measure import POINTS
from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.solvers import EULER
from hoof_env.paper.study.case import NAMES, Case, Trace, by_solver
from hoof_env.paper.study.claim import PUBLISHED, Examined, Finding
from hoof_env.paper.study.laws import free_peak
from hoof_env.paper.study.replay import replay
from hoof_env.paper.study.section import listed
from hoof_env.paper.study.slips_contact import over_cycle

FREE_MASS = "free mass"
"""In place of a solver: a mass thrown at the ground, computed beside the leg."""

SAME_WEIGHT = 0.1
"""Two gaits carry the same weight if their mean forces agree within this part [-]."""


def force_claims(case: Case) -> Iterable[Examined]:
    """The claims about the size of the force, in the order of the text."""
    return _stiffness(case), _reduction(case), _body_weight(case)


def _peak(trace: Trace) -> float:
    return float(trace["normal"].max())


def on_ground(case: Case, gait: str, solver: str, **settings: Any) -> Trace:
    """The elastic cycle of a solver on another ground."""
    approach = "sampled" if solver in EULER else "interpolated"
    return replay(case.trace(gait, solver), replace(case.reproduction.ground, approach=approach, **settings))


def _stiffness(case: Case) -> Examined:
    def softer(solver: str) -> tuple[bool, str]:
        twice = 2 * case.reproduction.ground.stiffness
        ratios = {
            gait: _peak(on_ground(case, gait, solver, stiffness=twice)) / _peak(case.trace(gait, solver))
            for gait in GAITS
        }
        words = listed(f"{ratio:.2f} ({NAMES[gait]})" for gait, ratio in ratios.items())
        return max(ratios.values()) <= 1, f"twice the stiffness makes the elastic peaks {words} times as high"

    findings = by_solver("a stiffer ground does not raise the force", softer)
    rises = not any(finding.holds for finding in findings)
    return Examined(
        "stiffness",
        "to prevent an unnatural rise of ground reaction force, the stiffness is no smaller than 2×10^4 N/m",
        "section 3",
        "sensitivity_map",
        findings,
        "Under prescribed motion force grows with stiffness: a lower limit prevents no rise."
        if rises
        else "",
    )


def _reduction(case: Case) -> Examined:
    def lower(solver: str) -> tuple[bool, str]:
        values = {gait: case.row(f"{gait}.reduction", solver)["simulated"] for gait in GAITS}
        words = listed(f"{values[gait]:.1f} % lower in {NAMES[gait]}" for gait in GAITS)
        return min(values.values()) > 0, f"elastic peaks are {words}"

    def damping(solver: str) -> tuple[bool, str]:
        peaks = {
            gait: [_peak(case.trace(gait, solver, condition)) for condition in CONDITIONS] for gait in GAITS
        }
        absorbed = {gait: _absorbed(case.trace(gait, solver, "inelastic")) for gait in GAITS}
        words = listed(
            f"{NAMES[gait]} {one:.0f} N without and {two:.0f} N with it" for gait, (one, two) in peaks.items()
        )
        energy = listed(f"{absorbed[gait]:.0f} J in {NAMES[gait]}" for gait in GAITS)
        return all(
            two < one for one, two in peaks.values()
        ), f"peak {words}; the damper absorbs {energy} a cycle"

    free = free_peak(lankarani_nikravesh(0.0), case.reproduction.ground.exponent)
    findings = (
        *by_solver(
            "the elastic peak is lower than the inelastic one",
            lower,
            case.asked("walk.reduction", "run.reduction"),
        ),
        *by_solver("the damping of the contact lowers the peak", damping),
        Finding(
            "the same damping under a mass that the ground can stop lowers the peak",
            FREE_MASS,
            free < 1,
            f"cr = 0 makes the highest force {free:.3f} times that of cr = 1, whatever mass, stiffness and "
            "speed",
        ),
    )
    return Examined(
        "reduction",
        "significant reduction ... with respect to the viscoelastic contact ... 61.35 % ... 34.22 %; a "
        "soft grounding effectively reduces the ground reaction force",
        "sections 3, 4",
        "figure5",
        findings,
        _damper_note(case, free),
        {"free_impact_ratio": free},
    )


def _damper_note(case: Case, free: float) -> str:
    """What the printed ratios of the peaks ask of the motion, and what a free mass would do."""
    most = 1 + lankarani_nikravesh(0.0)
    ratios = {
        gait: case.published.row(f"{gait}.peak_inelastic").value
        / case.published.row(f"{gait}.peak_elastic").value
        for gait in GAITS
    }
    above = [NAMES[gait] for gait, ratio in ratios.items() if ratio > most]
    words = listed(f"{ratio:.2f} in {NAMES[gait]}" for gait, ratio in ratios.items())
    faster = f"; in {listed(above)} the hoof must sink faster than it touched down" if above else ""
    artefact = (
        " That the elastic condition is the gentler one comes from prescribing the motion."
        if free < 1
        else ""
    )
    return (
        "Under prescribed motion the damper only adds force while the hoof sinks: at touch-down speed Eq. "
        f"14 with cr = 0 has {most:.2f} times the elastic force. The printed peaks have "
        f"{words}{faster}.{artefact}"
    )


def _absorbed(trace: Trace) -> float:
    """Work that the leg's normal forces lose in the ground over a cycle [J]."""
    power = np.asarray(sum(trace[f"{name}_normal"] * trace[f"{name}_rate"] for name in POINTS))
    return over_cycle(trace, power)


def _body_weight(case: Case) -> Examined:
    def carried(mean: Callable[[str, str], float]) -> tuple[bool, str]:
        parts, same = [], True
        for condition in CONDITIONS:
            walk, run = (mean(gait, condition) for gait in GAITS)
            same = same and abs(run / walk - 1) <= SAME_WEIGHT
            parts.append(
                f"{condition} {walk:.0f} N ({walk / 9.81:.1f} kg) and {run:.0f} N ({run / 9.81:.0f} kg)"
            )
        return same, f"walking and running: {'; '.join(parts)}"

    reading = (
        "a leg that bears the same part of the weight has the same mean force over the cycle in both gaits"
    )
    return Examined(
        "body.weight",
        "multiple point support occurring in which hoof loaded the body weight at mid-stance",
        "section 3",
        "figure5",
        (
            Finding(reading, PUBLISHED, *carried(lambda g, c: case.published.row(f"{g}.mean_{c}").value)),
            *by_solver(
                reading,
                lambda solver: carried(lambda g, c: float(case.row(f"{g}.mean_{c}", solver)["simulated"])),
                case.asked(*(f"{gait}.mean_{condition}" for gait in GAITS for condition in CONDITIONS)),
            ),
        ),
        "On a fixed trunk nothing is carried: the force follows from how deep the path lies.",
    )

"""The ground and the solvers of a reproduction in words, and why one reading of beta counts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from hoof_env.ground.preset import HERTZ
from hoof_env.paper.measure import hoof_error, measure_stance
from hoof_env.paper.published import Published
from hoof_env.paper.solvers import EULER, EXACT, PRINTED, PROBABLE, betas, slowest_root

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction


def listed(items: Iterable[str], last: str = "and") -> str:
    """'a', 'a and b', 'a, b and c'; 'none' without items."""
    *first, end = list(items) or ["none"]
    return f"{', '.join(first)} {last} {end}" if first else end


def ground_text(reproduction: Reproduction) -> str:
    """On what the leg stands, beside what the paper prints of it."""
    ground, printed = reproduction.ground, reproduction.published.parameters["stiffness"]
    return (
        f"The preset's ground has K = {ground.stiffness:g} N/mⁿ and n = {ground.exponent:g} in Eq. 14; the "
        f"paper gives K as 'no smaller than' {printed:g} and does not print n (Lankarani and Nikravesh's is "
        f"{HERTZ:g})."
    )


def solvers_text(published: Published) -> str:
    """What the names of the solvers mean."""
    by_name = betas(published)
    return (
        f"Solvers `{PRINTED}` and `{PROBABLE}` are the paper's Eq. 8 with its Baumgarte terms and explicit "
        f"Euler at {1e3 * published.parameters['time_step_s']:g} ms, the first with β = √(2α) = "
        f"{by_name[EULER[PRINTED]]:.2f} 1/s as printed, the second with β = √2 α = "
        f"{by_name[EULER[PROBABLE]]:.1f} 1/s as probably meant. Solver `{EXACT}` is the same motion in "
        "closed form, at a step at which its results have converged."
    )


def which_beta(reproduction: Reproduction) -> str:
    """Why the bar asks for the probable beta, with what both do in this run."""
    published = reproduction.published
    alpha, by_name = published.parameters["baumgarte_alpha"], betas(published)
    duration = published.parameters["duration_s"]
    roots = {name: slowest_root(alpha, beta) for name, beta in by_name.items()}
    decay = listed(
        f"{root:.2f} 1/s ({name} β; {100 * math.exp(root * duration):.2g} % of an error is left at the end)"
        for name, root in roots.items()
    )
    drifts = {name: largest_drift(reproduction, solver) for solver, name in EULER.items()}
    drift = listed(
        f"{1e3 * a:.2f} mm, {1e3 * b:.2f} mm in stance ({name} β)," for name, (a, b) in drifts.items()
    )
    within = {solver: _within(reproduction, solver) for solver in EULER}
    rows = listed(f"{met} of {barred} ({EULER[solver]} β)" for solver, (met, barred) in within.items())
    met = [EULER[solver] for solver, (inside, barred) in within.items() if inside == barred]
    verdict = {
        0: "This leg meets all of them with neither",
        1: f"This leg meets all of them with the {met[0] if met else ''} β only",
        2: "This leg meets all of them with both",
    }[len(met)]
    damping = alpha / by_name["probable"]
    return (
        f"**Which β.** The printed √(2α) is no rate if α is one; √2 α, a damping of {damping:.2f}, is a "
        f"usual choice. A closure error decays by the roots of s² + 2αs + β² = 0, over a run of "
        f"{duration:g} s: the slowest is {decay}. In this run toe or heel is up to {drift} from where "
        f"the exact solver has it at the same instant, and within their bar are {rows} of the rows that "
        f"have one. {verdict}. Drift that survives the run is part of every number that comes out of it and "
        f"no property of a leg; so where a bar is asked of the paper's solver the column `{PROBABLE}` "
        f"counts, and `{PRINTED}` stands beside it."
    )


def largest_drift(reproduction: Reproduction, solver: str) -> tuple[float, float]:
    """Largest distance of toe or heel from the exact motion over both gaits [m]: in the cycle, in stance."""
    cycle, stance = [], []
    for gait in {gait for gait, _, _ in reproduction.traces}:
        trace, exact = (reproduction.traces[gait, "elastic", name] for name in (solver, EXACT))
        error, on_ground = hoof_error(trace, exact), measure_stance(exact)
        inside = (trace["time"] >= on_ground.start) & (trace["time"] <= on_ground.end)
        cycle.append(float(error.max()))
        stance.append(float(error[inside].max()))
    return max(cycle), max(stance)


def _within(reproduction: Reproduction, solver: str) -> tuple[int, int]:
    """Rows within their bar, and rows that have one."""
    judged = [row["within_bar"] for row in reproduction.rows if row["solver"] == solver]
    return judged.count(True), len(judged) - judged.count(None)

"""Claims about where the ground force points, and what it does to the body."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hoof_env.paper.measure import integral
from hoof_env.paper.reproduce import GAITS, SOLVERS
from hoof_env.paper.shapes import half_impulses
from hoof_env.paper.study.case import Case, by_solver
from hoof_env.paper.study.claim import Examined
from hoof_env.paper.study.section import listed
from hoof_env.paper.study.slips_friction import friction_power


def direction_claims(case: Case) -> Iterable[Examined]:
    """The claims about direction, in the order of the text."""
    return _braking(case), _propulsion(case), _stabilises(case)


def _friction_opposes(case: Case, gait: str, solver: str) -> tuple[bool, str]:
    trace = case.trace(gait, solver)
    worst = float(friction_power(trace).max())
    return worst <= 0, f"power of the friction on the hoof never above {worst:.1g} W"


def _signs(case: Case, gait: str, solver: str, sign: int) -> tuple[bool, str]:
    """Whether `sign` times the force brakes (walking) or propels (running) in both halves of stance."""
    halves = half_impulses(case.trace(gait, solver), case.stance(gait, solver))
    wanted = -1 if gait == "walk" else 1
    words = " and ".join(f"{sign * along:+.1f} N s" for along, _ in halves)
    return all(
        wanted * sign * along > 0 for along, _ in halves
    ), f"{words} in the halves of stance (forward positive)"


def _one_way(case: Case, solver: str) -> tuple[bool, str]:
    """Whether the horizontal force on the walking leg keeps its sign, by its impulses of either sign."""
    trace, stance = case.trace("walk", solver), case.stance("walk", solver)
    back, on = (
        integral(trace, np.clip(sign * trace["friction"], 0, None), stance.start, stance.end)
        for sign in (-1, 1)
    )
    return min(back, on) <= ONE_WAY * (back + on), (
        f"on the leg {back:.1f} N s backward and {on:.1f} N s forward"
    )


ONE_WAY = 0.02
"""A force goes one way if no more than this part of its impulse goes the other [-]."""

ON_THE_LEG, ON_THE_GROUND = "force of the ground on the leg", "force of the hoof on the ground"


def _braking(case: Case) -> Examined:
    findings = (
        *by_solver(
            f"{ON_THE_LEG}, backward in both halves of stance",
            lambda solver: _signs(case, "walk", solver, 1),
            case.asked("walk.direction"),
        ),
        *by_solver(
            f"{ON_THE_GROUND}, backward in both halves of stance",
            lambda solver: _signs(case, "walk", solver, -1),
            case.asked("walk.direction"),
        ),
        *by_solver(
            "one way through the whole stance, forward or backward", lambda solver: _one_way(case, solver)
        ),
        *by_solver("against the hoof's own sliding", lambda solver: _friction_opposes(case, "walk", solver)),
    )
    return Examined(
        "walk.direction",
        "braking force in walking trajectory because ... ground reaction force was directed to the against "
        "moving direction",
        "section 3, figure 6",
        "claims_direction",
        findings,
        _together(case),
    )


def _together(case: Case) -> str:
    """Which sign of the force gives braking in walking and propulsion in running at once."""
    signs = {ON_THE_LEG: 1, ON_THE_GROUND: -1}
    both = [
        name
        for name, sign in signs.items()
        if all(_signs(case, gait, solver, sign)[0] for gait in GAITS for solver in SOLVERS)
    ]
    return (
        f"Walking brakes and running propels throughout under: {listed(both)}. Sliding friction opposes "
        "sliding in every reading, so this one says nothing."
    )


def _propulsion(case: Case) -> Examined:
    return Examined(
        "run.direction",
        "slight rotation of force vector ... in running gait which indicates the propulsive directional "
        "force",
        "section 3, figure 6",
        "claims_direction",
        (
            *case.judged("run.direction", f"{ON_THE_LEG}, turning forward in the second half of stance"),
            *by_solver(
                f"{ON_THE_LEG}, forward in both halves of stance",
                lambda solver: _signs(case, "run", solver, 1),
                case.asked("run.direction", "walk.walks"),
            ),
            *by_solver(
                f"{ON_THE_GROUND}, forward in both halves of stance",
                lambda solver: _signs(case, "run", solver, -1),
                case.asked("run.direction", "walk.walks"),
            ),
        ),
    )


def _stabilises(case: Case) -> Examined:
    travel = max(float(np.ptp(case.trace(gait, solver)["trunk_y"])) for gait in GAITS for solver in SOLVERS)
    return Examined(
        "walk.stabilises",
        "wheel-like rolling motion of the hoof support and stabilizes the body in mid-stance",
        "section 4",
        "",
        by_solver(
            "the body is held up and steadied",
            lambda solver: (
                None,
                f"the trunk is fixed, it moves by {1000 * travel:.1f} mm: there is nothing to steady",
            ),
        ),
    )

"""Slips of Eqs. 2 and 3: the printed constraint rows, assembled as they stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.dynamics.constraints import SIZE, Constraints, closed_form
from hoof_env.dynamics.engine import GRAVITY
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import pose
from hoof_env.leg.linkage import BODIES, FRAME, JOINTS
from hoof_env.paper.study.printed_rows import (
    ROWS,
    Assembly,
    assemble,
    at_rest,
    misfits,
    printed_jacobian,
    row_index,
)
from hoof_env.paper.study.section import listed
from hoof_env.paper.study.slip import CHANGES, HARMLESS, IMPOSSIBLE, Slip

ROUND_OFF = 1e-9
"""Rows that stay below this [m, rad] are met."""

EQ3_ROWS = 22
"""Number of rows of the Jacobian as Eq. 3 prints it."""

LOST = tuple(number for number in range(1, SIZE + 1) if number not in ROWS)

ROCKER_REVERSED = {34: "x12 + L10 cos12 - 2L81 cos8 - Cx", 35: "y12 + L10 sin12 - 2L81 sin8 - Cy"}
"""Rows 34 and 35 for a link 8 that starts at C: A lies beyond C."""


def linkage_slips(geometry: Geometry) -> list[Slip]:
    """The slips of Eqs. 2 and 3 on one leg."""
    return [
        _lost_rows(geometry),
        _rocker(geometry),
        _strut(geometry),
        _tie_rod(geometry),
        _sole(geometry),
        _wording(),
        _jacobian_size(geometry),
    ]


def _spans(geometry: Geometry, one: str, two: str, angles: int = 360) -> tuple[float, float]:
    """Smallest and largest distance of two named points over a revolution [m]; A* is A mirrored at C."""
    distances = []
    for theta in np.arange(angles) / angles * 2 * np.pi:
        at = pose(geometry, theta)
        points = [
            2 * at.point("C") - at.point("A") if name == "A*" else at.point(name) for name in (one, two)
        ]
        distances.append(float(np.hypot(*(points[0] - points[1]))))
    return min(distances), max(distances)


def _outcome(assembly: Assembly) -> tuple[str, str]:
    """In words, and the effect."""
    if assembly.closed == 1:
        turned = assembly.turned_deg or 0.0
        return (
            f"the loops close at every crank angle, with links turned by up to {turned:.0f} deg",
            CHANGES if turned > 1 else HARMLESS,
        )
    where = (
        "the loops close at no crank angle:"
        if assembly.closed == 0
        else f"the loops close at {100 * assembly.closed:.0f} % of the crank angles only, elsewhere"
    )
    return (
        f"{where} up to {100 * assembly.gap:.1f} cm stay open, and the rank "
        f"of the Jacobian is {assembly.rank} of {SIZE}",
        IMPOSSIBLE,
    )


def _facts(assembly: Assembly) -> dict[str, Any]:
    return dict(vars(assembly))


def _lost_rows(geometry: Geometry) -> Slip:
    largest = misfits(geometry)
    wrong = {number: value for number, value in largest.items() if value > ROUND_OFF}
    rank = int(np.linalg.matrix_rank(printed_jacobian(geometry, 1.0)))
    free = SIZE - rank
    return Slip(
        "eq2.rows",
        "Eq. 2",
        f"'42' under the column, and {len(ROWS)} rows in it",
        f"42 rows: 20 joints, one lock, one driver; {listed(map(str, LOST))} restored",
        "the joints of the drawing need them",
        f"the {len(ROWS)} printed rows have rank {rank} in {SIZE} unknowns: {free} freedoms stay and the "
        f"crank does not fix the leg. On the decoded leg {len(ROWS) - len(wrong)} printed rows vanish to "
        f"round-off; {listed(map(str, sorted(wrong)))} are off, at worst by "
        f"{100 * min(wrong.values(), default=0):.0f} to {100 * max(wrong.values(), default=0):.0f} cm "
        "(below)",
        IMPOSSIBLE if free else HARMLESS,
        {
            "printed_rows": len(ROWS),
            "rank": rank,
            "free": free,
            "largest_m": {str(k): v for k, v in wrong.items()},
        },
    )


def _rocker(geometry: Geometry) -> Slip:
    literal = assemble(geometry, {21: "x8 - L8 cos8 - Cx", 22: ROWS[22]})
    words, effect = _outcome(literal)
    strut, span = geometry.lengths["PF"], _spans(geometry, "P", "C")
    beyond = assemble(geometry, ROCKER_REVERSED)
    reach, rod = _spans(geometry, "G", "A*"), geometry.lengths["AJ"]
    hoof = geometry.lengths["GJ"]
    low, high = max(reach[1] - hoof, hoof - reach[0]), reach[0] + hoof
    sized = (
        f"a tie rod between {low:.2f} and {high:.2f} m (the identified one has {rod:.2f} m) would let it "
        "turn, so the print alone does not exclude it"
        if low < high
        else "no length of the tie rod would let it turn with this hoof"
    )
    return Slip(
        "eq2.rocker",
        "Eq. 2, rows 21-22",
        f"`{ROWS[22]}` (the x row is lost): tail of link 8 at C",
        "`y8 + L8 sin8 - Cy`: its head",
        "rows 19-20 put the tail at F already",
        f"F falls on C, and the strut of {strut:.2f} m must span P to C, {span[0]:.2f} to {span[1]:.2f} m: "
        f"{words}. Turning link 8 round instead, so that A lies beyond C: {_outcome(beyond)[0]}; {sized}",
        effect,
        {
            "literal": _facts(literal),
            "strut_m": strut,
            "P_to_C_m": span,
            "A_beyond_C": _facts(beyond),
            "tie_rod_m": rod,
            "tie_rod_that_turns_m": [low, high],
        },
    )


def _strut(geometry: Geometry) -> Slip:
    literal = assemble(geometry, {number: ROWS[number] for number in (23, 24)})
    repaired = assemble(geometry, {23: "x9 + L9 cos9 + L6 cos6 - 2L5 cos5 - Cx", 24: ROWS[24]})
    words, effect = _outcome(literal)
    return Slip(
        "eq2.strut",
        "Eq. 2, rows 23-24",
        f"`{ROWS[23]}`, `{ROWS[24]}`",
        "head of link 9 at F: `x9 + L9 cos9 - x7 + L7 cos7` and its y row (an assumption, Jansen's)",
        "the x row mixes axes (sin5, Cy); with cos5 and Cx the chain C + 2 L5 e5 - L6 e6 ends at the "
        "middle of link 6",
        f"as it stands {words}. With the axes repaired, the strut at the middle of link 6: "
        f"{_outcome(repaired)[0]}. The lengths were identified for F, so this does not exclude another leg",
        effect,
        {"literal": _facts(literal), "middle_of_link_6": _facts(repaired)},
    )


def _tie_rod(geometry: Geometry) -> Slip:
    literal = assemble(geometry, {number: ROWS[number] for number in (32, 34)})
    words, effect = _outcome(literal)
    return Slip(
        "eq2.tie_rod",
        "Eq. 2, rows 32 and 34",
        f"`{ROWS[32]}`, `{ROWS[34]}`",
        "`x12 - L10 cos12 - x11 - L11 cos11`, `x12 + L10 cos12 + 2L81 cos8 - Cx`",
        "x coordinates set equal to y coordinates of J and of A",
        words,
        effect,
        _facts(literal),
    )


def _sole(geometry: Geometry) -> Slip:
    rows: Mapping[int, str] = {number: ROWS[number] for number in (38, 39, 40, 41)}
    literal = assemble(geometry, rows)
    words, effect = _outcome(literal)
    column = [row for row, text in ROWS.items() if "cos14" in text or "sin14" in text]
    legs = geometry.lengths["GJ"], geometry.lengths["GI"]
    return Slip(
        "eq2.sole",
        "Eq. 2, rows 38-41",
        f"θ13 for θ14, and `{ROWS[40]}`",
        "θ14, and `x14 + L13 cos14 - x12 + L10 cos12`",
        "link 14 is the sole, from I to J",
        f"θ14 stands in {len(column)} rows, its column of the Jacobian is zero; rows 38 to 41 put I on J, "
        f"whose distances from the ankle are {legs[0]:.2f} and {legs[1]:.2f} m: {words}",
        effect,
        {**_facts(literal), "rows_with_th14": len(column), "GJ_m": legs[0], "GI_m": legs[1]},
    )


def _wording() -> Slip:
    fixed = 2 * sum(joint.j == FRAME for joint in JOINTS)
    return Slip(
        "eq2.wording",
        "below Eq. 2",
        "'the first 41 elements ... between body and fixed ground node'",
        f"{fixed} of them do, the others join two bodies",
        "as the rows show",
        f"{fixed} of 41 rows hold a fixed point; words only",
        HARMLESS,
        {"rows_on_the_frame": fixed},
    )


def _jacobian_size(geometry: Geometry) -> Slip:
    motion = at_rest(1.0)
    q, _ = closed_form(geometry, motion)
    closure = Constraints(geometry)(q, np.zeros(SIZE), motion)
    order = [row_index(number) for number in range(1, SIZE + 1)]
    jacobian = closure.jacobian[order]
    full, kept = (int(np.linalg.matrix_rank(jacobian[:rows])) for rows in (SIZE, EQ3_ROWS))
    falling = _free_fall(geometry, jacobian[:EQ3_ROWS])
    return Slip(
        "eq3.size",
        "Eq. 3",
        f"Φ_q of {EQ3_ROWS} x 42",
        "42 x 42",
        "Eq. 2 has 42 rows",
        f"all rows have rank {full}; the first {EQ3_ROWS} rank {kept}, which leaves {SIZE - kept} freedoms, "
        f"the crank's among them. Solving Eq. 8 with them drops links {listed(map(str, falling))} in free "
        "fall, the hoof included",
        IMPOSSIBLE if kept < SIZE else HARMLESS,
        {"rank": full, "rank_of_22": kept, "links_in_free_fall": falling},
    )


def _free_fall(geometry: Geometry, jacobian: Any) -> list[int]:
    """Numbers of the links that accelerate by exactly g under Eq. 8 with these rows alone, from rest."""
    rows = len(jacobian)
    masses, inertias = geometry.body_masses, geometry.body_inertias
    system = np.zeros((SIZE + rows, SIZE + rows))
    system[:SIZE, :SIZE] = np.diag(np.column_stack([masses, masses, inertias]).ravel())
    system[SIZE:, :SIZE], system[:SIZE, SIZE:] = jacobian, jacobian.T
    load = np.zeros(SIZE + rows)
    load[1:SIZE:3] = -masses * GRAVITY
    acceleration = np.linalg.solve(system, load)[:SIZE].reshape(-1, 3)
    fall = np.abs(acceleration - (0.0, -GRAVITY, 0.0)).max(axis=1) < ROUND_OFF
    return [number + 1 for number in range(len(BODIES)) if fall[number]]

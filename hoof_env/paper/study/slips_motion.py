"""Slips of Eqs. 5 to 8: inertia, load, middle term of gamma and Baumgarte's beta, solved as printed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constrained import ConstrainedLeg
from hoof_env.dynamics.constraints import DRIVER_ROW, JOINT_ROWS, Closure
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace
from hoof_env.errors import HoofEnvError
from hoof_env.gait.parameters import GaitParameters
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.reproduce import ENVIRONMENT, GAITS
from hoof_env.paper.solvers import slowest_root
from hoof_env.paper.study.slip import HARMLESS, NOTICED, UNPRINTED, Slip, change, effect_of

ANGLES = 72
"""Crank angles at which joint forces are compared."""

SAMPLES = 100
"""How often a cycle's drift is looked at."""

APART = 0.1
"""A joint that opens this far ends a cycle [m]: what follows is no motion of the leg."""

ALPHA, PRINTED_BETA, PROBABLE_BETA = 15.0, math.sqrt(2 * 15.0), math.sqrt(2) * 15.0
"""Baumgarte's parameters [1/s] as printed in Table 1, and beta as probably meant."""


@dataclass(frozen=True)
class Drift:
    """One cycle in explicit Euler at 1 ms on elastic ground.

    Attributes:
        t, gap, crank: instants [s], largest joint gap [m] and error of the crank angle [rad], shape (100,),
            or fewer if it failed.
        trace: the cycle, up to the last of these instants.
        failed: when the integration could not go on or a joint came `APART` [s], to a hundredth of the cycle;
            None if neither.
    """

    t: NDArray[np.float64]
    gap: NDArray[np.float64]
    crank: NDArray[np.float64]
    trace: NDArray[np.void]
    failed: float | None = None

    @property
    def peak(self) -> float:
        """Highest normal force [N]."""
        return float(self.trace["normal"].max())


class PrintedGamma:
    """Eq. 2 with gamma as printed: 2 Phi_q qd for 2 Phi_qt qd, which is zero here."""

    def __init__(self, constraints: Any) -> None:
        self._constraints = constraints

    def __call__(self, q: Any, qd: Any, motion: Any) -> Closure:
        closure: Closure = self._constraints(q, qd, motion)
        return closure._replace(gamma=closure.gamma - 2 * closure.jacobian @ qd)


def paper_leg(
    preset: str | None, gait: str, beta: float = PRINTED_BETA
) -> tuple[ConstrainedLeg, GaitParameters]:
    """The paper's solver and a gait of a preset (the environment's default if None)."""
    settings: dict[str, Any] = {} if preset is None else {"preset": preset}
    env: Any = gymnasium.make(
        ENVIRONMENT, gait=gait, solver="paper", baumgarte_beta=beta, **settings
    ).unwrapped
    return env.batch.paper.legs[0], env.batch.gait


def drift(preset: str | None, gait: str, beta: float, printed: bool) -> Drift:
    """One cycle with gamma as it must be or as `printed`, which an integration need not survive.

    Raises:
        HoofEnvError: the integration failed with gamma as it must be.
    """
    leg, parameters = paper_leg(preset, gait, beta)
    if printed:
        leg.constraints = PrintedGamma(leg.constraints)  # type: ignore[assignment]
    parts, gap, crank = [leg.reset(parameters)], [], []
    failed = None
    for sample in range(SAMPLES):
        part = new_trace(1000 // SAMPLES)
        result, error = leg.advance(parameters.to_array(), part), leg.closure().error
        widest = float(np.hypot(*error[:JOINT_ROWS].reshape(-1, 2).T).max())
        if result is not Result.OK or widest > APART:
            if not printed:
                raise HoofEnvError(f"{gait} with beta {beta:g}: the integration failed")
            failed = sample / SAMPLES
            break
        parts.append(part)
        gap.append(widest)
        crank.append(float(error[DRIVER_ROW]))
    trace = np.concatenate(parts)
    return Drift(trace["t"][10::10], np.array(gap), np.array(crank), trace, failed)


def drifts(preset: str | None) -> dict[tuple[str, str], Drift]:
    """By gait and by case: "read" or "printed" gamma, each also with the "probable beta"."""
    return {
        (gait, case): drift(preset, gait, beta, printed)
        for gait in GAITS
        for case, beta, printed in (
            ("read", PRINTED_BETA, False),
            ("read, probable beta", PROBABLE_BETA, False),
            ("printed", PRINTED_BETA, True),
            ("printed, probable beta", PROBABLE_BETA, True),
        )
    }


def motion_slips(preset: str | None, cycles: dict[tuple[str, str], Drift]) -> list[Slip]:
    """The slips of Eqs. 5 to 9; `cycles` from `drifts`."""
    loads = {gait: _loads(preset, gait) for gait in GAITS}
    return [_inertia(loads), _ground_load(loads), _gamma(cycles), _beta(cycles)]


def _loads(preset: str | None, gait: str) -> dict[str, dict[str, float]]:
    """Largest crank torque [N m] and joint force [N] over the cycle, loops closed, elastic ground: as "read",
    with the "printed" inertia, and with "no ground" in Eq. 8; and "motion", what inertia changes of it."""
    leg, parameters = paper_leg(preset, gait)
    heavy = ConstrainedLeg(leg.geometry.replace(inertia="paper"), leg.ground, height=leg.trunk.height)
    found: dict[str, list[tuple[float, float]]] = {"read": [], "printed": [], "no ground": []}
    motion = 0.0
    for theta in np.arange(ANGLES) / ANGLES * 2 * np.pi:
        for name, one in (("read", leg), ("printed", heavy)):
            one.reset(parameters, theta=float(theta))
            found[name].append(_worst(one.solve()[1]))
        found["no ground"].append(_worst(leg.solve(ground=False)[1]))
        motion = max(motion, float(np.abs(leg.solve()[0] - heavy.solve()[0]).max()))
    result = {
        name: dict(zip(("torque", "force"), map(float, np.max(values, axis=0)), strict=True))
        for name, values in found.items()
    }
    return {**result, "motion": {"acceleration": motion}}


def _worst(multipliers: NDArray[np.float64]) -> tuple[float, float]:
    joints = multipliers[:JOINT_ROWS].reshape(-1, 2)
    return abs(float(multipliers[DRIVER_ROW])), float(np.hypot(*joints.T).max())


def _compared(loads: dict[str, dict[str, dict[str, float]]], case: str) -> tuple[str, float]:
    """Torque and force of a case beside those read, in words, and the largest relative change."""
    parts, changes = [], []
    for gait, by_case in loads.items():
        read, literal = by_case["read"], by_case[case]
        changes += [abs(change(literal[name], read[name])) for name in read]
        parts.append(
            f"{gait} crank torque {literal['torque']:.0f} N m instead of {read['torque']:.0f}, joint force "
            f"{literal['force']:.0f} N instead of {read['force']:.0f}"
        )
    return "; ".join(parts), max(changes)


def _inertia(loads: dict[str, dict[str, dict[str, float]]]) -> Slip:
    words, largest = _compared(loads, "printed")
    motion = max(by["motion"]["acceleration"] for by in loads.values())
    return Slip(
        "eq5.inertia",
        "Eq. 5",
        "`J_i = 2l/3`",
        "`m L²/3`, L the half-length (a uniform rod about its centre); masses are the leg's data",
        "a length is no moment of inertia",
        f"its value with half-length l taken as kg m²: the largest at {ANGLES} crank angles: "
        f"{words}. Accelerations differ by {motion:.0e} at most: the crank is "
        "driven, so motion and ground force stay",
        UNPRINTED if largest > NOTICED else HARMLESS,
        {"loads": loads},
    )


def _ground_load(loads: dict[str, dict[str, dict[str, float]]]) -> Slip:
    words, largest = _compared(loads, "no ground")
    return Slip(
        "eq7.load",
        "Eq. 7",
        "`h_i = [0, -m_i g, 0]`, for every link",
        "the sole link carries the ground force and its moment too",
        "else no contact force enters Eq. 8",
        f"without it the largest at {ANGLES} crank angles: {words}; motion and ground force stay",
        UNPRINTED if largest > NOTICED else HARMLESS,
        {},
    )


def _gamma(cycles: dict[tuple[str, str], Drift]) -> Slip:
    parts, data, changes = [], {}, []
    for gait in GAITS:
        read = cycles[gait, "read"]
        words = []
        for case in ("printed", "printed, probable beta"):
            facts = data[f"{gait}, {case}"] = _gamma_facts(cycles[gait, case], read)
            words.append(_gamma_words(facts))
        moved = data[f"{gait}, printed"]["peak_change"]
        changes.append(math.inf if moved is None else moved)
        parts.append(
            f"{gait} (joints open by {1000 * float(read.gap.max()):.1f} mm as read): {words[0]}; with beta "
            f"{PROBABLE_BETA:.1f} {words[1]}"
        )
    return Slip(
        "eq8.gamma",
        "below Eq. 8",
        "`γ = -(Φ_q q')_q q' - 2 Φ_q q' - Φ_tt`",
        "`... - 2 Φ_qt q' ...`, zero here",
        "the second derivative of Φ(q, t) by time",
        "a drag of 2 1/s on every row, which Baumgarte's terms fight. " + ". ".join(parts),
        effect_of(*changes),
        data,
    )


def _gamma_facts(literal: Drift, read: Drift) -> dict[str, float | None]:
    """How far gamma by the letter leads; forces and times only if it comes to the end of the cycle."""
    ended = literal.failed is None
    later = measure_stance(literal.trace).start - measure_stance(read.trace).start if ended else None
    return {
        "failed_s": literal.failed,
        "crank_deg": math.degrees(float(np.abs(literal.crank).max(initial=0))),
        "gap_m": float(literal.gap.max(initial=0)),
        "gap_read_m": float(read.gap.max()),
        "peak_change": change(literal.peak, read.peak) if ended else None,
        "contact_later_s": later,
    }


def _gamma_words(facts: dict[str, Any]) -> str:
    worst = (
        f"the crank is {facts['crank_deg']:.1f} deg off at worst, a joint opens by "
        f"{1000 * facts['gap_m']:.0f} mm"
    )
    if facts["failed_s"] is not None:
        return f"the integration fails after {facts['failed_s']:.2f} s; until then {worst}"
    return (
        f"{worst}, the elastic peak is {100 * facts['peak_change']:+.0f} % and touch-down "
        f"{1000 * facts['contact_later_s']:+.0f} ms"
    )


def _beta(cycles: dict[tuple[str, str], Drift]) -> Slip:
    betas = {"printed": PRINTED_BETA, "probable": PROBABLE_BETA}
    slowest = {name: -slowest_root(ALPHA, beta) for name, beta in betas.items()}
    left = math.exp(-slowest["printed"])
    peaks = {gait: [cycles[gait, case].peak for case in ("read", "read, probable beta")] for gait in GAITS}
    words = ", ".join(f"{gait} {two:.0f} N instead of {one:.0f}" for gait, (one, two) in peaks.items())
    return Slip(
        "table1.beta",
        "Table 1",
        f"`β = √(2α)` = {PRINTED_BETA:.2f}, dimensionally no rate",
        f"probably `√2 α` = {PROBABLE_BETA:.1f} 1/s; the reproduction has a column for each",
        "√(2α) has the unit s^-1/2; √2 α gives damping 0.71, the usual choice",
        f"as printed a closure error decays with {slowest['printed']:.2f} 1/s, {100 * left:.0f} % of it is "
        f"left after the run; as probably meant with {slowest['probable']:.0f} 1/s, which moves the elastic "
        f"peaks: {words}. The part on time step and Baumgarte shows every row",
        effect_of(*(change(two, one) for one, two in peaks.values())),
        {"slowest_root_1_s": slowest, "left_after_1_s": left, "peaks_N": peaks},
    )

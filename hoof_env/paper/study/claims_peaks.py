"""Claims about the peaks of the ground force: how many, where, when, and how like a human's."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.reproduce import GAITS, SOLVERS
from hoof_env.paper.shapes import PEAK_GAP, PROMINENCE, find_peaks
from hoof_env.paper.study.case import Case, Trace, by_solver
from hoof_env.paper.study.claim import PUBLISHED, Examined, Finding
from hoof_env.paper.study.claims_force import on_ground
from hoof_env.paper.study.section import listed

NEAR = {"outer thirds of stance": 1 / 3, "outer tenths of stance": 0.1}
"""How far from first or last contact 'when the leg first impacts and leaves the ground' reaches [stance]."""

TIE = 0.01
"""Maxima this close to the highest one [-] may take its place if the motion changes a little."""

RESTITUTIONS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)


def peak_claims(case: Case) -> Iterable[Examined]:
    """The claims about peaks, in the order of the text."""
    return _two_peaks(case), _peak_places(case), _one_peak(case), _delay(case), _human(case)


def peak_times(case: Case, gait: str, solver: str) -> dict[float, float]:
    """When the normal force is highest [s], by restitution."""
    times = {}
    for cr in RESTITUTIONS:
        trace = on_ground(case, gait, solver, restitution=cr)
        times[cr] = float(trace["t"][np.argmax(trace["normal"])])
    return times


def _rivals(trace: Trace) -> str:
    """Other local maxima of the normal force nearly as high as the highest, in words; "" without any."""
    force, t = trace["normal"], trace["t"]
    maxima = 1 + np.flatnonzero((np.diff(force)[:-1] > 0) & (np.diff(force)[1:] <= 0))
    top = int(np.argmax(force))
    tied = [k for k in maxima if force[k] >= (1 - TIE) * force[top] and abs(t[k] - t[top]) >= PEAK_GAP]
    return listed(f"{force[k]:.0f} N at {t[k]:.3f} s" for k in tied) if tied else ""


def _two_peaks(case: Case) -> Examined:
    def count(solver: str) -> tuple[bool, str]:
        trace = case.trace("walk", solver, "inelastic")
        peaks = find_peaks(trace["normal"])
        where = ", ".join(f"{trace['normal'][k]:.0f} N at {trace['t'][k]:.3f} s" for k in peaks)
        return len(peaks) == 2, f"{len(peaks)} peak(s): {where}"

    return Examined(
        "walk.peaks",
        "two peaks during the stance phase in the walking condition were realized",
        "abstract, section 4",
        "claims_peaks",
        (
            *case.judged("walk.peaks", "elastic, one in each half of stance, double support in the dip"),
            *by_solver("inelastic, two peaks", count),
        ),
        f"A maximum counts as a peak if it stands out by {100 * PROMINENCE:g} % of the highest force.",
    )


def _peak_places(case: Case) -> Examined:
    def near(condition: str, reach: float) -> Callable[[str], tuple[bool, str]]:
        def decide(solver: str) -> tuple[bool, str]:
            trace, stance = case.trace("walk", solver, condition), case.stance("walk", solver, condition)
            parts = [
                float((trace["t"][k] - stance.start) / (stance.end - stance.start))
                for k in find_peaks(trace["normal"])
            ]
            first, last = any(p <= reach for p in parts), any(p >= 1 - reach for p in parts)
            inner = any(reach < p < 1 - reach for p in parts)
            words = listed(f"{100 * p:.0f} %" for p in parts)
            return first and last and not inner, f"peaks at {words} of stance"

        return decide

    targets = {"elastic": ["walk.peaks"], "inelastic": []}
    return Examined(
        "walk.peak_places",
        "the maximum pressure or force peak indicated in only when the leg first impact and leaves the "
        "ground",
        "section 3",
        "claims_peaks",
        tuple(
            finding
            for condition in CONDITIONS
            for name, reach in NEAR.items()
            for finding in by_solver(
                f"{condition}, {name}", near(condition, reach), case.asked(*targets[condition])
            )
        ),
        "At the instants of contact and lift-off themselves Eq. 14 gives no force.",
    )


def _one_peak(case: Case) -> Examined:
    def single(solver: str) -> tuple[bool, str]:
        counts = {c: len(find_peaks(case.trace("run", solver, c)["normal"])) for c in CONDITIONS}
        return set(counts.values()) == {1}, listed(f"{count} peak(s) {c}" for c, count in counts.items())

    return Examined(
        "run.peaks",
        "a single peak was newly observed in running",
        "abstract, section 4",
        "claims_peaks",
        by_solver("both conditions", single, case.asked("run.peaks")),
    )


def _delay(case: Case) -> Examined:
    times = {(gait, solver): peak_times(case, gait, solver) for gait in GAITS for solver in SOLVERS}

    def gap(gait: str, solver: str) -> float:
        return times[gait, solver][0.0] - times[gait, solver][1.0]

    def shift(gait: str, solver: str) -> str:
        by = gap(gait, solver)
        return f"{1000 * abs(by):.1f} ms {'later' if by > 0 else 'earlier'} than the elastic one"

    def apart(solver: str) -> tuple[bool, str]:
        return abs(gap("run", solver)) >= PEAK_GAP, f"the inelastic peak comes {shift('run', solver)}"

    def late(solver: str) -> tuple[bool, str]:
        return gap("run", solver) > 0, shift("run", solver)

    def grows(solver: str) -> tuple[bool, str]:
        series = np.array(list(times["run", solver].values()))
        steps = np.diff(series) * np.sign(series[-1] - series[0])
        words = ", ".join(f"{1000 * (t - series[0]):+.0f}" for t in series)
        return bool(
            (steps >= -1e-9).all() and series[-1] != series[0]
        ), f"shift at cr = 1, 0.9 ... 0: {words} ms"

    def only(solver: str) -> tuple[bool, str]:
        smaller = abs(gap("walk", solver)) < abs(gap("run", solver))
        rivals = _rivals(case.trace("walk", solver, "inelastic"))
        others = f"; within {100 * TIE:g} % of it: {rivals}" if rivals else ""
        return smaller, f"in walking the highest inelastic force comes {shift('walk', solver)}{others}"

    findings = (
        *by_solver(f"the peaks are {1000 * PEAK_GAP:.0f} ms or more apart", apart, case.asked("run.peaks")),
        *by_solver("the shift grows with the damping", grows),
        *by_solver("damping delays the peak", late, case.asked("run.peaks")),
        *by_solver("specific to running: smaller in walking", only),
    )
    delayed = {finding.holds for finding in findings if finding.reading == "damping delays the peak"}
    return Examined(
        "run.delay",
        "a single peak ... with a time gap in elastic and inelastic condition; a time delay in a peak ... "
        "specifically in running gaits ... due to the damping factor",
        "abstract, section 4",
        "claims_gap",
        findings,
        "The damper brings the peak forward: it adds force while the hoof still sinks."
        if delayed == {False}
        else "",
        {f"{gait}, {solver}": list(series.values()) for (gait, solver), series in times.items()},
    )


def _human(case: Case) -> Examined:
    def like(solver: str) -> tuple[bool, str]:
        trace = case.trace("walk", solver)
        peaks = find_peaks(trace["normal"])
        if len(peaks) != 2:
            return False, f"{len(peaks)} peak(s)"
        one, two = (float(trace["normal"][k]) for k in peaks)
        dip = float(trace["normal"][peaks[0] : peaks[1]].min())
        return True, f"second peak {two / one:.2f} and dip {dip / one:.2f} of the first"

    printed = case.published.row("walk.duty").value
    return Examined(
        "walk.human",
        "consistent with the force pattern observed in the human walking gait",
        "section 3, abstract",
        "claims_peaks",
        (
            *by_solver("two peaks with a dip between them", like, case.asked("walk.peaks")),
            Finding(
                "over a stance that leaves no flight, as in walking",
                PUBLISHED,
                printed >= 0.5,
                f"duty factor {printed:.3f} from the printed times",
            ),
        ),
    )

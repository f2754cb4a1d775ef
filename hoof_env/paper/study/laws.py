"""Part 2: what 'elastic against inelastic' becomes under other laws, exponents and approach-speed floors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.contact import Ground
from hoof_env.ground.normal_force import FACTORS, SMALLEST_RESTITUTION, restitution_of_factor
from hoof_env.paper.measure import POINTS, integral, measure_stance
from hoof_env.paper.published import CONDITIONS, Published, load_published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.study import figures_laws as figures
from hoof_env.paper.study.laws_text import laws_text
from hoof_env.paper.study.replay import Cycles, Trace, exact_cycle, ground_of, replay
from hoof_env.paper.study.section import Section, for_json

PAPER_LAW = "lankarani-nikravesh"

RESTITUTIONS = np.concatenate(([0, SMALLEST_RESTITUTION, 2 * SMALLEST_RESTITUTION], np.linspace(0.05, 1, 39)))
"""Nominal coefficients of restitution of the sweep [-]."""

EXPONENTS = (1.0, 1.5, 2.0)
"""Exponents n [-] that are tried beside the preset's."""

FLOORS = np.geomspace(1e-4, 3.0, 61)
"""Approach-speed floors of the sweep [m/s]."""

CURVES = ((PAPER_LAW, 1.0), (PAPER_LAW, 0.5), (PAPER_LAW, 0.0), ("exact", 0.5), ("exact", 0.3))
"""Laws and nominal restitutions whose force curves are drawn."""


def examine_laws(preset: str | None, progress: Callable[[str], None]) -> Section:
    """Part 2 of the study.

    Args:
        preset: leg and gaits; the environment's default if None.
        progress: called with a line now and then.

    Raises:
        HoofEnvError: a preset that is unknown or does not walk and run.
    """
    published = load_published()
    cycles = {gait: exact_cycle(gait, preset) for gait in GAITS}
    ground = ground_of(preset)
    data: dict[str, Any] = {"stiffness": ground.stiffness, "exponents": {}}
    for exponent in sorted({*EXPONENTS, ground.exponent}):
        progress(f"damping laws, exponent {exponent:g}")
        data["exponents"][f"{exponent:g}"] = _exponent(cycles, replace(ground, exponent=exponent))
    base = data["exponents"][f"{ground.exponent:g}"]
    run_peak = base["elastic"]["run"]["peak"]
    for entry in data["exponents"].values():
        entry["stiffness_rescaled"] = ground.stiffness * run_peak / entry["elastic"]["run"]["peak"]
    data["exponent"] = f"{ground.exponent:g}"
    data["paper_law"] = PAPER_LAW
    data["paper_restitution"] = CONDITIONS["inelastic"]
    data["published"] = {gait: _published(published, base["laws"], gait) for gait in GAITS}
    progress("floor of the approach speed")
    data["floor"] = _floors(cycles, ground)
    curves = {
        (gait, law, cr): replay(cycles[gait], replace(ground, normal_law=law, restitution=cr))
        for gait in GAITS
        for law, cr in CURVES
    }
    data = for_json(data)
    return Section(
        "Exponent and damping law",
        laws_text(data),
        data,
        {
            "laws_nominal": partial(figures.draw_nominal, data),
            "laws_delivered": partial(figures.draw_delivered, data),
            "laws_free": partial(figures.draw_free, data),
            "laws_curves": partial(figures.draw_curves, curves),
            "laws_floor": partial(figures.draw_floor, data),
        },
    )


def restitutions(law: str) -> NDArray[np.float64]:
    """The sweep, without what the law cannot represent."""
    diverges = law not in (PAPER_LAW, "hunt-crossley")
    return RESTITUTIONS[RESTITUTIONS >= SMALLEST_RESTITUTION] if diverges else RESTITUTIONS


def free_peak(chi: float, exponent: float) -> float:
    """Peak force of a free impact over that of an elastic impact of the same mass and speed [-].

    From m v dv/dd = -K d^n (1 + chi v/v0), with u = v/v0: d^(n+1) grows as
    g(u) = (1 - u) / chi - ln((1 + chi) / (1 + chi u)) / chi^2 on the way in, (1 - u^2) / 2 without damping.
    The peak lies on the way in, where damping and spring add up.

    Args:
        chi: damping factor [-]. exponent: n [-].
    """
    u = np.linspace(0, 1, 20_001)
    g = (1 - u**2) / 2
    if chi > 1e-6:
        g = np.maximum((1 - u) / chi - (np.log1p(chi) - np.log1p(chi * u)) / chi**2, 0.0)
    return float(np.max((2 * g) ** (exponent / (exponent + 1)) * (1 + chi * u)))


def _exponent(cycles: Cycles, ground: Ground) -> dict[str, Any]:
    """Elastic forces, and every law over its range, for one exponent."""
    elastic = {gait: _measure(cycle, replace(ground, restitution=1.0)) for gait, cycle in cycles.items()}
    return {"elastic": elastic, "laws": {law: _law(cycles, ground, law, elastic) for law in FACTORS}}


def _law(cycles: Cycles, ground: Ground, law: str, elastic: Mapping[str, Any]) -> dict[str, Any]:
    nominal = restitutions(law)
    factors = [FACTORS[law](float(cr)) for cr in nominal]
    result: dict[str, Any] = {
        "nominal": nominal,
        "chi": factors,
        "delivered": [restitution_of_factor(chi) for chi in factors],
        "free_peak": [free_peak(chi, ground.exponent) for chi in factors],
    }
    for gait, cycle in cycles.items():
        swept = [_measure(cycle, replace(ground, normal_law=law, restitution=float(cr))) for cr in nominal]
        result[gait] = {name: [entry[name] for entry in swept] for name in swept[0]}
        reference = elastic[gait]["peak"]
        result[gait]["reduction"] = [100 * (entry["peak"] - reference) / entry["peak"] for entry in swept]
    return result


def _measure(cycle: Trace, ground: Ground) -> dict[str, float]:
    """Peak and mean [N], and the part of the work put into the ground that it gives back [-]."""
    trace = replay(cycle, ground)
    stance = measure_stance(trace)
    powers = [trace[f"{name}_normal"] * trace[f"{name}_rate"] for name in POINTS]
    work, back = (
        sum(integral(trace, np.clip(sign * power, 0, None), stance.start, stance.end) for power in powers)
        for sign in (1, -1)
    )
    return {"peak": stance.peak, "mean": stance.mean, "returned": back / work}


def _published(published: Published, laws: Mapping[str, Any], gait: str) -> dict[str, float]:
    """The published reduction [%] and the delivered restitution [-] at which this leg has it."""
    reduction = published.row(f"{gait}.reduction").value
    law = laws["exact"]
    order = np.argsort(law[gait]["reduction"])
    at = np.interp(reduction, np.array(law[gait]["reduction"])[order], np.array(law["delivered"])[order])
    return {"reduction": reduction, "delivered": float(at)}


def _floors(cycles: Cycles, ground: Ground) -> dict[str, Any]:
    """Inelastic peak and mean [N] over the floor of the approach speed, and the approach speeds [m/s]."""
    inelastic = replace(ground, restitution=CONDITIONS["inelastic"])
    result: dict[str, Any] = {
        "floor": FLOORS, "paper": ground.approach_floor, "approach": {}, "peak": {}, "mean": {}
    }  # fmt: skip
    for gait, cycle in cycles.items():
        trace = replay(cycle, inelastic)
        result["approach"][gait] = {
            name: float(speeds.min())
            for name in POINTS
            if (speeds := trace[f"{name}_approach"][trace[f"{name}_approach"] > 0]).size
        }
        stances = [
            measure_stance(replay(cycle, replace(inelastic, approach_floor=float(floor)))) for floor in FLOORS
        ]
        result["peak"][gait] = [stance.peak for stance in stances]
        result["mean"][gait] = [stance.mean for stance in stances]
    return result

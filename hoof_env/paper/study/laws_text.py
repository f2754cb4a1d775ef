"""What part 2 says, phrased from its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.paper.study.section import listed, table

GAIT_WORDS = {"walk": "walking", "run": "running"}

SHOWN = (0.0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9)
"""Nominal restitutions in the tables."""


def laws_text(data: Mapping[str, Any]) -> str:
    """The part's text and tables."""
    return "\n\n".join(
        [
            "### What each law returns",
            *_restitution(data),
            "### Elastic against inelastic, law by law",
            *_reduction(data),
            "![Peak and reduction over the nominal restitution](laws_nominal.png)",
            "![Restitution delivered, and the reduction over it](laws_delivered.png)",
            "![Normal force over time under several laws](laws_curves.png)",
            "### Why inelastic ground hits harder here",
            _why(data),
            "![Peak over elastic peak on a prescribed motion and in a free impact](laws_free.png)",
            "### Exponent",
            *_exponents(data),
            "### Floor of the approach speed",
            _floor(data),
            "![Peak over the floor of the approach speed](laws_floor.png)",
        ]
    )


def _laws(data: Mapping[str, Any]) -> dict[str, Any]:
    laws: dict[str, Any] = data["exponents"][data["exponent"]]["laws"]
    return laws


def _at(sweep: Mapping[str, Any], nominal: float) -> int | None:
    """Where a nominal restitution stands in the sweep of a law, None where the law has none."""
    k = int(np.argmin(np.abs(np.array(sweep["nominal"]) - nominal)))
    return k if abs(sweep["nominal"][k] - nominal) < 1e-9 else None


def _paper(data: Mapping[str, Any]) -> tuple[dict[str, Any], int]:
    """The sweep of the paper's law and where its inelastic condition stands in it."""
    sweep = _laws(data)[data["paper_law"]]
    return sweep, sweep["nominal"].index(data["paper_restitution"])


def _by_law(data: Mapping[str, Any], cell: Any) -> str:
    laws = _laws(data)
    lines = []
    for nominal in SHOWN:
        places = {law: _at(sweep, nominal) for law, sweep in laws.items()}
        cells = ["" if k is None else cell(laws[law], k) for law, k in places.items()]
        lines.append([f"{nominal:g}", *cells])
    return table(["nominal cr", *laws], lines)


def _restitution(data: Mapping[str, Any]) -> list[str]:
    sweep, k = _paper(data)
    worst = {
        law: max(abs(e - cr) for e, cr in zip(entry["delivered"], entry["nominal"], strict=True))
        for law, entry in _laws(data).items()
    }
    return [
        "Every law here is F = K δⁿ (1 + χ v/v₀) and differs in χ(cr) alone. A free impact of any mass "
        "returns the restitution e that solves χ(1 + e) = ln((1 + χ)/(1 − χe)). The paper's law "
        f"({data['paper_law']}) with cr = {data['paper_restitution']:g}, its 'inelastic' ground, returns e "
        f"= {sweep['delivered'][k]:.3f}. Largest distance of e from the nominal cr: "
        + listed(f"{distance:.3f} ({law})" for law, distance in worst.items())
        + ". Here 'exact' is the law whose χ solves that equation, not the solver.",
        _by_law(data, lambda entry, k: f"{entry['delivered'][k]:.3f}"),
    ]


def _reduction(data: Mapping[str, Any]) -> list[str]:
    sweep, k = _paper(data)
    exact = _laws(data)["exact"]
    reached = listed(
        f"{found['reduction']:g} % at e = {found['delivered']:.3f} ({GAIT_WORDS[gait]})"
        for gait, found in data["published"].items()
    )
    here = listed(f"{sweep[gait]['reduction'][k]:.1f} % ({word})" for gait, word in GAIT_WORDS.items())
    half = _at(exact, 0.5)
    honest = ""
    if half is not None:
        by_gait = listed(
            f"{exact[gait]['reduction'][half]:.1f} % ({word})" for gait, word in GAIT_WORDS.items()
        )
        honest = f"{by_gait} at cr = {exact['nominal'][half]:g}, and "
    least = exact["nominal"][0]
    most = listed(f"{exact[gait]['reduction'][0]:.1f} % ({word})" for gait, word in GAIT_WORDS.items())
    return [
        "On a prescribed motion δ, v and v₀ are given, so the force depends on the law through χ alone: "
        "over the delivered e the reductions of all laws fall on one curve for each gait. 'Elastic against "
        f"inelastic' is {here} on this leg under the paper's law. A law that returns what it says gives "
        f"{honest}{most} at cr = {least:g}, and would reach 100 % at 0, where χ has no bound: how much "
        "lower the elastic peak is depends on which law is asked and how far it goes. This leg has the "
        f"published reductions of {reached}; the paper's law ends at e = {sweep['delivered'][k]:.3f}.",
        "Reduction of the peak by elastic ground, walking / running [%]:",
        _by_law(
            data, lambda entry, k: " / ".join(f"{entry[gait]['reduction'][k]:.1f}" for gait in GAIT_WORDS)
        ),
    ]


def _why(data: Mapping[str, Any]) -> str:
    sweep, k = _paper(data)
    elastic = data["exponents"][data["exponent"]]["elastic"]
    ratios = listed(
        f"{sweep[gait]['peak'][k] / elastic[gait]['peak']:.2f} ({word})" for gait, word in GAIT_WORDS.items()
    )
    returned = listed(
        f"{100 * sweep[gait]['returned'][k]:.0f} % ({word})" for gait, word in GAIT_WORDS.items()
    )
    free, e = sweep["free_peak"][k], sweep["delivered"][k]
    if free < 1:
        verdict = f"{free:.3f} times the elastic one: lower, not higher"
    else:
        verdict = f"{free:.3f} times the elastic one"
    curve = _laws(data)["exact"]
    lowest = int(np.argmin(curve["free_peak"]))
    return (
        f"The inelastic peak is {ratios} times the elastic one because the crank drives the hoof down the "
        "same path whatever the ground does. Damping then only adds: in compression (v > 0) the factor 1 + "
        "χ v/v₀ exceeds 1 at the same δ. In a free impact damping also takes speed away, and the hoof goes "
        f"less deep; with the same law and χ the peak of a free mass is {verdict} (over all e the free peak "
        f"is smallest at e = {curve['delivered'][lowest]:.2f}, {curve['free_peak'][lowest]:.3f}"
        f"{_harder(curve)}). Nor does e describe the prescribed stance: of the work put into the ground the "
        f"elastic one gives back all, the paper's inelastic one {returned}, where a free impact would give "
        f"back e² = {100 * e * e:.0f} %; drives make up the rest."
    )


def _harder(curve: Mapping[str, Any]) -> str:
    """Below which restitution a free impact, too, is harder than the elastic one, in words."""
    below = hardest_free(curve)
    return f", and above 1 below e = {below:.2f}: so strong a damping raises it too" if below else ""


def hardest_free(curve: Mapping[str, Any]) -> float | None:
    """Restitution below which damping raises the peak of a free mass [-], None if it never does."""
    e, peak = np.array(curve["delivered"]), np.array(curve["free_peak"])
    order = np.argsort(e)
    e, peak = e[order], peak[order]
    if peak[0] <= 1:
        return None
    k = int(np.argmax(peak <= 1))
    return float(np.interp(1.0, peak[k - 1 : k + 1][::-1], e[k - 1 : k + 1][::-1]))


def _exponents(data: Mapping[str, Any]) -> list[str]:
    law, cr = data["paper_law"], data["paper_restitution"]
    lines = []
    for exponent, entry in data["exponents"].items():
        sweep = entry["laws"][law]
        k = sweep["nominal"].index(cr)
        scale = entry["stiffness_rescaled"] / data["stiffness"]
        peaks = [entry["elastic"][gait]["peak"] for gait in GAIT_WORDS]
        exact = entry["laws"]["exact"]
        half = _at(exact, 0.5)
        lines.append(
            [exponent, *(f"{peak:.1f}" for peak in peaks), f"{entry['stiffness_rescaled']:.4g}",
             *(f"{scale * peak:.1f}" for peak in peaks),
             *(f"{sweep[gait]['reduction'][k]:.1f}" for gait in GAIT_WORDS),
             *("" if half is None else f"{exact[gait]['reduction'][half]:.1f}" for gait in GAIT_WORDS)]
        )  # fmt: skip
    spread = {
        word: [entry["laws"][law][gait]["reduction"][k] for entry in data["exponents"].values()]
        for gait, word in GAIT_WORDS.items()
    }
    ranges = listed(f"{min(values):.1f} to {max(values):.1f} % ({word})" for word, values in spread.items())
    return [
        f"The exponent n is not printed; this preset has n = {data['exponent']}. Elastic peaks with K = "
        f"{data['stiffness']:g} N/mⁿ kept, and with K "
        "rescaled so that the elastic running peak stays; every normal force is proportional to K, so the "
        f"reductions are the same for both. From n = {lines[0][0]} to {lines[-1][0]} the reductions under "
        f"the paper's law run over {ranges}.",
        table(
            ["n", "walking [N]", "running [N]", "K rescaled [N/mⁿ]", "walking [N]", "running [N]",
             f"reduction, {law} cr = {cr:g}, walking [%]", "running [%]", "exact cr = 0.5, walking [%]",
             "running [%]"],
            lines,
        ),
    ]  # fmt: skip


STANDARD_FLOOR = 0.1
"""A floor common in multibody codes [m/s], which the text tries."""


def _floor(data: Mapping[str, Any]) -> str:
    floor = data["floor"]
    speeds = listed(
        f"{speed:.3f} m/s ({word}, {name})"
        for gait, word in GAIT_WORDS.items()
        for name, speed in floor["approach"][gait].items()
    )
    elastic = data["exponents"][data["exponent"]]["elastic"]
    texts = []
    for gait, word in GAIT_WORDS.items():
        peaks = np.array(floor["peak"][gait])
        peak = float(np.interp(STANDARD_FLOOR, floor["floor"], peaks))
        moved = np.flatnonzero(np.abs(peaks / peaks[0] - 1) > 0.01)
        start = f"from {floor['floor'][moved[0]]:.3g} m/s" if moved.size else "nowhere in the sweep"
        if abs(peak / peaks[0] - 1) < 1e-3:
            texts.append(
                f"in {word} the peak moves by more than 1 % {start} and is unchanged at "
                f"{STANDARD_FLOOR:g} m/s"
            )
            continue
        texts.append(
            f"in {word} the peak moves by more than 1 % {start}; at {STANDARD_FLOOR:g} m/s it is {peak:.0f} "
            f"N instead of {peaks[0]:.0f}, a reduction of {100 * (1 - elastic[gait]['peak'] / peak):.1f} % "
            f"instead of {100 * (1 - elastic[gait]['peak'] / peaks[0]):.1f} %"
        )
    return (
        f"Eq. 14 divides by the approach speed, here {speeds}, with a floor of {floor['paper']:g} m/s that "
        f"only keeps it from zero. With a higher floor, {'; '.join(texts)}."
    )

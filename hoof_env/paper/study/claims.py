"""Every claim of the paper's text beside what the four conditions show: a part of the study."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict

from hoof_env.paper.reproduce import SOLVERS, Reproduction, reproduce
from hoof_env.paper.study.case import Case
from hoof_env.paper.study.claim import CONFIRMED, CONTRADICTED, PUBLISHED, STATUSES, Examined, Finding
from hoof_env.paper.study.claims_direction import direction_claims
from hoof_env.paper.study.claims_force import force_claims
from hoof_env.paper.study.claims_motion import motion_claims
from hoof_env.paper.study.claims_peaks import peak_claims
from hoof_env.paper.study.figures_claims import draw_direction, draw_gap, draw_peaks
from hoof_env.paper.study.section import Section, for_json, listed, table

TITLE = "Claims of the text"

_HOLDS = {True: "holds", False: "does not hold", None: "not testable"}


def examine_claims(
    preset: str | None, progress: Callable[[str], None], reproduction: Reproduction | None = None
) -> Section:
    """Hold every claim of the paper's abstract and sections 3 and 4 against the four conditions.

    Args:
        preset: leg and gaits; the default if None.
        progress: called with a line now and then.
        reproduction: the four conditions of this preset, if they are at hand.

    Raises:
        HoofEnvError: a preset that is unknown or does not walk and run.
    """
    case = Case.of(reproduction or reproduce(progress, preset=preset))
    progress("claims: motion")
    claims = list(motion_claims(case))
    progress("claims: forces")
    claims += (*force_claims(case), *peak_claims(case), *direction_claims(case))
    return Section(
        TITLE,
        _markdown(claims),
        for_json(
            {"claims": [{**asdict(claim), "asked": claim.asked, "status": claim.status} for claim in claims]}
        ),
        {
            "claims_peaks": lambda: draw_peaks(case),
            "claims_gap": lambda: draw_gap(case),
            "claims_direction": lambda: draw_direction(case),
        },
    )


def _with(claims: Iterable[Examined], status: str) -> list[Examined]:
    return [claim for claim in claims if claim.status == status]


def _summary(claims: Sequence[Examined]) -> str:
    counts = "; ".join(f"{status}: {len(_with(claims, status))}" for status in STATUSES)
    independent = [claim.id for claim in _with(claims, CONFIRMED) if not claim.asked]
    contradicted = [claim.id for claim in _with(claims, CONTRADICTED)]
    return (
        f"{len(claims)} claims examined. {counts[0].upper()}{counts[1:]}. Contradicted: "
        f"{_ids(contradicted)}. Confirmed without having been asked for in the identification: "
        f"{_ids(independent)}."
    )


def _ids(names: Iterable[str]) -> str:
    return listed(f"`{name}`" for name in names) if names else "none"


def _markdown(claims: Sequence[Examined]) -> str:
    return "\n\n".join(
        [
            _summary(claims),
            "The leg was identified from the paper's own numbers and shapes. A reading marked [asked for: "
            "x] bears on x, which the identification asks for: agreement then shows that one leg can do it "
            "all and is no independent proof, and disagreement may be the identification's choice. Only "
            "what was not asked for can confirm or contradict by itself. A claim is confirmed or "
            "contradicted where every reading and all solvers agree. Where solvers agree the numbers are "
            "those of `exact`; study.json has all.",
            table(["claim", "in the paper", "identification", "verdict"], [_line(claim) for claim in claims]),
            "![Normal force through the stance, with its peaks](claims_peaks.png)",
            "![Time of the highest force against restitution](claims_gap.png)",
            "![Horizontal force through the stance](claims_direction.png)",
            *(_entry(claim) for claim in claims),
        ]
    )


def _line(claim: Examined) -> list[str]:
    parts = {bool(finding.asked) for finding in claim.findings}
    asked = "in part" if len(parts) > 1 else "asked for" if True in parts else "not asked for"
    return [f"`{claim.id}`", f"'{claim.quote}'", asked, f"**{claim.status}**"]


def _entry(claim: Examined) -> str:
    lines = [f"**`{claim.id}`**, {claim.where}: '{claim.quote}'. **{claim.status.capitalize()}**."]
    if claim.figure:
        lines[0] += f" Picture: [{claim.figure}]({claim.figure}.png)."
    for reading in dict.fromkeys(finding.reading for finding in claim.findings):
        found = [finding for finding in claim.findings if finding.reading == reading]
        asked = dict.fromkeys(name for finding in found for name in finding.asked)
        behind = f" [asked for: {', '.join(asked)}]" if asked else ""
        lines.append(f"- {reading[0].upper()}{reading[1:]}: {_verdicts(found)}.{behind}")
    if claim.note:
        lines.append(f"- {claim.note}")
    return "\n".join(lines)


def _verdicts(found: Sequence[Finding]) -> str:
    """Sources that agree share one verdict, with the numbers of the last of them, the exact solver."""
    groups: dict[tuple[bool | None, bool], list[Finding]] = {}
    for finding in found:
        groups.setdefault((finding.holds, finding.source == PUBLISHED), []).append(finding)
    return "; ".join(
        f"**{_HOLDS[same[0].holds]}** ({', '.join(map(_source, same))}): {same[-1].evidence}"
        for same in groups.values()
    )


def _source(finding: Finding) -> str:
    return f"`{finding.source}`" if finding.source in SOLVERS else finding.source

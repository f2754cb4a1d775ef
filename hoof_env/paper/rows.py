"""Published numbers and claims of the paper, and their comparison with a simulation.

A row is counted as within or outside its bar unless it is spared: its bar is 'reported', or it is one of
`NOT_DETERMINABLE`. Solver "paper" is the paper's Eq. 8 in explicit Euler
at 1 ms with Baumgarte's beta as printed, sqrt(2 alpha), and "paper, probable beta" the same with the beta
that is probably meant, sqrt(2) alpha. "exact" is the closed form with a time step so small that the results
no longer change.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import Geometry
from hoof_env.paper.measure import Stance, Trace

CONDITIONS = {"elastic": 1.0, "inelastic": 0.0}
"""Coefficient of restitution cr of each condition of the paper [-]."""

# A bar in the file, as "0.005 s", and the measure that goes with the unit of a row.
_BAR = re.compile(r"(\d+(?:\.\d+)?)(?: (s|deg|%|point))?")
_BAR_OF_UNIT = {"s": "s", "deg": "deg", "N": "%", "%": "point", "-": ""}


@dataclass(frozen=True)
class Bar:
    """Largest accepted error of a simulated value against the published one.

    Attributes:
        limit: the largest error, or None if the error is only reported.
        measure: "s", "deg", "%" (relative to the published value), "point" (difference of two percentages) or
            "" (plain difference).
    """

    limit: float | None
    measure: str

    def error(self, simulated: float, published: float) -> float:
        """Return the signed error in the bar's measure."""
        difference = simulated - published
        return 100 * difference / published if self.measure == "%" else difference

    def holds(self, error: float | None) -> bool | None:
        """Return True if an error is within the bar, None if it is only reported, False without a value."""
        if self.limit is None:
            return None
        return error is not None and abs(error) <= self.limit


def parse_bar(text: str, unit: str) -> Bar:
    """Parse the bar of a row.

    Args:
        text: "0.005 s", "1 deg", "2 %", "1 point", "0.01" or "reported".
        unit: unit of the row, which decides the bar's measure.

    Raises:
        ParameterError: the unit is unknown, or the bar does not fit it.
    """
    measure = _BAR_OF_UNIT.get(unit)
    if measure is None:
        raise ParameterError(f"unit: expected one of {', '.join(_BAR_OF_UNIT)}, got {unit!r}")
    if text == "reported":
        return Bar(None, measure)
    match = _BAR.fullmatch(text) if isinstance(text, str) else None
    if match is None or (match[2] or "") != measure:
        form = f"0.5 {measure}".strip()
        raise ParameterError(
            f"bar: expected 'reported' or a number like {form!r} for unit {unit!r}, got {text!r}"
        )
    return Bar(float(match[1]), measure)


@dataclass(frozen=True)
class PublishedRow:
    """Published number of the paper.

    Attributes:
        id: "gait.quantity".
        gait: "walk", "run" or "both".
        quantity: name of the quantity.
        unit: unit in which it is printed.
        printed: number in print.
        value: number as read; it differs from `printed` if the print is a slip.
        bar: margin of its reproduction.
        bar_text: the bar as written in the file.
        condition: "elastic" or "inelastic", or None if the contact law does not matter.
        reading: the reading that is taken if there are several, else "".
    """

    id: str
    gait: str
    quantity: str
    unit: str
    printed: float
    value: float
    bar: Bar
    bar_text: str
    condition: str | None
    reading: str


@dataclass(frozen=True)
class Claim:
    """Claim of the paper about shape: `id`, the text of the `claim`, and the used `reading`, or ""."""

    id: str
    claim: str
    reading: str


@dataclass(frozen=True)
class Published:
    """Numbers, claims and simulation parameters of the paper; published.json has the parameters' units."""

    source: str
    parameters: dict[str, Any]
    rows: tuple[PublishedRow, ...]
    claims: tuple[Claim, ...]

    def row(self, row_id: str) -> PublishedRow:
        """Return the row with an id; raise `KeyError` if there is none."""
        return {row.id: row for row in self.rows}[row_id]


def load_published(path: Path | None = None) -> Published:
    """Read the published numbers from a file, by default the file of this package; raise `DataFileError` if
    the file cannot be read, is incomplete, or has an id twice."""
    file: Any = path or resources.files("hoof_env.paper").joinpath("published.json")
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        published = Published(
            data["source"],
            data["parameters"],
            tuple(read_row(entry) for entry in data["rows"]),
            tuple(Claim(entry["id"], entry["claim"], entry.get("reading", "")) for entry in data["shapes"]),
        )
    except OSError as error:
        raise DataFileError(f"cannot read {file}: {error.strerror or error}") from None
    except ParameterError as error:
        raise DataFileError(f"{file}: {error}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise DataFileError(f"{file}: expected source, parameters, rows and shapes: {error!r}") from None
    # Ids are keys of the results and of the page's tables.
    ids = [row.id for row in published.rows] + [claim.id for claim in published.claims]
    if len(ids) != len(set(ids)):
        raise DataFileError(
            f"{file}: expected every id once, got {', '.join(sorted({i for i in ids if ids.count(i) > 1}))}"
        )
    return published


def read_row(entry: dict[str, Any]) -> PublishedRow:
    """Convert a JSON object to a row; raise `ParameterError` for an invalid bar or condition."""
    condition = entry.get("condition")
    if condition not in (None, *CONDITIONS):
        raise ParameterError(f"condition: expected one of {', '.join(CONDITIONS)} or none, got {condition!r}")
    return PublishedRow(
        id=entry["id"],
        gait=entry["gait"],
        quantity=entry["quantity"],
        unit=entry["unit"],
        printed=float(entry["published"]),
        value=float(entry.get("read_as", entry["published"])),
        bar=parse_bar(entry["bar"], entry["unit"]),
        bar_text=entry["bar"],
        condition=condition,
        reading=entry.get("reading", ""),
    )


# Solvers, see the module.
PRINTED = "paper"
PROBABLE = "paper, probable beta"
EXACT = "exact"

EULER = {PRINTED: "printed", PROBABLE: "probable"}
"""Readings of beta by solver, for the solvers that integrate Eq. 8 by explicit Euler, as the paper does."""

SOLVERS = (*EULER, EXACT)
"""All solvers of a reproduction."""

Stances = Mapping[tuple[str, str], Stance]
"""Measured cycles by (gait, condition)."""

NOT_DETERMINABLE = ("walk.peak_inelastic", "walk.mean_inelastic", "walk.reduction")
"""Rows without a verdict: the walk grazes, and tens of micrometres of the ground level, which is fitted, move
them out of their bars with any solver (`level.compare_levels` measures it)."""

OURS = "not in the paper"
"""Beginning of a claim that the paper does not make."""

# Reasons why a row is spared.
REPORTED = "reported"
UNDETERMINED = "not determinable"


@dataclass(frozen=True)
class Reproduction:
    """Result of the four conditions.

    Attributes:
        rows: a dictionary for each published row and solver; see `compare`.
        shapes: a dictionary for each claim and solver: the claim, its solver, a `shapes.Verdict` and its
            figure.
        traces: cycles of dtype `measure.CYCLE`, with their first row at t = 0, by (gait, condition, solver).
        geometry: leg of the preset, which is identified and not published.
        published: the published numbers.
        ground: elastic ground of the preset.
        levels: a dictionary for each row that has a bar; see `level.compare_levels`.
        details: a dictionary for each gait and figure; see `details.details`.
    """

    rows: list[dict[str, Any]]
    shapes: list[dict[str, Any]]
    traces: dict[tuple[str, str, str], Trace]
    geometry: Geometry
    published: Published
    ground: Ground = field(default_factory=Ground)
    levels: list[dict[str, Any]] = field(default_factory=list)
    details: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Quantity:
    """Measure of a published row.

    Attributes:
        value: function of the stances in the row's condition (by default elastic) and in the opposite one.
        definition: text that defines the value.
        other_readings: function of the same stances that returns values under other readings, by name.
    """

    value: Callable[[Stance, Stance], float | None]
    definition: str
    other_readings: Callable[[Stance, Stance], dict[str, float | None]] = lambda stance, other: {}


def _reduction(elastic: float, inelastic: float) -> float:
    """Return the reduction of a force by elastic ground [%]."""
    return 100 * (inelastic - elastic) / inelastic


QUANTITIES = {
    "contact_start": Quantity(
        lambda s, _: s.start, "first instant at which a hoof point enters the ground, interpolated"
    ),
    "contact_end": Quantity(
        lambda s, _: s.end, "instant at which the last hoof point leaves the ground, interpolated"
    ),
    "duty": Quantity(lambda s, _: s.duty, "(last contact - first contact) / period"),
    "angle_contact": Quantity(
        lambda s, _: s.angle_start_deg, "hoof angle at first contact, heel up positive"
    ),
    "angle_liftoff": Quantity(lambda s, _: s.angle_end_deg, "hoof angle at last contact, heel up positive"),
    "angle_flat": Quantity(
        lambda s, _: s.angle_flat_deg,
        "hoof angle at the middle of the time that toe and heel both bear; the paper does not say when",
    ),
    "angle_variation": Quantity(
        lambda s, _: s.angle_variation_deg,
        "hoof angle at last contact minus hoof angle at first contact",
        lambda s, _: {"range_deg": s.angle_range_deg},
    ),
    "peak": Quantity(
        lambda s, _: s.peak,
        "maximum over the cycle of the normal force summed over toe and heel",
        lambda s, _: {"resultant_N": s.peak_resultant},
    ),
    "mean": Quantity(
        lambda s, _: s.mean,
        "normal force summed over toe and heel, mean over the whole cycle",
        lambda s, _: {"mean_over_stance_N": s.mean_stance},
    ),
    "reduction": Quantity(
        lambda elastic, inelastic: _reduction(elastic.peak, inelastic.peak),
        "(inelastic - elastic) / inelastic of the maximum normal forces",
        lambda elastic, inelastic: {
            "resultant_%": _reduction(elastic.peak_resultant, inelastic.peak_resultant)
        },
    ),
}
"""Measures by the part of a row's id between the gait and the condition."""


def compare(published: Published, stances: Stances, solver: str) -> list[dict[str, Any]]:
    """Compare the published numbers with the cycles of one solver.

    Returns:
        A dictionary for each published number: the published row, the definition of its measure, "simulated",
        "error" (signed, in the bar's measure), "spared" (the reason why the row has no verdict, or ""),
        "within_bar" (None if the row is spared) and "beside" (values under other readings by name).
    """
    return [_compare(row, stances, solver) for row in published.rows]


def counted(rows: Iterable[Mapping[str, Any]], shapes: Iterable[Mapping[str, Any]], solver: str) -> str:
    """Return a sentence with the numbers of a solver's rows within their bars and of claims that hold.

    Rows that are not determinable, and checks that are not claims of the paper, are counted separately;
    claims that hold in a reading other than the printed one are named.
    """
    own_rows = [row for row in rows if row["solver"] == solver]
    verdicts = [row["within_bar"] for row in own_rows if not row["spared"]]
    lost = sum(row["spared"] == UNDETERMINED for row in own_rows)
    claims = [shape for shape in shapes if shape["solver"] == solver]
    of_paper = [claim for claim in claims if not claim["claim"].startswith(OURS)]
    held = [claim for claim in of_paper if claim["holds"]]
    turned = sum(bool(claim["used"]) for claim in held)
    ours = [claim["holds"] for claim in claims if claim["claim"].startswith(OURS)]
    parts = (
        f"{sum(verdicts)} of {len(verdicts)} determinable rows within their bar",
        f"{lost} {UNDETERMINED}",
        f"{len(held) - turned} of {len(of_paper)} of the paper's claims about shape hold as printed"
        f"{f' and {turned} with the sign turned' if turned else ''}",
        f"{sum(ours)} of {len(ours)} checks of our own",
    )
    return ", ".join(parts)


def _compare(row: PublishedRow, stances: Stances, solver: str) -> dict[str, Any]:
    """Compare one published number; see `compare`."""
    simulated, definition, beside = _measure(row, stances)
    error = None if simulated is None else row.bar.error(simulated, row.value)
    if row.printed != row.value and simulated is not None:
        beside |= {"printed": row.printed, "error_against_printed": row.bar.error(simulated, row.printed)}
    spared = ""
    if row.bar.limit is None:
        spared = REPORTED
    elif row.id in NOT_DETERMINABLE:
        spared = UNDETERMINED
    return {
        "kind": "row",
        "id": row.id,
        "gait": row.gait,
        "quantity": row.quantity,
        "unit": row.unit,
        "condition": row.condition,
        "reading": row.reading,
        "definition": definition,
        "published": row.value,
        "bar": row.bar_text,
        "solver": solver,
        "simulated": simulated,
        "error": error,
        "spared": spared,
        "within_bar": None if spared else row.bar.holds(error),
        "beside": beside,
    }


def _measure(row: PublishedRow, stances: Stances) -> tuple[float | None, str, dict[str, Any]]:
    """Return the simulated value of a row, its definition, and values under other readings by name."""
    # The only row of both gaits; every other row compares conditions of one gait.
    if row.id == "ratio.angle_variation":
        run = stances["run", "elastic"]
        walk = stances["walk", "elastic"]
        return (
            run.angle_variation_deg / walk.angle_variation_deg,
            "ratio of the net changes of the hoof angle",
            {"ratio_of_ranges": run.angle_range_deg / walk.angle_range_deg},
        )
    quantity = QUANTITIES[row.id.split(".")[1].removesuffix(f"_{row.condition}")]
    condition = row.condition or "elastic"
    opposite = "inelastic" if condition == "elastic" else "elastic"
    pair = (stances[row.gait, condition], stances[row.gait, opposite])
    return quantity.value(*pair), quantity.definition, quantity.other_readings(*pair)


def severity(row: Mapping[str, Any], published: Published) -> float:
    """Return the error of a row in bars [-]: 0 if the bar is 'reported', infinite without a value."""
    limit = published.row(row["id"]).bar.limit
    if limit is None:
        return 0.0
    return float("inf") if row["error"] is None else abs(row["error"]) / limit


def betas(published: Published) -> dict[str, float]:
    """Return Baumgarte's beta of Eq. 8 [1/s] by its reading, in the order of `EULER`."""
    parameters = published.parameters
    # sqrt(2) alpha gives a damping ratio alpha / beta of 0.71; the printed sqrt(2 alpha) has no unit of 1/s.
    return {"printed": parameters["baumgarte_beta"], "probable": math.sqrt(2) * parameters["baumgarte_alpha"]}


def slowest_root(alpha: float, beta: float) -> float:
    """Return the real part [1/s] of the root of s^2 + 2 alpha s + beta^2 with which a closure error under
    Eq. 8 decays slowest."""
    return max(float(root.real) for root in np.roots([1, 2 * alpha, beta**2]))


def settings_of(solver: str) -> dict[str, Any]:
    """Return the arguments of `hoof_env/HorseLegFixed-v0` for one of `SOLVERS`."""
    # The environment has one solver of the paper, with its printed beta as the default.
    if solver == PROBABLE:
        return {"solver": "paper", "baumgarte_beta": betas(load_published())["probable"]}
    return {"solver": solver}

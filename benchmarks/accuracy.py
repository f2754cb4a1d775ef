"""Accuracy of the fast engine: `python -m benchmarks.accuracy --out docs/engine`.

Writes accuracy.md and convergence.svg, .png in some minutes. `--reference` makes the references that the
tests keep instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.accuracy_figure import draw_convergence
from benchmarks.crank_accuracy import DURATION, FILE, STRONG, Case, write_references
from benchmarks.horse_accuracy import (
    MASS,
    STIFF,
    TIMES,
    converged,
    fly,
    ground_account,
    plain_difference,
    stiff,
)
from hoof_env._output import staged
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.schemes import SCHEMES

Floats = NDArray[np.float64]

STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
"""Of the convergence plot [s]."""

KEPT_STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)
STIFF_STEPS = (1e-3, 2e-3, 5e-3)

BARS = {"midpoint": (3e-5, 2e-5), "rk3": (1.5e-5, np.inf)}
"""Worst and median error on the ground at 1 ms [rad]."""

CRANK = """\
One leg with a motor on a fixed trunk, 24 starts, beside `PlainCrank`. Bars on the ground: midpoint 3e-5 rad
at worst and 2e-5 in the median, rk3 1.5e-5 at worst. 'Natural' is the ground of `HorseLeg-v0`, 'elastic' the
defaults of `Ground`. 'Late' takes the approach speed at the first step inside the ground instead of at the
interpolated touch-down. The walk is what the bars are meant for. A run that stalls leaves the hoof creeping
between the threshold speeds of friction, whose rate asks for shorter steps than 1 ms (below the table): with
longer ones the hoof slides to and fro and creeps at a wrong speed. The last column keeps to that limit. The
run that keeps turning (identified, 3000 N m) is smooth but harder: it needs shorter steps than 1 ms for
these bars."""

CONVERGENCE = """\
Lines are medians of the 24 starts, bands reach to the worst; errors under 1e-11 rad are left out. On the
ground ('natural') kinks of force and friction leave second order."""

KEPT = """\
Flight: a horse of {:g} kg on four legs ({}) goes from walk to run in the air, 0.5 s. Closure: largest
error of a link's length or of a reported hoof point. Momentum: drift over the impulse of the weight;
spin: over itself; energy: error of the account over the work of the drives. Ground: one leg walks 2 s
under a suspended trunk; error of the account over what ground, friction, drag and damper took."""

HARD = """\
The same horse walks onto ground of {:.0e} N/m^1.5. Errors against rk4 at 2 us, which differs from an
adaptive run of the plain horse by {} (m, rad) after {:g} s. The warning: "{}"."""


@dataclass(frozen=True)
class Arguments:
    """What to do.

    Attributes:
        out: folder for the results.
        presets: legs; the horse is of the first.
        reference: make the tests' references instead.
    """

    out: Path = Path("docs/engine")
    presets: tuple[str, ...] = ("identified", "first_fit")
    reference: bool = False


def cases(preset: str) -> list[Case]:
    """What is measured of a leg at 1 ms."""
    walk = [
        Case(preset, "walk", ground)
        for ground in ("air", "natural", "elastic", "natural, no friction", "natural, no damping")
    ]
    return [*walk, Case(preset, "run", "natural"), Case(preset, "run", "natural", STRONG)]


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """Lines of a Markdown table."""
    return ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)] + [""]


def number(value: float) -> str:
    """Two digits."""
    return "broke off" if not np.isfinite(value) else f"{value:.1e}"


def crank_rows(case: Case, ends: Floats) -> Iterator[list[str]]:
    """One line a scheme."""
    for scheme in SCHEMES:
        error, late = (
            case.errors(scheme, ends, approach=approach) for approach in ("interpolated", "sampled")
        )
        fine = case.errors(scheme, ends, substeps=8)
        bar = ""
        if scheme in BARS and case.ground != "air":
            worst, median = BARS[scheme]
            bar = "met" if error.max() < worst and np.median(error) < median else "missed"
        limit = "" if case.motor == Motor() else f", {case.motor.torque_limit:g} N m"
        yield [case.preset, case.gait + limit, case.ground, scheme, number(error.max()),
               number(float(np.median(error))), bar, number(late.max()), number(fine.max())]  # fmt: skip


def crank_text(found: dict[Case, Floats]) -> list[str]:
    """The bars."""
    rows = [row for case, ends in found.items() for row in crank_rows(case, ends)]
    head = ["leg", "gait", "ground", "scheme", "worst [rad]", "median [rad]", "bar", "worst, late [rad]",
            "worst, 8 substeps [rad]"]  # fmt: skip
    speeds = []
    for case, ends in found.items():
        if case.gait == "run":
            turned = ends - np.arange(len(ends)) * 2 * np.pi / len(ends)
            friction = case.engine("midpoint").step_limits["friction"]
            speeds.append(
                f"{case.preset}, run, {case.motor.torque_limit:g} N m: turns by {turned.min():.2f} to "
                f"{turned.max():.2f} rad of {case.parameters.crank_speed * DURATION:.2f} commanded; friction "
                f"asks for steps of {1e3 * friction:.2g} ms."
            )
    return ["## Crank angle after 2 s, steps of 1 ms", "", CRANK, "",
            *table(head, rows), *[f"- {line}" for line in speeds], ""]  # fmt: skip


def kept_text(preset: str) -> list[str]:
    """Momentum, energy, closure."""
    rows = []
    for scheme in SCHEMES:
        for step in KEPT_STEPS:
            kept = fly(preset, scheme, step)
            rows.append([scheme, f"{1e3 * step:g}", *map(number, (kept.closure, kept.momentum, kept.spin,
                         kept.energy, ground_account(preset, scheme, step)))])  # fmt: skip
    head = ["scheme", "step [ms]", "closure [m]", "momentum [-]", "spin [-]", "energy, flight [-]",
            "energy, ground [-]"]  # fmt: skip
    return ["## What is kept", "", KEPT.format(MASS, preset), "", *table(head, rows)]


def stiff_text(preset: str) -> list[str]:
    """Stiff ground."""
    expected = converged(preset)
    rows, said = [], ""
    for scheme in SCHEMES:
        for step in STIFF_STEPS:
            for substeps in (None, 1):
                got = stiff(preset, scheme, step, substeps, expected)
                said = said or got.warned
                rows.append([scheme, f"{1e3 * step:g}",
                             f"{got.substeps}, {'chosen' if substeps is None else 'asked for'}",
                             "yes" if got.warned else "no", *(number(1e3 * x) for x in got.trunk),
                             *(number(x) for x in got.crank)])  # fmt: skip
    head = ["scheme", "step [ms]", "substeps", "warns", *(f"trunk, {x:g} s [mm]" for x in TIMES),
            *(f"angles, {x:g} s [rad]" for x in TIMES)]  # fmt: skip
    plain = number(plain_difference(preset, expected))
    text = HARD.format(STIFF.stiffness, plain, TIMES[0], said)
    return ["## Stiff ground", "", text, "", *table(head, rows)]


def main(arguments: Arguments) -> None:
    """Measure and write."""
    if arguments.reference:
        write_references(Path("tests/dynamics") / FILE)
        return
    todo = [case for preset in arguments.presets for case in cases(preset)]
    found = {case: case.reference() for case in tqdm(todo, desc="references", disable=None)}
    shown = {case: ends for case, ends in found.items()
             if case.gait == "walk" and case.ground in ("air", "natural")}  # fmt: skip
    errors = {
        case: {scheme: [case.errors(scheme, ends, step) for step in STEPS] for scheme in SCHEMES}
        for case, ends in shown.items()
    }
    text = ["# Accuracy of the fast engine", "", "Written by `python -m benchmarks.accuracy`.", "",
            *crank_text(found), "## Convergence", "",
            "![Error against step](convergence.png)", "", CONVERGENCE, "", *kept_text(arguments.presets[0]),
            *stiff_text(arguments.presets[0])]  # fmt: skip
    with staged(arguments.out) as stage:
        (stage / "accuracy.md").write_text("\n".join(text).rstrip() + "\n", encoding="utf-8")
        draw_convergence(stage / "convergence", STEPS, errors)
    print("\n".join(text))


if __name__ == "__main__":
    main(tyro.cli(Arguments))

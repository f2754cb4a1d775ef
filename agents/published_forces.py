"""Kinematic gaits beside published forces of horses, limb by limb: `python -m agents.published_forces`.

No time series of a grown horse's ground reaction forces is open, so the curve is made from what is published:
stance peaks, shape, duty factor and stride. The vertical force has the shape of Alexander and Jayes (1978):
two peaks at a walk and half a sine at a trot. The fore-aft force is half a sine of braking in the first half
of the stance and half a sine of propulsion in the second, with published peaks; of a walk's hind limb there
are none. All numbers are those of `agents/judges.json`.

The command writes both records as `hoof-env compare` reads them, compares them as that does, and writes
`docs/evidence/horse_forces.md` with its pictures.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse, run
from agents.judge_pictures import ranges_of, shape_of
from agents.judges import nearest_of, read_judges
from agents.limb_names import LANDS
from hoof_env._output import markdown_table
from hoof_env.constants import GRAVITY
from hoof_env.lab.compare import Comparison, compare
from hoof_env.lab.picture import draw, warnings_of
from hoof_env.lab.read import read_record
from hoof_env.records import export_episode
from hoof_env.tasks.horse import HIP_HEIGHT, MASS
from hoof_env.tasks.horse_gaits import PAIRS, kinematic_speeds

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/Horse-v0"
EVIDENCE = Path(__file__).parents[1] / "docs" / "evidence"
NAME = "horse_forces"
RATE = 500.0  # of a published record [Hz]
STRIDES = 6  # in it
SECONDS = 8.0  # of the model's
WARM = 2.0  # left out of it [s]

PAGE = """# Forces of the kinematic gaits beside a horse's

Written by `{command}` at commit `{commit}`.

**Asked.** How far the forces of `kinematic-walk` and `kinematic-trot` are from a horse's over the whole
stance, by `hoof-env compare`.

**The horse.** No time series of a grown horse's forces is open, so A is no measurement. It has published
stance peaks, duty factors and strides ([the judges](../../agents/judges.json)), the vertical shape of
Alexander and Jayes (1978), two peaks at a walk and half a sine at a trot, and half a sine each of braking and
of propulsion with published peaks, a foal's at the walk. A walk's hind limb has no published fore-aft force.
Averaged over a stride, the vertical forces of A bear {shares} of the weight, where an animal's bear 1:
so well do numbers of several sources fit together.

**Found.** {found}

{table}

RMSE and errors are B less A in body weights; brackets have A's own figure. Touchdown is laid on touchdown,
left limbs stand for both. In the plane left and right are names, and the model's limbs are named as they land
on a horse ([why](../decisions.md#the-horse)).

{pictures}

## Warnings of the comparison

{warnings}

The same by hand, with the files that the command leaves in `{folder}`, without the first {warm:g} s of each
episode:

```bash
{commands}
```
"""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    out: Path = EVIDENCE
    """folder of the page"""
    records: Path = Path("runs/published")
    """folder of the records"""


def vertical(kind: str, pair: str, points: int) -> Floats:
    """Return the vertical force of a horse's stance [N/kg], shape (points,)."""
    shape = shape_of(read_judges()[kind]["froude"], pair)
    assert shape is not None
    return np.asarray(np.interp(np.linspace(0, 1, points), np.linspace(0, 1, len(shape)), shape))


def fore_aft(kind: str, pair: str, froude: float, points: int) -> Floats:
    """Return the fore-aft force of a horse's stance [N/kg], shape (points,), forward positive; NaN where
    no peak is published."""
    peaks = ranges_of(kind, froude)[pair]["lines"]
    if not peaks:
        return np.full(points, np.nan)
    x = np.linspace(0, 1, points)
    low, high = min(peaks), max(peaks)
    wave = np.abs(np.sin(2 * np.pi * x))
    return np.asarray(np.where(x < 0.5, low, high) * wave)


def published(kind: str, speed: float) -> tuple[Floats, dict[str, Floats], float]:
    """Return a horse's forces at a speed [m/s].

    Returns:
        Times, shape (n,) [s], forces forward and upward of each pair's left limb, shape (n, 2) [N/kg], and
        the share of the weight that all four limbs bear on average.
    """
    judges = read_judges()
    froude = speed**2 / (GRAVITY * HIP_HEIGHT)
    if kind == "walk":
        duty = float(judges["walk"]["duty"]["horse"])
        stride = float(judges["walk"]["stride_over_hip"]["horse"])
    else:
        duty = float(nearest_of(judges["duty"], froude)["horse"][0])
        stride = float(nearest_of(judges["stride_over_hip"], froude)["horse"][0])
    period = stride * HIP_HEIGHT / speed
    time = np.arange(round(STRIDES * period * RATE)) / RATE
    forces = {}
    share = 0.0
    for pair in PAIRS:
        phase = (time / period - 0.1 - (LANDS[kind] if pair == "fore" else 0.0)) % 1.0
        stance = np.linspace(0, duty, 201)
        columns = [fore_aft(kind, pair, froude, 201), vertical(kind, pair, 201)]
        forces[pair] = np.stack([np.interp(phase, stance, one, right=0.0) for one in columns], 1)
        # Two limbs of each pair
        share += 2 * duty * float(np.mean(columns[1])) / GRAVITY
    return time, forces, share


def write_published(path: Path, time: Floats, forces: dict[str, Floats]) -> None:
    """Write a horse's forces as a table of a laboratory."""
    columns = {"time [s]": time}
    for pair, of_pair in forces.items():
        for axis, values in zip("xy", of_pair.T, strict=True):
            # A limb without published fore-aft forces has no such column
            if np.isfinite(values).all():
                columns[f"left_{pair}_force_{axis} [N/kg]"] = values
    rows = np.stack([*columns.values()], 1)
    lines = [",".join(columns), *(",".join(f"{value:.6g}" for value in row) for row in rows)]
    runs.write_text(path, "\n".join(lines) + "\n")


def leave_out_beginning(path: Path) -> None:
    """Leave the first `WARM` seconds of a record out of its file: the first strides depend on the start, and
    whoever compares the file is to find the same."""
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    kept = [row for row in rows if float(row.partition(",")[0]) >= WARM]
    runs.write_text(path, "\n".join([head, *kept]) + "\n")


def compared(kind: str, folder: Path) -> tuple[Comparison, float]:
    """Write and compare both records of a gait; return the comparison and the share of the weight that the
    horse's forces bear."""
    name = f"kinematic-{kind}"
    time, forces, share = published(kind, kinematic_speeds()[name])
    horse, gait = folder / f"published-{kind}.csv", folder / f"{name}.csv"
    write_published(horse, time, forces)
    export_episode(gait, name, ENV_ID, seconds=SECONDS)
    leave_out_beginning(gait)
    return compare(read_record(horse, mass=MASS), read_record(gait, mass=MASS), units="BW"), share


def rows_of(kind: str, found: Comparison) -> list[list[str]]:
    """Return the table's rows of a gait."""
    rows = []
    for limb, errors in found.limbs.items():
        for force, of_force in errors.forces.items():
            whole = force in ("vertical", "fore-aft")
            if not np.isfinite(of_force.rmse if whole else of_force.peak):
                continue
            rows.append(
                [
                    kind,
                    limb.removeprefix("left_"),
                    force,
                    f"{of_force.rmse:.3f}" if whole else "",
                    f"{of_force.r:.2f}" if whole else "",
                    "" if force == "fore-aft" else f"{of_force.peak_error:+.3f} ({of_force.peak:.3f})",
                    f"{of_force.impulse_error:+.4f} ({of_force.impulse:.4f})",
                    f"{1e3 * errors.contact_error:+.0f} ({1e3 * errors.contact:.0f})"
                    if force == "vertical"
                    else "",
                ]
            )
    return rows


def summary(of_gaits: dict[str, Comparison]) -> str:
    """Return how far the gaits are from a horse, in a sentence for each."""
    told = []
    for kind, found in of_gaits.items():
        parts = []
        for limb, errors in found.limbs.items():
            for name in ("vertical", "fore-aft"):
                force: Any = errors.forces.get(name)
                if force is not None and np.isfinite(force.rmse):
                    parts.append(f"{limb.removeprefix('left_')} {name} {force.rmse:.2f} (r {force.r:.2f})")
        told.append(f"{kind}: {', '.join(parts)}")
    return "RMSE in body weights: " + "; ".join(told) + "."


HEAD = (
    "gait",
    "limb",
    "force",
    "RMSE [BW]",
    "r",
    "peak [BW]",
    "impulse [BW s]",
    "contact [ms]",
)


def write(args: Args) -> None:
    """Compare and write the page."""
    # Before the pictures are written
    commit = runs.versions().get("commit", "unknown")
    folder = args.out / NAME
    folder.mkdir(parents=True, exist_ok=True)
    args.records.mkdir(parents=True, exist_ok=True)
    of_gaits, shares, rows = {}, [], []
    for kind in ("walk", "trot"):
        found, share = compared(kind, args.records)
        of_gaits[kind] = found
        shares.append(f"{share:.2f} ({kind})")
        rows += rows_of(kind, found)
        draw(found, folder / f"{kind}.png")
    names = {
        kind: (args.records / f"published-{kind}.csv", args.records / f"kinematic-{kind}.csv")
        for kind in of_gaits
    }
    page = PAGE.format(
        command="python -m agents.published_forces",
        commit=commit,
        shares=" and ".join(shares),
        found=summary(of_gaits),
        table=markdown_table(HEAD, rows),
        pictures="\n\n".join(
            f"![The {kind}: published forces of a horse (A) and the model's (B)]({NAME}/{kind}.png)"
            for kind in of_gaits
        ),
        warnings="\n".join(f"* {kind}: {text}" for kind, one in of_gaits.items() for text in warnings_of(one))
        or "None.",
        folder=args.records,
        warm=WARM,
        commands="\n".join(
            f"hoof-env compare {a} {b} --mass-a {MASS:g} --mass-b {MASS:g} --units BW --out {kind}.png"
            for kind, (a, b) in names.items()
        ),
    )
    runs.write_text(args.out / f"{NAME}.md", page)
    print(f"written: {args.out / NAME}.md")


def main(argv: list[str] | None = None) -> None:
    """Write the page."""
    write(parse(Args, argv, "python -m agents.published_forces", __doc__))


if __name__ == "__main__":
    run(main)

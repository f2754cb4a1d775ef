"""`hoof-env carry`: finds the walk that carries, compares it with the paper's and adds it to its preset."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hoof_env._output import check_folder, staged
from hoof_env.errors import DataFileError, HoofEnvError, OutputError, ParameterError
from hoof_env.gait.parameters import gait_names, load_gait, paper_gaits
from hoof_env.ground.preset import load_ground
from hoof_env.identify.carry import EVALUATIONS, JUDGED, NAME, Found, find_carrying_walk
from hoof_env.identify.carry_measure import DEMANDS, SETTLE, STRIDES, Carriage, Course, missed
from hoof_env.identify.report import versions
from hoof_env.leg.geometry import read_preset

COLUMNS = (
    ("speed m/s", "speed_m_s", "{:.2f}", 1),
    ("mean force / load", "load_share", "{:.2f}", 1),
    ("peak force / load", "peak_share", "{:.2f}", 1),
    ("trunk over its rest, cm", "rise_m", "{:+.1f}", 100),
    ("bounce cm", "bounce_m", "{:.1f}", 100),
    ("duty factor", "duty_factor", "{:.2f}", 1),
    ("hoof tilt deg", "hoof_angle_deg", "{:.0f}", 1),
    ("clearance cm", "clearance_m", "{:.0f}", 100),
    ("strides differ by mm", "unsteady_m", "{:.2f}", 1000),
    ("speeds differ by mm/s", "speed_spread_m_s", "{:.1f}", 1000),
)
"""Heading, quantity of a `Carriage`, format and factor of each column."""


def carry(
    preset: str,
    out: Path,
    say: Callable[[str], None],
    *,
    seed: int = 0,
    evaluations: int | None = None,
    workers: int = 2,
    free_crank: bool = False,
) -> list[Path]:
    """Find the walk, say how it and the paper's gaits carry, and write the preset with it and `carry.md`.

    Args:
        preset: name or JSON file; a file of its name goes to the folder `out`.
        say: takes the table and lines of progress.
        seed, evaluations, workers, free_crank: see `find_carrying_walk`; `EVALUATIONS` if None.

    Returns:
        Paths of the files.

    Raises:
        HoofEnvError: bad input; or no gait found meets every demand, then nothing is written.
    """
    target = Path(out) / f"{Path(preset).stem}.json"
    if Path(preset).exists() and target.exists() and target.samefile(preset):
        raise ParameterError(
            f"out: expected a folder other than that of the preset {preset}, got {str(out)!r}"
        )
    if target.exists():
        raise OutputError(f"{str(target)!r} exists already; name another folder")
    budget = EVALUATIONS if evaluations is None else evaluations
    command = f"hoof-env carry --preset {shlex.quote(preset)} --out {shlex.quote(str(out))} --seed {seed}"
    command += f" --evaluations {budget}" + (" --free-crank" if free_crank else "")
    if not isinstance(read_preset(preset).get("gait_provenance", {}), dict):
        raise DataFileError(f"preset {preset}: expected an object 'gait_provenance'")
    course = Course(preset, JUDGED)
    gaits = paper_gaits({name: load_gait(name, preset) for name in gait_names(preset) if name != NAME})
    load_ground(preset)  # the trunk's ground is another, but a damaged file is not added to
    check_folder(out)
    with _bar(budget, say) as progress:
        found = find_carrying_walk(
            preset, seed=seed, evaluations=budget, workers=workers, free_crank=free_crank, progress=progress
        )
    rows = {name: course.measure(gait) for name, gait in gaits.items()} | {NAME: found.carriage}
    say(table(rows))
    if found.missed:
        raise HoofEnvError(
            f"no carrying walk found in {found.evaluations} evaluations: the best {', '.join(found.missed)}; "
            "try another --seed, more --evaluations" + ("" if free_crank else " or --free-crank")
        )
    with staged(Path(out)) as stage:
        (stage / target.name).write_text(
            json.dumps(with_gait(preset, found), indent=1) + "\n", encoding="utf-8"
        )
        (stage / "carry.md").write_text(page(rows, found, course, command), encoding="utf-8")
    return [target, Path(out) / "carry.md"]


def with_gait(preset: str, found: Found) -> dict[str, Any]:
    """The content of a preset with the gait `NAME` added, and its provenance under `gait_provenance`."""
    data = read_preset(preset)
    used = ", ".join(f"{name} {number}" for name, number in versions().items())
    own = found.gait.crank_speed == load_gait("walk", preset).crank_speed
    provenance = (
        "Found, not published: of the open-loop walks that carry the default suspended trunk of HorseLeg-v0, "
        f"that with the lowest peak force; hoof-env carry, seed {found.seed}, {found.evaluations} gaits "
        f"tried, the crank's speed {'that of the walk' if own else 'searched too'}; {used}."
    )
    return {
        **data,
        "gaits": {**data["gaits"], NAME: asdict(found.gait)},
        "gait_provenance": {**data.get("gait_provenance", {}), NAME: provenance},
    }


def table(rows: Mapping[str, Carriage]) -> str:
    """How gaits carry, by name, in Markdown."""
    lines = [
        f"| gait | {' | '.join(column[0] for column in COLUMNS)} | carries |",
        "|---" * (len(COLUMNS) + 2) + "|",
    ]
    for name, carriage in rows.items():
        cells = [form.format(factor * getattr(carriage, key)) for _, key, form, factor in COLUMNS]
        verdict = ", ".join(missed(carriage))
        lines.append(f"| {name} | {' | '.join(cells)} | {f'no: {verdict}' if verdict else 'yes'} |")
    return "\n".join(lines)


def page(rows: Mapping[str, Carriage], found: Found, course: Course, command: str) -> str:
    """The table with what its words mean, in Markdown."""
    trunk = course.trunk
    demands = "\n".join(f"* `{d.quantity}` {_range(d.low, d.high)}" for d in DEMANDS)
    numbers = ", ".join(f"{name} {value:.4f}" for name, value in asdict(found.gait).items())
    return f"""# A walk that carries

`{command}`

{table(rows)}

The trunk is the environment's default: {course.weight:.0f} N with the leg, of which the leg must
bear a load of {course.load:.0f} N at rest, on a spring of {trunk.stiffness:g} N/m. Forces are vertical.
Means of {course.count} of the environment's starts, {STRIDES} strides each after {SETTLE:g} s; the last
two numbers are the largest differences among all of them. Over steady strides the mean force is the load plus
the spring's stiffness times the trunk's height over its rest. {NAME} is called a walk for its speed
and stride rate; a duty factor above 0.5, the other mark of a walk, is not demanded.

{NAME}: {numbers} (rad/s, rad).

A gait carries if it meets every demand:

{demands}
"""


def _range(low: float, high: float) -> str:
    if math.isinf(low) or math.isinf(high):
        return f"at most {high:g}" if math.isinf(low) else f"at least {low:g}"
    return f"{low:g} to {high:g}"


@contextmanager
def _bar(total: int, say: Callable[[str], None]) -> Iterator[Callable[[int, float], None]]:
    """Progress as a bar on a terminal, elsewhere as a line at each tenth."""
    if not sys.stderr.isatty():
        mark = [1]

        def line(count: int, best: float) -> None:
            if 10 * count >= mark[0] * total:
                mark[0] = 10 * count // total + 1
                say(f"{count} gaits tried, lowest cost {best:.2f}")

        yield line
        return
    from tqdm import tqdm

    with tqdm(total=total, unit=" gaits", dynamic_ncols=True) as bar:

        def show(count: int, best: float) -> None:
            bar.set_description_str(f"lowest cost {best:.2f}")
            bar.update(count - bar.n)

        yield show

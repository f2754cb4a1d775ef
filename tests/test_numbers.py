"""Results on the pages, read off the data that they come from.

A result is followed by a comment that names its source, which no reader sees, as in
`183<!-- = score HorseLeg-v0 policy return -->`. `python tests/test_numbers.py` lists the numbers with units
that have none, page by page: most are settings and definitions.
"""

import csv
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.evaluation.statistics import iqm
from hoof_env.paper.rows import EXACT, OURS, PRINTED, PROBABLE, REPORTED
from hoof_env.tasks.horse import MASS
from hoof_env.tasks.horse_terms import HORSE_TERMS
from hoof_env.tasks.reward import check_weights

ROOT = Path(__file__).parents[1]
PAGES = (
    "README.md",
    *(f"docs/{name}.md" for name in ("index", "agents", "engine", "help", "horse", "own_task", "paper")),
    *(f"docs/{name}.md" for name in ("project", "start", "task", "view", "elasticity", "parameters")),
)
"""Pages whose results are marked."""

MARK = re.compile(r"(?P<number>-?\d[\d,]*(?:\.\d+)?)(?P<unit>[^<\d|]{0,8})<!-- = (?P<source>.+?) -->")
UNITS = (
    "m/s",
    "kN/s",
    "kN",
    "N/kg",
    "N",
    "kg",
    "mm",
    "ms",
    "s",
    "m",
    "rad",
    "J",
    "steps",
    "seconds",
    "minutes",
)
NUMBER = re.compile(rf"(?<![\w.])\d[\d,]*(?:\.\d+)?[ -]?(?:%|(?:{'|'.join(UNITS)})(?![\w/]))(?!<!--)")


def score(policy_id: str, policy: str, figure: str) -> float:
    """The mean figure of a policy in the file of a policy that ships."""
    means = json.loads((ROOT / "hoof_env/data/policies" / policy_id / "score.json").read_text())["policies"]
    found = means[policy]["mean"]
    if figure == "speed":
        return found["distance_m"] / 10.0  # no episode failed, and each lasts 10 s
    if figure == "peak_kn":
        return found["stance_peak_n"] / 1000.0
    if figure == "loading_kn_s":
        return found["loading_rate_n_s"] / 1000.0
    return found[figure]


def stock(name: str, algo: str, steps: str) -> float:
    """The interquartile mean over seeds of the last return of a stock learner up to so many steps."""
    last: dict[str, tuple[int, float]] = {}
    with (ROOT / "docs/evidence/stock/curves.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            here = int(row["steps"])
            is_asked = (row["env_id"], row["algo"]) == (f"hoof_env/{name}", algo) and here <= int(steps)
            if is_asked and here >= last.get(row["seed"], (0, 0.0))[0]:
                last[row["seed"]] = here, float(row["return"])
    return float(iqm([value for _, value in last.values()])[0])


def speed(*case: str) -> float:
    """The ratio of a case in the committed benchmark of the environments."""
    text = (ROOT / "benchmarks/results/512-bits/env_speed.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith(f"| {' '.join(case)} |"))
    return float(row.split("|")[5].split()[0])


def engine_speed(*case: str) -> float:
    """The rate [million steps a second] of a case in the committed benchmark of the engine, or its ratio to
    MuJoCo with all hinges or with the rigid ones."""
    name, _, column = " ".join(case).partition(": ")
    text = (ROOT / "benchmarks/results/512-bits/speed.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith(f"| {name} | 512 |"))
    return float(row.split("|")[{"rate": 3, "all": 4, "rigid": 5}[column]].split()[0])


def leg(figure: str) -> float:
    """A figure of the environment with the defaults."""
    env = HorseLegEnv()
    env.reset(seed=0)
    if figure == "hip_height":
        return env.batch.body.height
    mass = env.weight / 9.81
    if figure == "mass":
        return mass
    assert figure == "peak_weights"
    return score("HorseLeg-v0", "policy", "stance_peak_n") / env.weight


def horse(figure: str) -> float:
    """The mass of the horse."""
    assert figure == "mass"
    return MASS


def constant(module: str, name: str, *keys: str) -> float:
    """The size of a constant of a module, or of an item of it; "percent" makes it a hundred times that."""
    value: Any = vars(import_module(module))[name]
    for key in keys:
        value = 100 * value if key == "percent" else value[key]
    return abs(value)


def fastest_gait() -> float:
    """The speed [m/s] of the fastest reference gait that is stored."""
    gaits = json.loads((ROOT / "hoof_env/data/horse/gaits.json").read_text(encoding="utf-8"))
    return max(gaits["reference"]["speeds"])


def gain(of: str) -> float:
    """What the shipped agent of the horse returns beyond the reference gait [%]: of all, or of the rest that
    is not for staying up."""
    ours, theirs = (score("Horse-v0", policy, "return") for policy in ("policy", "reference"))
    staying_up = 10.0 * check_weights(None, HORSE_TERMS)["alive"]
    return 100.0 * (ours - theirs) / {"all": theirs, "rest": theirs - staying_up}[of]


def evidence(*words: str) -> float:
    """A number on a page of evidence, "PAGE; ROW; COLUMN; N; DIVISOR": the Nth number of the first cell in a
    row and a column that begin with these, over the divisor, if there is one."""
    page, row, column, place, *divisor = " ".join(words).split("; ")
    head: list[str] = []
    for line in (ROOT / f"docs/evidence/{page}.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        head = (head or cells) if cells else []
        if cells and cells[0].startswith(row) and any(title.startswith(column) for title in head):
            cell = cells[next(k for k, title in enumerate(head) if title.startswith(column))]
            found = float(re.findall(r"-?\d+(?:\.\d+)?", cell)[int(place)])
            return found / float(divisor[0]) if divisor else found
    raise AssertionError(f"{page} has no such cell: {row}, {column}")


def reproduced(solver: str, count: str) -> float:
    """How many rows of the committed reproduction have a bar, or are within it, with a solver."""
    entries = json.loads((ROOT / "docs/paper/reproduction.json").read_text(encoding="utf-8"))
    names = {"exact": EXACT, "printed": PRINTED, "probable": PROBABLE}
    rows = [entry for entry in entries if entry["kind"] == "row" and entry["solver"] == names[solver]]
    barred = [row for row in rows if row["spared"] != REPORTED]
    return {"rows": len(barred), "within": sum(bool(row["within_bar"]) for row in barred)}[count]


def claims(count: str) -> float:
    """How many claims of the paper there are, hold as printed, or hold with a turned sign, converged."""
    entries = json.loads((ROOT / "docs/paper/reproduction.json").read_text(encoding="utf-8"))
    shapes = [entry for entry in entries if entry["kind"] == "shape" and entry["solver"] == EXACT]
    of_paper = [shape for shape in shapes if not shape["claim"].startswith(OURS)]
    turned = sum(bool(shape["used"]) for shape in of_paper if shape["holds"])
    held = sum(shape["holds"] for shape in of_paper)
    return {"all": len(of_paper), "printed": held - turned, "turned": turned}[count]


def elasticity(*words: str) -> float:
    """A figure of elastic against inelastic ground, "GAIT; SET-UP; FIGURE" of landings under the paper's law,
    "...; size" without its sign, "steady; GAIT; SET-UP", or "free mass; FIGURE"."""
    keys = " ".join(words).split("; ")
    data = json.loads((ROOT / "docs/evidence/elasticity.json").read_text(encoding="utf-8"))
    if keys[0] == "free mass":
        rows = (row for row in data["free_mass"] if row["law"] == "lankarani-nikravesh")
        return next(row[keys[1]] for row in rows if row["restitution"] == 0.0)
    part = "landings"
    if keys[0] == "steady":
        part = "steady"
        keys = [*keys[1:], "change"]
    gait, setup, figure, *size = keys
    rows = (row for row in data[part] if (row["law"], row["restitution"]) == ("lankarani-nikravesh", 0.0))
    found = next(row[figure] for row in rows if (row["gait"], row["setup"]) == (gait, setup))
    return abs(found) if size else found


def parameters(*words: str) -> float:
    """A figure of the ground's parameters: "GAIT; STIFFNESS; RESTITUTION; FIGURE" under the suspended trunk,
    or "fixed; GAIT; RESTITUTION; FIGURE" of the energy under the fixed one."""
    keys = " ".join(words).split("; ")
    data = json.loads((ROOT / "docs/evidence/parameters.json").read_text(encoding="utf-8"))
    if keys[0] == "fixed":
        rows = (row for row in data["energy"] if [row["gait"], f"{row['restitution']:g}"] == keys[1:3])
    else:
        rows = (
            row
            for row in data["suspended"]
            if [row["gait"], f"{row['factor']:g}", f"{row['restitution']:g}"] == keys[:3]
        )
    return next(rows)[keys[3]]


SOURCES: dict[str, Callable[..., float]] = {
    "score": score,
    "stock": stock,
    "speed": speed,
    "engine_speed": engine_speed,
    "leg": leg,
    "horse": horse,
    "constant": constant,
    "fastest_gait": fastest_gait,
    "gain": gain,
    "evidence": evidence,
    "reproduced": reproduced,
    "claims": claims,
    "elasticity": elasticity,
    "parameters": parameters,
}


def marks() -> Iterator[tuple[str, str, str]]:
    """Page, number and source of every marked result."""
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        assert text.count("<!-- = ") == len(MARK.findall(text)), f"{page}: a mark without a number before it"
        yield from ((page, found["number"], found["source"]) for found in MARK.finditer(text))


@pytest.mark.parametrize(("page", "number", "source"), list(marks()))
def test_a_result_is_what_its_source_has(page, number, source):
    kind, *arguments = source.split()
    decimals = len(number.partition(".")[2])
    assert f"{SOURCES[kind](*arguments):.{decimals}f}" == number.replace(",", ""), source


@cache
def unmarked(page: str) -> list[str]:
    """Numbers with units of a page, code apart, that name no source."""
    text = (ROOT / page).read_text(encoding="utf-8")
    prose = re.sub(r"```.*?```|`[^`\n]*`|\]\([^)]*\)", " ", text, flags=re.DOTALL)
    return [found.group() for found in NUMBER.finditer(prose)]


def test_a_number_without_a_source_is_found():
    assert NUMBER.findall("forces of 3.2 kN and 12 % in 5 steps") == ["3.2 kN", "12 %", "5 steps"]
    assert not NUMBER.findall("Python 3.11, 1024 legs, Eq. 8, 3.2 kN<!-- = score a b c -->")


# -- whole tables ------------------------------------------------------------------------------


def table(page: str, *titles: str) -> dict[str, dict[str, str]]:
    """The first table of a page whose head has these titles: cells by the title of the column, of each row by
    its first cell; without marks."""
    text = re.sub(r"<!--.*?-->", "", (ROOT / page).read_text(encoding="utf-8"))
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        head, _, *rows = [
            [cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()
        ]
        if set(titles) <= set(head):
            return {row[0].strip("`"): dict(zip(head, row, strict=True)) for row in rows}
    raise AssertionError(f"{page} has no table with {titles}")


def numbers(text: str) -> list[float]:
    """The numbers of a cell."""
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text)]


def differs(shown: str, values: Iterable[float]) -> bool:
    """True if the numbers of a cell are not these values, rounded to the digits that each shows."""
    texts = re.findall(r"-?\d+(?:\.\d+)?", shown)
    steps = [0.1 ** len(text.partition(".")[2]) for text in texts]
    pairs = zip(map(float, texts), steps, values, strict=True)
    return any(abs(number - value) > 0.5001 * step for number, step, value in pairs)


COLUMNS = (
    "return",
    "speed m/s",
    "stance peak kN",
    "loading rate kN/s",
    "slip of a stance m",
    "cost of transport",
    "weight share",
)
"""Columns of the table of agents whose titles the evidence shares."""


def test_agents_reach_on_the_page_what_they_reach_in_the_evidence():
    shown = table("docs/agents.md", "the suspension's share")
    with (ROOT / "docs" / "evidence" / "actions" / "agents.csv").open(encoding="utf-8", newline="") as file:
        found = {row["policy"]: row for row in csv.DictReader(file)}
    seeds = [row for name, row in found.items() if name.startswith("ppo_flat, seed")]
    assert len(seeds) == 10
    for title, own in (("the suspension's share", "suspension's share"), *((one, one) for one in COLUMNS)):
        for name, row in (
            ("scripted run", "run"),
            ("zero action", "zero action"),
            ("best open-loop gait", "open-loop"),
        ):
            assert not differs(shown[name][title], numbers(found[row][own])[:1]), (name, title)
        values = [numbers(seed[own])[0] for seed in seeds]
        assert not differs(shown["ppo_flat`, ten seeds"][title], (min(values), max(values))), title


def test_seconds_to_learn_are_those_of_the_benchmark():
    page = "benchmarks/results/512-bits/learn_seconds.md"
    row = table(page, "seconds to the best open loop")["ppo_flat"]
    best = numbers(row["seconds to the best open loop"])
    near = numbers(row["seconds to within 5 %"])
    text = (ROOT / "docs/agents.md").read_text(encoding="utf-8")
    said = f"after {best[0]:g} seconds of learning (median of ten seeds, {best[2]:g} in the worst)"
    assert said in text
    assert f"within 5 % of its final return after {near[0]:g}" in text


def test_reference_gaits_on_the_page_are_those_of_the_evidence():
    shown = table("docs/horse.md", "Froude number", "0.25")
    found = table("docs/evidence/horse.md", "Fr 0.1, 1.17 m/s")
    speeds = {title.split(",")[0].removeprefix("Fr "): title for title in found["fell"] if title != "figure"}
    for name, row in shown.items():
        for froude in ("0.1", "0.25", "0.5", "1"):
            if name == "speed over the command":
                reached = numbers(found["speed [m/s]"][speeds[froude]])[0]
                assert abs(float(row[froude]) - reached / numbers(speeds[froude])[1]) < 0.008
                continue
            pair = [name.replace("fore and hind", leg) for leg in ("fore", "hind")]
            own = [numbers(found[one][speeds[froude]])[0] for one in dict.fromkeys(pair)]
            assert not differs(row[froude], own), (name, froude)


def test_a_living_horse_is_compared_with_what_the_evidence_has():
    shown = table("docs/horse.md", "slow gait", "trot-like")
    judged = table("docs/evidence/horse.md", "judge", "reference gaits")
    trot = table("docs/evidence/horse.md", "Froude number", "slip, fore and hind [m]")["3.61"]
    of_judges = {
        "lag [strides]": "walk: lag",
        "duty factor, fore": "walk: duty_fore",
        "duty factor, hind": "walk: duty_hind",
        "stances with two peaks": "walk: two_peaked",
        "stance peak, fore [N/kg]": "walk: peak_fore",
        "stance peak, hind [N/kg]": "walk: peak_hind",
        "stride over hip height, Froude 0.5": "stride_over_hip",
    }
    for name, judge in of_judges.items():
        cell = judged[judge]["reference gaits"]
        assert not differs(shown[name]["slow gait"], numbers(cell)[:1]), name
        for verdict in ("met", "missed"):
            assert (verdict in shown[name]["slow gait"]) == (verdict in cell), name
    peaks = numbers(trot["stance peak, fore and hind [N/kg]"])
    duties = numbers(trot["duty factor, fore and hind"])
    for k, leg in enumerate(("fore", "hind")):
        assert not differs(shown[f"stance peak, {leg} [N/kg]"]["trot-like"], peaks[k : k + 1])
        assert not differs(shown[f"duty factor, {leg}"]["trot-like"], duties[k : k + 1])


def test_a_cell_that_differs_is_found():
    assert not differs("0.56, 0.53", (0.564, 0.532))
    assert differs("0.56, 0.53", (0.564, 0.537))
    assert differs("176 to 183", (175.2, 183.2))


if __name__ == "__main__":
    for page in sys.argv[1:] or PAGES:
        print(f"{page}: {len(unmarked(page))}", *unmarked(page), sep="\n    ")

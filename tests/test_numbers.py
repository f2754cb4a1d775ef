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
from statistics import median
from typing import Any

import gymnasium as gym
import pytest

from agents.results import read_row
from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.evaluation.statistics import iqm
from hoof_env.gait import WIDEST, FilterSettings
from hoof_env.ground.laws import FACTORS, restitution_of_factor
from hoof_env.paper.rows import EXACT, OURS, PRINTED, PROBABLE, UNDETERMINED
from hoof_env.tasks.horse import MASS
from hoof_env.tasks.horse_terms import HORSE_TERMS
from hoof_env.tasks.reward import BEARING, MAX_STRIDE, check_weights

ROOT = Path(__file__).parents[1]
PAGES = (
    "README.md",
    *(
        f"docs/{name}.md"
        for name in ("index", "agents", "engine", "help", "horse", "jax", "own_task", "paper")
    ),
    *(f"docs/{name}.md" for name in ("project", "start", "task", "view", "elasticity", "parameters")),
    *(f"docs/environments/{path.name}" for path in sorted((ROOT / "docs/environments").glob("*.md"))),
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


def row(name: str, kind: str, figure: str) -> float:
    """A mean figure of a row of results, or the median, lowest or highest return of its training runs."""
    found = read_row(ROOT / f"results/{name}-{kind}.json")
    spread = dict(zip(("median", "lowest", "highest"), found.spread or (), strict=False))
    return spread[figure] if figure in spread else found.mean[figure]


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


def inside_jax(part: str, which: str, figure: str) -> float:
    """A figure of the evidence of what runs inside JAX: of the vector steps with some rows, or of the last
    scores of the learner that is the first, second or third of its part."""
    result = json.loads((ROOT / f"docs/evidence/jax/{part}.json").read_text(encoding="utf-8"))["result"]
    if part == "speed":
        found = next(row for row in result["rows"] if row["rows"] == int(which))
        loop, program, kernel = (found[name] for name in ("Python loop", "`envs.xla()`", "kernel alone"))
        return {
            "gain": loop[0] - program[0],
            "share": 100.0 * kernel[0] / loop[0],
            "most": loop[0] / kernel[0],
            "times": loop[0] / program[0],
            "wall": loop[1] / program[1],
        }[figure]
    runs = list(result["curves"].values())[int(which)]
    last = [run[-1] for run in runs]
    ends = {"lowest": min, "highest": max, "median": median}
    if figure in ends:
        return ends[figure](score["return"] for score in last)
    return median(score[figure] for score in last)


def leg(figure: str) -> float:
    """A figure of the environment with the defaults."""
    env = HorseLegEnv()
    env.reset(seed=0)
    if figure == "hip_height":
        return env.body.height
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
        value = 100 * value if key == "percent" else value[int(key) if isinstance(value, tuple) else key]
    return abs(value)


def limit(name: str, end: str) -> float:
    """The lowest (0) or highest (1) command of a gait parameter that any gait takes."""
    return WIDEST[name][int(end)]


def filter_bound(name: str) -> float:
    """A bound of the filters of one leg's commands."""
    return getattr(FilterSettings(), name)


def setting(name: str, key: str) -> float:
    """The default of a setting of an id."""
    return getattr(gym.make(f"hoof_env/{name}-v0").unwrapped.settings, key)


def allowance() -> float:
    """The largest bearing allowance [s]."""
    return BEARING * MAX_STRIDE


def measured_count(name: str) -> float:
    """How many numbers infos measure in an id."""
    return len(gym.make(f"hoof_env/{name}-v0").reset(seed=0)[1]["measured"])


@cache
def measured(file: str) -> dict[str, Any]:
    """A file of figures in docs/evidence."""
    return json.loads((ROOT / "docs/evidence" / file).read_text(encoding="utf-8"))


def suspension(policy: str, figure: str, factor: str = "1", of: str = "mean") -> float:
    """A figure of the suspension or the hoof of one leg, times a factor: its mean over episodes, or the least
    or the most of all."""
    return float(factor) * measured("leg_forces.json")["policies"][policy][figure][of]


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


def entries_of(kind: str) -> list[dict[str, Any]]:
    """The entries of a kind in the committed reproduction."""
    entries = json.loads((ROOT / "docs/paper/reproduction.json").read_text(encoding="utf-8"))
    return [entry for entry in entries if entry["kind"] == kind]


def reproduced(solver: str, count: str) -> float:
    """How many rows of the committed reproduction have a verdict with a solver, are within their bar, or are
    not determinable."""
    names = {"exact": EXACT, "printed": PRINTED, "probable": PROBABLE}
    rows = [row for row in entries_of("row") if row["solver"] == names[solver]]
    return {
        "rows": sum(not row["spared"] for row in rows),
        "within": sum(bool(row["within_bar"]) for row in rows),
        "lost": sum(row["spared"] == UNDETERMINED for row in rows),
    }[count]


def printed_row(name: str, solver: str, figure: str) -> float:
    """A figure of a row of the committed reproduction: "simulated", "published", the size of its "error", or
    another reading by its name."""
    names = {"exact": EXACT, "printed": PRINTED, "probable": PROBABLE}
    (found,) = (e for e in entries_of("row") if (e["id"], e["solver"]) == (name, names[solver]))
    value = found[figure] if figure in found else found["beside"][figure]
    return abs(value) if figure == "error" else value


def level(name: str, figure: str) -> float:
    """What a row of the committed reproduction is where the ground is so many micrometres higher; or by how
    many bars it moves at most: "moved"; of all determinable rows together by the name "rest"."""
    entries = {entry["id"]: entry for entry in entries_of("level")}
    if name == "rest":
        return max(entry[figure] for entry in entries.values() if entry["determinable"])
    entry = entries[name]
    if figure == "moved":
        return entry["moved"]
    return entry["simulated"][entry["shifts_um"].index(int(figure))]


def detail(name: str) -> float:
    """A figure of a gait in the committed reproduction that the paper does not print."""
    (found,) = (entry for entry in entries_of("detail") if entry["id"] == name)
    return found["value"]


def returned(law: str, cr: str) -> float:
    """The restitution of a free impact under a contact law."""
    return restitution_of_factor(FACTORS[law](float(cr)))


def claims(count: str) -> float:
    """How many claims of the paper there are, hold as printed, or hold with a turned sign, converged."""
    shapes = [entry for entry in entries_of("shape") if entry["solver"] == EXACT]
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
    "row": row,
    "stock": stock,
    "speed": speed,
    "engine_speed": engine_speed,
    "leg": leg,
    "inside_jax": inside_jax,
    "horse": horse,
    "constant": constant,
    "limit": limit,
    "filter": filter_bound,
    "setting": setting,
    "allowance": allowance,
    "measured": measured_count,
    "suspension": suspension,
    "fastest_gait": fastest_gait,
    "gain": gain,
    "evidence": evidence,
    "reproduced": reproduced,
    "printed_row": printed_row,
    "level": level,
    "detail": detail,
    "returned": returned,
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
def test_a_result_agrees_with_its_source(page, number, source):
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


def test_seconds_to_learn_agree_with_the_benchmark():
    page = "benchmarks/results/512-bits/learn_seconds.md"
    row = table(page, "seconds to the best constant gait")["ppo_flat"]
    best = numbers(row["seconds to the best constant gait"])
    near = numbers(row["seconds to within 5 %"])
    text = (ROOT / "docs/agents.md").read_text(encoding="utf-8")
    said = f"after {best[0]:g} seconds of learning (median of ten seeds, {best[2]:g} in the worst)"
    assert said in text
    assert f"within 5 % of its final return after {near[0]:g}" in text


def test_speeds_inside_jax_are_those_of_the_evidence():
    titles = (
        "rows",
        "Python loop",
        "`envs.xla()`",
        "`io_callback`",
        "kernel alone",
        "loop / xla",
        "by wall clock",
    )
    assert table("docs/jax.md", *titles) == table("docs/evidence/jax.md", *titles)


def test_reference_gaits_on_the_page_agree_with_the_evidence():
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


def test_the_suspension_on_the_page_agrees_with_the_figures():
    shown = table("docs/task.md", "pulls down")
    figures = {
        "mean": ("force_mean", 1),
        "rms": ("force_rms", 1),
        "lowest": ("force_lowest", 1),
        "highest": ("force_highest", 1),
        "pulls down": ("pulling_time", 100),
        "mean while pulling down": ("pulling_force", 1),
        "heat of the damper [kJ]": ("damper_heat_j", 1e-3),
        "work of the drives [kJ]": ("drive_work_j", 1e-3),
        "greatest depth of the hoof [m]": ("depth_m", 1),
    }
    policies = {
        "scripted run": "run",
        "best constant gait": "constant",
        "best gait locked to the crank": "open-loop",
        "shipped agent": "shipped",
    }
    assert list(shown) == list(policies)
    for name, policy in policies.items():
        for title, (figure, factor) in figures.items():
            value = suspension(policy, figure, str(factor))
            assert not differs(shown[name][title], [value]), (name, title)


POLICIES = {"zero action": "zero action", "shipped agent": "agent", "trot-like": "trot-like"}
"""Names of policies of the horse in its figures, by those on the page."""


def test_the_gain_of_the_horse_by_term_agrees_with_the_figures():
    shown = table("docs/horse.md", "term", "gain")
    found = measured("horse/figures.json")["gain"]
    named = set()
    for name, row in shown.items():
        for term in ["return"] if name == "all" else [f"reward_{x}" for x in re.findall(r"\w+", name)]:
            named.add(term)
            assert not differs(row["gain"], [found[term]["mean"]]), term
            if "low" in found[term]:
                assert not differs(row["95 % interval"], [found[term]["low"], found[term]["high"]]), term
    assert named == set(found)


def test_the_horse_by_speed_agrees_with_the_figures():
    text = (ROOT / "docs/horse.md").read_text(encoding="utf-8")
    titles = {
        "return": ("return", 1),
        "speed reached [m/s]": ("speed_m_s", 1),
        "loading rate [kN/s]": ("loading_rate_n_s", 1e-3),
        "stance peak [kN]": ("stance_peak_n", 1e-3),
        "slip a stance [m]": ("slip_m", 1),
        "cost of transport": ("cost_of_transport", 1),
    }
    head, _, *lines = re.search(r"^\| commanded.*\n(?:\|.*\n)+", text, re.MULTILINE)[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in (head, *lines)]
    rows = iter(dict(zip(cells[0], row, strict=True)) for row in cells[1:])
    for of_speed in measured("horse/figures.json")["speeds"]:
        for name, figures in of_speed["policies"].items():
            row = next(rows)
            assert float(row["commanded [m/s]"]) == of_speed["speed_m_s"]
            assert POLICIES[row["policy"].strip("`")] == name
            assert figures["failed"]["mean"] == 0.0  # as the page says of all
            for title, (figure, factor) in titles.items():
                assert not differs(row[title], [factor * figures[figure]["mean"]]), (row, title)
            nets = [figures[f"net_{pair}"]["mean"] for pair in ("fore", "hind")]
            assert not differs(row["net force, fore and hind [N/kg]"], nets), row
    assert not list(rows)


def test_braking_legs_on_the_page_agree_with_the_figures():
    """Signs, too: the page says where roles are reversed, and where the agent loads faster."""
    title = "net horizontal force of the pair, fore and hind [N/kg]"
    shown = table("docs/horse.md", title)
    found = measured("horse/figures.json")
    for of_froude in found["forces"]:
        for row in shown.values():
            name = POLICIES.get(row[title].partition(":")[0])
            if name:
                nets = [of_froude["policies"][name][f"net_{pair}"]["mean"] for pair in ("fore", "hind")]
                assert not differs(row[f"Fr {of_froude['froude']:g}"], nets), (row, of_froude["froude"])
    speeds = found["speeds"]
    zero, agent = ([row["policies"][name] for row in speeds] for name in ("zero action", "agent"))
    assert [row["net_fore"]["mean"] > 0 for row in zero] == [True, True, True, False, True]
    assert all(row["policies"]["zero action"]["net_fore"]["mean"] > 0.4 for row in found["forces"])
    for figure, more in (("loading_rate_n_s", 4), ("stance_peak_n", 2)):
        pairs = zip(agent, zero, strict=True)
        assert sum(ours[figure]["mean"] > theirs[figure]["mean"] for ours, theirs in pairs) == more
    compared = table("docs/horse.md", "slow gait", "trot-like")
    slow, trot = found["forces"][1]["policies"]["zero action"], found["speeds"][-1]["policies"]["trot-like"]
    for pair in ("fore", "hind"):
        row = compared[f"net horizontal force, {pair} [N/kg]"]
        for column, figures in (("slow gait", slow), ("trot-like", trot)):
            assert not differs(row[column], [figures[f"net_{pair}"]["mean"]]), (pair, column)


def test_a_cell_that_differs_is_found():
    assert not differs("0.56, 0.53", (0.564, 0.532))
    assert differs("0.56, 0.53", (0.564, 0.537))
    assert differs("176 to 183", (175.2, 183.2))


if __name__ == "__main__":
    for page in sys.argv[1:] or PAGES:
        print(f"{page}: {len(unmarked(page))}", *unmarked(page), sep="\n    ")

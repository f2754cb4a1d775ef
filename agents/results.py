"""Rows of the tables of results: one file each, which a replay must confirm before it counts.

    python -m agents.results replay                      plays all rows again; or results/NAME.json ...
    python -m agents.results add results/mine.json       replays a row and takes it into results/
    python -m agents.results pages                       writes the tables of pages and package from the rows
    python -m agents.results score zero                  plays a policy of HorseLeg-v0 and writes its row

A row says which policy was played on which id, in which episodes, what came out, and which command, commit
and versions made it. Its policy is a name (`hoof-env list --env-id ID`) or a folder or file of this
repository, and the digest of its numbers is in the row. A row of a policy without feedback must pass
`agents.blindness`. Stock learners keep no policy: their rows are read off learning curves, and again when
they are replayed.

A page shows rows between two comments, `<!-- results: HorseLeg-v0 return speed_m_s -->` and
`<!-- end of results -->`; `pages` rewrites what is between them.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.blindness import prove
from agents.cards import POLICIES
from agents.command import parse, run
from agents.ship import GAITS, shown_command, write_index
from hoof_env._output import markdown_table
from hoof_env.envs.open_loop import check_blind, gait_file, open_loop_record
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError, check_choice, parse_json
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.evaluation.scores import METRICS
from hoof_env.evaluation.statistics import estimate, iqm
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.policies.find import find_policy, is_model, names_of, read_policy_record
from hoof_env.policies.record import environment_of
from hoof_env.policies.saved import ABOUT, FILE, WEIGHTS
from hoof_env.tasks.registry import TASKS

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results"
CURVES = ROOT / "docs" / "evidence" / "stock" / "curves.csv"

KINDS = {
    "zero": "zero action",
    "run": "scripted gait",
    "constant": "best constant gait",
    "open-loop": "best gait locked to the crank",
    "blind": "blind agents",
    "stock": "stock PPO",
    "shipped": "shipped agent",
}
"""Kinds of rows, from the policy that does least to the one that sees most, with their titles."""

WITHOUT_FEEDBACK = ("zero", "run", "constant", "open-loop", "blind")
"""Kinds whose policies see nothing of the ground."""

COLUMNS: dict[str, tuple[str, int, float]] = {
    "return": ("return", 1, 1.0),
    "speed_m_s": ("speed m/s", 2, 1.0),
    "stance_peak_n": ("stance peak kN", 2, 1e-3),
    "loading_rate_n_s": ("loading rate kN/s", 0, 1e-3),
    "slip_m": ("slip of a stance m", 2, 1.0),
    "cost_of_transport": ("cost of transport, mechanical", 2, 1.0),
    "weight_share": ("weight share", 2, 1.0),
    "failed": ("falls", 2, 1.0),
    "success": ("success", 2, 1.0),
}
"""Columns of the tables by the figure of an episode: title, digits, factor."""

MARKED = re.compile(r"(<!-- results: ([\w.-]+)((?: [\w.-]+)*) -->\n).*?(<!-- end of results -->)", re.DOTALL)


@dataclass(frozen=True)
class Row:
    """One row.

    Attributes:
        env_id: id of the environment.
        kind: one of `KINDS`.
        policy: name or path of the policy; "" of a row from curves.
        digest: SHA-256 of the policy's numbers, "" of a policy without numbers, such as the zero action.
        seeds: first seed of the episodes, and the one after the last.
        mean: mean figures of the episodes.
        interval95: bounds of the bootstrap's 95 % interval over the episodes, None for equal episodes.
        runs: mean returns of all training runs of this kind by seed, of which `policy` is the best; empty for
            a policy that was not trained.
        effort: what it took: "steps" of a training run, "episodes" of a search, and "runs", the number of
            training runs of which it is the best, where `runs` lacks their returns.
        command: command that made the policy.
        commit: commit at which it was scored.
        versions: versions of the packages.
        note: what a reader must know.
    """

    env_id: str
    kind: str
    policy: str
    digest: str
    seeds: tuple[int, int]
    mean: dict[str, float]
    interval95: dict[str, tuple[float, float] | None]
    runs: dict[str, float] = field(default_factory=dict)
    effort: dict[str, int] = field(default_factory=dict)
    command: str = ""
    commit: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    note: str = ""

    @property
    def name(self) -> str:
        """Name of the file, without its suffix."""
        return f"{self.env_id.rpartition('/')[2]}-{self.kind}"

    @property
    def spread(self) -> tuple[float, float, float] | None:
        """Median, lowest and highest return of the training runs; None without several."""
        values = list(self.runs.values())
        return (float(np.median(values)), min(values), max(values)) if len(values) > 1 else None

    def write(self, folder: Path = RESULTS) -> Path:
        """Write the file of the row."""
        path = folder / f"{self.name}.json"
        folder.mkdir(parents=True, exist_ok=True)
        runs.write_text(path, json.dumps(asdict(self), indent=1, allow_nan=False) + "\n")
        return path


def read_row(path: Path) -> Row:
    """Read a row.

    Raises:
        DataFileError: the file is not a row; it says which entry is wrong.
    """
    try:
        data = parse_json(path.read_text(encoding="utf-8"))
        if not isinstance(data, dict):
            raise TypeError("not an object")
        row = Row(**data | {"seeds": tuple(data["seeds"])})
        _check_entries(row)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, OverflowError, HoofEnvError) as error:
        raise DataFileError(f"row {path}: expected one as agents.results writes it: {error!r}") from None
    return row


def _check_entries(row: Row) -> None:
    """Raise an error that names the entry of a row which is not as `Row` says. A row causes no import: its id
    is one of this package."""
    texts = (row.env_id, row.policy, row.digest, row.command, row.commit, row.note)
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("env_id, policy, digest, command, commit and note must be strings")
    check_choice("env_id", row.env_id, [task.id for task in TASKS.values()])
    check_choice("kind", row.kind, KINDS)
    first, stop = row.seeds
    if not (type(first) is type(stop) is int and 0 <= first < stop):
        raise ValueError(f"seeds {row.seeds}")
    if not _are_numbers([row.mean["return"], *row.mean.values(), *row.runs.values()]):
        raise ValueError(f"returns {row.mean['return']}, mean {row.mean}, runs {row.runs}")
    if not all(bounds is None or _are_numbers(bounds, 2) for bounds in row.interval95.values()):
        raise ValueError(f"interval95 {row.interval95}")
    if not (row.effort.keys() <= {"steps", "episodes", "runs"} and _are_numbers(row.effort.values())):
        raise ValueError(f"effort {row.effort}")
    if not all(isinstance(version, str) for version in row.versions.values()):
        raise TypeError(f"versions {row.versions}")


def _are_numbers(values: Iterable[Any], count: int | None = None) -> bool:
    """True if values are finite numbers, and so many."""
    found = list(values)
    return count in (None, len(found)) and all(
        type(value) in (int, float) and math.isfinite(value) for value in found
    )


def rows_of(env_id: str, folder: Path = RESULTS) -> dict[str, Row]:
    """Return the rows of an id by kind, in the order of `KINDS`."""
    name = env_id.rpartition("/")[2]
    files = {kind: folder / f"{name}-{kind}.json" for kind in KINDS}
    rows = {kind: read_row(file) for kind, file in files.items() if file.is_file()}
    for kind, row in rows.items():
        if (row.env_id, row.kind) != (env_id, kind):
            raise DataFileError(f"row {files[kind]}: expected {env_id}, {kind}; got {row.env_id}, {row.kind}")
    return rows


def best_blind(rows: dict[str, Row]) -> Row | None:
    """Return the row of the best policy that sees nothing; None without one."""
    blind = [rows[kind] for kind in WITHOUT_FEEDBACK if kind in rows]
    return max(blind, key=lambda row: row.mean["return"], default=None)


# -- policies and their digests ----------------------------------------------------------------


def check_policy(kind: str, policy: str, env_id: str) -> None:
    """Raise `DataFileError` unless a row may have a policy, which runs no code of a file and imports nothing:
    a name of the id's, a gait, or a folder with plain data alone."""
    with runs.make_env(env_id) as env:
        names = [kind] if kind in ("zero", "shipped") else names_of(env, env_id)
    place = ROOT / policy
    is_plain = (place / ABOUT).is_file() and (place / WEIGHTS).is_file() and not (place / FILE).exists()
    is_file = kind not in ("zero", "run", "shipped") and ".." not in Path(policy).parts
    if policy not in names and not (is_file and (is_plain or (policy.endswith(".json") and place.is_file()))):
        raise DataFileError(
            f"policy {policy!r} of a row {kind!r}: expected a name ({', '.join(names)}), for one that was"
            f" found or trained also a gait's .json or a folder with {ABOUT} and {WEIGHTS} and no {FILE}"
        )


def check_published(row: Row) -> None:
    """Raise `DataFileError` unless a row has the episodes of the tables and a policy of this repository."""
    if row.kind != "stock" and row.seeds != _FINAL:
        raise DataFileError(f"row {row.name}: expected the episodes of the tables, {_FINAL}, got {row.seeds}")
    if Path(row.policy).is_absolute():
        raise DataFileError(f"row {row.name}: expected a policy within the repository, got {row.policy}")


def digest_of(policy: str, env_id: str) -> str:
    """Return the SHA-256 of a policy's numbers; "" for a name without numbers.

    Raises:
        DataFileError: there is no such file.
    """
    name = env_id.rpartition("/")[2]
    if policy in ("open-loop", "constant") or policy.endswith(".json"):
        family = None if policy == "open-loop" else policy
        path = ROOT / policy if policy.endswith(".json") else gait_file(env_id, family)
        return _sha(json.dumps(open_loop_record(path)["parameters"], sort_keys=True).encode())
    if policy == "shipped":
        return _of_plain(SHIPPED / name)
    if is_model(policy):
        try:
            return _of_plain(ROOT / policy)
        except OSError as error:
            raise DataFileError(
                f"policy {policy}: expected a folder with policy.safetensors: {error}"
            ) from None
    return ""


def _of_plain(folder: Path) -> str:
    """Return the digest of a policy of plain data: its weights, and what normalises and bounds them."""
    return _sha(b"".join((folder / name).read_bytes() for name in (WEIGHTS, ABOUT)))


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def place_of(policy: str) -> str:
    """Return a policy as `load_policy` takes it: a path of this repository becomes one of this machine."""
    return str(ROOT / policy) if "/" in policy and (ROOT / policy).exists() else policy


def arguments_of(policy: str, env_id: str) -> dict[str, Any]:
    """Return the arguments of the environment in which a policy of a folder plays: what it observes."""
    if policy == "shipped" or not is_model(policy):
        return {}
    _, arguments = environment_of(policy, read_policy_record(place_of(policy)), env_id)
    if others := arguments.keys() - {"observation"}:
        raise DataFileError(
            f"policy {policy}: expected the environment of {env_id}, of which a row's policy may choose its"
            f" observation alone; its record has {', '.join(sorted(others))}"
        )
    return arguments


def played(policy: str, env_id: str, seeds: range) -> list[dict[str, float]]:
    """Play a row's policy in its episodes."""
    return score_vector(place_of(policy), env_id, seeds, **arguments_of(policy, env_id))


# -- making and replaying ----------------------------------------------------------------------


STORED = tuple(dict.fromkeys((*COLUMNS, *METRICS)))
"""Figures that a row has the means of."""


def figures(episodes: Sequence[dict[str, float]]) -> tuple[dict[str, float], dict[str, Any]]:
    """Return means and intervals of the finite figures of episodes."""
    mean: dict[str, float] = {}
    interval: dict[str, Any] = {}
    for key in STORED:
        values = [episode[key] for episode in episodes if key in episode]
        if len(values) == len(episodes) and all(map(math.isfinite, values)):
            mean[key] = float(np.mean(values))
            bounds = estimate(values) if np.ptp(values) > 1e-9 else None
            interval[key] = [bounds.low, bounds.high] if bounds else None
    return mean, interval


_FINAL = (FINAL_SEEDS.start, FINAL_SEEDS.stop)


def make_row(
    env_id: str,
    kind: str,
    policy: str | None = None,
    training: dict[str, float] | None = None,
    effort: dict[str, int] | None = None,
    command: str = "",
    note: str = "",
) -> Row:
    """Play a policy in the published episodes and return its row.

    Raises:
        DataFileError: the kind sees nothing, but the policy does.
    """
    check_choice("kind", kind, KINDS)
    if kind == "stock":
        return stock_row(env_id)
    policy = policy or kind
    check_policy(kind, policy, env_id)
    episodes = played(policy, env_id, FINAL_SEEDS)
    mean, interval = figures(episodes)
    versions = runs.versions()
    versions.pop("commit", None)
    row = Row(
        env_id, kind, policy, digest_of(policy, env_id), _FINAL, mean, interval,
        training or {}, effort or {}, command, commit_of_code(), versions, note,
    )  # fmt: skip
    if row.runs and not any(abs(value - mean["return"]) < 0.1 for value in row.runs.values()):
        row.runs[kind] = mean["return"]  # a run of another time, which is one more
    check_blindness(row)
    return row


def commit_of_code() -> str:
    """Return the commit whose code runs, with "-dirty" where a Python file differs from it; "" without git.
    Rows and pages that were written a moment ago do not count."""
    git = ["git", "-C", str(ROOT)]
    with suppress(OSError, subprocess.SubprocessError):
        head = subprocess.run(
            [*git, "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True, check=True, timeout=10
        )
        same = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "*.py"], timeout=10).returncode == 0
        return head.stdout.strip() + ("" if same else "-dirty")
    return ""


def returns_of_runs(place: Path, env_id: str) -> dict[str, float]:
    """Return the mean returns of training runs in the published episodes by seed.

    Args:
        place: folder of run folders, which play them, or table in which they are.
        env_id: id of the environment.

    Raises:
        DataFileError: there is none.
    """
    if place.is_file():
        with place.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if ", seed " in (row.get("policy") or "")]
        found = {row["policy"].rpartition(" ")[2]: float(row["return"]) for row in rows}
    else:
        found = {}
    for folder in sorted(record.parent for record in place.rglob(runs.RECORD)):
        record = runs.read_record(folder)
        episodes = score_vector(str(folder), env_id, FINAL_SEEDS, **record.get("env_kwargs", {}))
        found[str(record["seed"])] = float(np.mean([episode["return"] for episode in episodes]))
    if not found:
        raise DataFileError(
            f"runs {place}: expected folders of training runs, or a table of them, found none"
        )
    return found


def stock_row(env_id: str) -> Row:
    """Return the row of stock PPO, read off the learning curves: the interquartile mean over seeds of the
    last return, and the last return of each seed.

    Raises:
        DataFileError: the id has no curves.
    """
    with CURVES.open(newline="", encoding="utf-8") as file:
        curves = [row for row in csv.DictReader(file) if (row["env_id"], row["algo"]) == (env_id, "ppo")]
    if not curves:
        raise DataFileError(f"curves {CURVES.name}: expected some of PPO on {env_id}, got none")
    steps = max(int(row["steps"]) for row in curves)
    last = {row["seed"]: float(row["return"]) for row in curves if int(row["steps"]) == steps}
    commits = sorted({row["commit"] for row in curves})
    return Row(
        env_id, "stock", "", _sha(CURVES.read_bytes()), _FINAL,
        {"return": float(iqm(list(last.values()))[0])}, {"return": None}, last, {"steps": steps},
        f"python -m agents.experiments --plan stock --only ppo-{env_id.rpartition('/')[2]}",
        ", ".join(commits), {},
        "interquartile mean over seeds of the last return on the learning curves; no policy is kept",
    )  # fmt: skip


def check_blindness(row: Row) -> None:
    """Replay the actions of other ground if the row's policy claims to see nothing; `DataFileError` if it
    sees something."""
    if row.kind not in WITHOUT_FEEDBACK or not row.policy:
        return
    arguments = arguments_of(row.policy, row.env_id)
    with runs.make_env(row.env_id, **arguments) as env:
        if is_model(row.policy) and row.policy != "shipped":
            # What it observes, for a replay may miss what is seen seldom
            check_blind(env.unwrapped.settings)  # type: ignore[attr-defined]
        policy = find_policy(place_of(row.policy), env, row.env_id)
    prove(policy, row.env_id, range(FINAL_SEEDS.start, FINAL_SEEDS.start + 20), arguments)


def check_replay(row: Row) -> str:
    """Play the episodes of a row again; return how the return compares.

    Raises:
        DataFileError: policy or figures are not the row's.
    """
    if row.kind == "stock":
        again = stock_row(row.env_id)
        if row.digest != again.digest or row.mean != again.mean or row.runs != again.runs:
            raise DataFileError(f"row {row.name}: expected the curves of {CURVES.name}, got other returns")
        return f"{again.mean['return']:.2f}, read off the curves"
    check_policy(row.kind, row.policy, row.env_id)
    if row.digest != digest_of(row.policy, row.env_id):
        raise DataFileError(
            f"row {row.name}: the policy {row.policy!r} has other numbers than when it was scored; score it"
            " again"
        )
    mean, interval = figures(played(row.policy, row.env_id, range(*row.seeds)))
    for key, value in row.mean.items():
        bounds = interval.get(key)
        # The last bits of an action differ between processors, and chaos makes more of them; the interval
        # comes from the replay, for a row must not choose how well it has to agree
        room = (bounds[1] - bounds[0]) / 2 if bounds else 0.005 * abs(value) + 1e-9
        recorded: list[float] = [value, *(row.interval95.get(key) or [value] * 2)]
        replayed: list[float] = [mean[key], *(bounds or [mean[key]] * 2)] if key in mean else [math.nan] * 3
        if not max(abs(one - other) for one, other in zip(recorded, replayed, strict=True)) <= room:
            raise DataFileError(
                f"row {row.name}: expected {key} {value:.6g} within {room:.2g}, replayed {mean.get(key)};"
                f" interval {row.interval95.get(key)}, replayed {bounds}"
            )
    if row.runs and abs(max(row.runs.values()) - row.mean["return"]) > 0.05 * abs(row.mean["return"]):
        raise DataFileError(f"row {row.name}: the best of its runs is not the policy that it names")
    check_blindness(row)
    return f"{mean['return']:.2f}, recorded {row.mean['return']:.2f}"


# -- tables ------------------------------------------------------------------------------------


def cell(row: Row, key: str) -> str:
    """Return the cell of a figure, with the interval over episodes for the return."""
    if key not in row.mean:
        return ""
    _, digits, factor = COLUMNS[key]
    text = f"{factor * row.mean[key]:.{digits}f}"
    bounds = row.interval95.get(key)
    return f"{text} [{bounds[0]:.{digits}f}, {bounds[1]:.{digits}f}]" if key == "return" and bounds else text


def runs_cell(row: Row) -> str:
    """Return the cell of the training runs: median and range of their returns."""
    if row.spread is None:
        among = row.effort.get("runs", 1)
        several = f"best of {among}; the rest was not kept" if among > 1 else "one run"
        return several if row.kind in ("blind", "shipped", "stock") else ""
    median, low, high = row.spread
    return f"median {median:.1f} of {len(row.runs)} ({low:.1f} to {high:.1f})"


def effort_cell(row: Row) -> str:
    """Return the cell of steps or episodes."""
    return ", ".join(f"{count:,} {unit}" for unit, count in row.effort.items() if unit != "runs")


def table(env_id: str, columns: Sequence[str], folder: Path = RESULTS) -> str:
    """Return the table of an id: a row for each kind, the best without feedback in bold."""
    rows = rows_of(env_id, folder)
    best = best_blind(rows)
    lines = []
    for kind, row in rows.items():
        is_best = row.spread and row.mean["return"] > row.spread[2] - 0.1  # a table of runs has one decimal
        title = KINDS[kind] + (", best run" if is_best and kind in ("blind", "shipped") else "")
        title += f" (`{row.policy}`)" if kind == "run" else ""
        title = f"**{title}: best without feedback**" if row is best else title
        lines.append([title, effort_cell(row), *(cell(row, key) for key in columns), runs_cell(row)])
    titles = [COLUMNS[key][0] for key in columns]
    return markdown_table(["policy", "effort", *titles, "returns of all runs"], lines)


def overview(folder: Path = RESULTS) -> str:
    """Return the table of all ids: returns by kind."""
    names = sorted({path.stem.rpartition("-v0-")[0] for path in folder.glob("*-v0-*.json")})
    head = ["id", *(KINDS[kind] for kind in ("zero", "run", "constant")), "**best without feedback**"]
    head += [KINDS["stock"], "shipped agent", "all its runs"]
    lines = []
    for name in names:
        rows = rows_of(f"hoof_env/{name}-v0", folder)
        best = best_blind(rows)
        found = [
            cell(rows[kind], "return").partition(" ")[0] if kind in rows else "" for kind in head_kinds()
        ]
        spread = runs_cell(rows["shipped"]) if "shipped" in rows else ""
        bold = f"**{best.mean['return']:.1f}** ({title_of(best)})" if best else ""
        lines.append([f"`{name}-v0`", *found[:3], bold, *found[3:], spread])
    return markdown_table(head, lines)


def title_of(row: Row) -> str:
    """Return the name of a row's policy; a gait of an id with a motor has a clock in place of the crank."""
    task = next((task for task in TASKS.values() if task.id == row.env_id), None)
    has_clock = row.kind == "open-loop" and task is not None and task.settings({}).drive == "motor"
    return "best gait with a clock" if has_clock else KINDS[row.kind]


def head_kinds() -> tuple[str, ...]:
    """Kinds that have a column of their own in the overview."""
    return "zero", "run", "constant", "stock", "shipped"


def filled(text: str, folder: Path = RESULTS) -> str:
    """Return the text of a page with its tables written anew."""

    def again(found: re.Match[str]) -> str:
        opening, name, columns, closing = found.groups()
        keys = columns.split()
        unknown = [key for key in keys if key not in COLUMNS]
        if unknown:
            raise DataFileError(
                f"results: expected columns of {', '.join(COLUMNS)}, got {', '.join(unknown)}"
            )
        made = overview(folder) if name == "all" else table(f"hoof_env/{name}", keys, folder)
        return f"{opening}\n{made}\n\n{closing}"

    return MARKED.sub(again, text)


def pages() -> list[Path]:
    """Return the pages with tables of results."""
    places = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "agents").rglob("*.md")]
    return [path for path in places if "<!-- results: " in path.read_text(encoding="utf-8")]


# -- scores of the package ---------------------------------------------------------------------


def scores_of(env_id: str, data: dict[str, Any], folder: Path = RESULTS) -> dict[str, Any]:
    """Return the content of an id's score.json with the policies that rows have: zero action, best constant
    gait, best gait locked to the crank, "blind", the best policy without feedback, and stock PPO. Gaits
    without a row stay as `agents.ship` scored them."""
    rows = rows_of(STANDS_FOR.get(env_id, env_id), folder)
    found: dict[str, Row] = {kind: rows[kind] for kind in ("zero", "constant", "open-loop") if kind in rows}
    kept = {name: value for name, value in data["policies"].items() if name not in KINDS or name in GAITS}
    if "reference" in kept:
        for same in (found, kept):
            same.pop("zero", None)
    if best := best_blind(rows):
        found["blind"] = best
    found |= {"stock": rows["stock"]} if "stock" in rows else {}
    policies = dict(kept)
    for name, row in found.items():
        mean = {key: row.mean[key] for key in METRICS if key in row.mean}
        bounds = {key: row.interval95.get(key) or (mean[key], mean[key]) for key in mean}
        policies[name] = {"mean": mean, "interval95": bounds}
    return data | {"policies": policies}


def score_files() -> dict[str, Path]:
    """Return the files of scores in the package by id."""
    return {f"hoof_env/{path.parent.name}": path for path in sorted(SHIPPED.glob("*/score.json"))}


# -- command -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Replay:
    """Play rows again and compare."""

    rows: Positional[tuple[Path, ...]] = ()
    """files of rows; otherwise all of results/"""


@dataclass(frozen=True)
class Add:
    """Replay rows, and take them into results/ if they hold."""

    rows: Positional[tuple[Path, ...]]
    """files of rows"""


@dataclass(frozen=True)
class Pages:
    """Write the tables of all pages."""


@dataclass(frozen=True)
class ScoreOne:
    """Play a policy and write its row."""

    kind: Positional[str]
    """kind of the row"""
    env_id: str = runs.DEFAULT_ENV
    """id of hoof_env"""
    policy: str | None = None
    """name, file or folder of the policy, relative to the repository; otherwise the kind"""
    runs: Path | None = None
    """all training runs of which the policy is the best: a folder with their folders, or a table of evidence
    with columns policy ("ppo_flat, seed 3") and return"""
    steps: int | None = None
    """environment steps of each training run"""
    among: int | None = None
    """number of training runs of which the policy is the best, where their returns are gone"""
    note: str = ""
    """what a reader must know"""


COMMANDS = {"replay": Replay, "add": Add, "pages": Pages, "score": ScoreOne}
"""Arguments by sub-command."""


def confirmed(files: Iterable[Path], are_new: bool) -> Iterable[Row]:
    """Replay files of rows and yield the rows; new ones must be fit for the tables."""
    for file in files:
        row = read_row(file)
        if are_new:
            check_published(row)
        print(f"{row.name}: {check_replay(row)}", flush=True)
        yield row


def main(argv: list[str] | None = None) -> None:
    """Run the command."""
    args: Any = parse(COMMANDS, argv, "python -m agents.results", __doc__)
    if isinstance(args, ScoreOne):
        env_id = args.env_id
        if not env_id.startswith("hoof_env/"):
            raise ParameterError(f"env_id: expected an id of hoof_env, as {runs.DEFAULT_ENV}, got {env_id!r}")
        effort = {"steps": args.steps} if args.steps else {}
        effort |= {"runs": args.among} if args.among else {}
        training = returns_of_runs(args.runs, env_id) if args.runs else {}
        command = shown_command(runs.command())
        row = make_row(env_id, args.kind, args.policy, training, effort, command, args.note)
        print(row.write().relative_to(ROOT))
    elif isinstance(args, Pages):
        for path in pages():
            runs.write_text(path, filled(path.read_text(encoding="utf-8")))
            print(path.relative_to(ROOT))
        for env_id, path in score_files().items():
            data = scores_of(env_id, parse_json(path.read_text(encoding="utf-8")))
            runs.write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")
            print(path.relative_to(ROOT))
        write_index(POLICIES, SHIPPED)
    else:
        files = args.rows or sorted(RESULTS.glob("*.json"))
        rows = list(confirmed(files, isinstance(args, Add)))
        for row in rows if isinstance(args, Add) else ():
            old = rows_of(row.env_id).get(row.kind)
            replaced = f", in place of one with {old.mean['return']:.2f}" if old else ""
            print(f"taken: {row.write()}{replaced}", file=sys.stderr)


if __name__ == "__main__":
    run(main)

"""What policies on the horse look like beside living horses.

    python -m agents.judge reference
    python -m agents.judge runs/ppo-Horse-v0-s0 runs/ppo-Horse-v0-s1 --out runs/judge

A policy is what agents.score takes. It is asked for one speed after the other, each kept for a whole episode;
the first two seconds do not count. `agents/judges.json` has the horse's figures, their sources and the bars;
nothing in it may enter a reward, a search or a choice of settings. A figure counts only where a hoof slips
less than 0.10 m a stance and lands 0.95 to 1.05 times a turn of its crank.

Of several policies, as the seeds of an algorithm, there is a table of all, too: means with 95 % intervals.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tyro.conf import Positional

from agents import runs
from agents.command import run
from agents.gait_figures import SECONDS, mean_lag, play, which_count
from agents.horse_gaits import speed_of
from agents.score import find_policy, make_rows
from agents.statistics import estimate
from hoof_env._output import markdown_table
from hoof_env.envs.horse import HIP_HEIGHT
from hoof_env.envs.reference import LEGS, PAIRS
from hoof_env.errors import ParameterError, check_number, count

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/Horse-v0"
TROT = 0.05  # largest lag of what counts as one
JUDGES = Path(__file__).with_name("judges.json")


@dataclass
class Args:
    """Arguments of the command."""

    policies: Positional[tuple[str, ...]]
    """what is judged"""
    froude: tuple[float, ...] = (0.1, 0.175, 0.25, 0.35, 0.5, 0.75, 1.0)
    """Froude numbers of the commanded speeds"""
    episodes: int = 32
    """of each speed"""
    env_kwargs: tuple[str, ...] = ()
    """arguments of the environment: key=value ..., or one JSON object"""
    out: Path = Path("runs/judge")
    """folder for figures.json, table.md, forces.png, footfall.png and speeds.png"""


# The judges


def verdicts(figures: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Rows of the table: what is judged, at which Froude number, the horse's figure, the bar, ours, whether
    it counts and is met, and the source."""
    judges = json.loads(JUDGES.read_text(encoding="utf-8"))
    rows: list[tuple[str, ...]] = []
    standing = [one for one in figures if "lag" in one]
    if not standing:
        return []

    def near(froude: float, some: list[dict[str, Any]]) -> dict[str, Any] | None:
        return min(some, key=lambda one: abs(one["froude"] - froude)) if some else None

    def judged(what: str, one: dict[str, Any] | None, name: str, judge: Any, bars: Any, pairs: Any) -> None:
        ours = None if one is None else one.get(name)
        counts = one is not None and all(one["counts"][pair] for pair in pairs)
        met = ours is not None and any(low <= ours <= high for low, high in bars)
        rows.append((
            what, "-" if one is None else f"{one['froude']:.2f}", str(judge["horse"]),
            " or ".join(f"{low:g} to {high:g}" for low, high in bars),
            "-" if ours is None else f"{ours:.3g}",
            "does not count" if not counts else "met" if met else "missed", judge.get("source", ""),
        ))  # fmt: skip

    walk = near(judges["walk"]["froude"], standing)
    for name in ("lag", "duty", "two_peaked", "peak_fore", "peak_hind"):
        judge = judges["walk"][name]
        pairs = (
            [name.partition("_")[2]]
            if name.startswith("peak")
            else ["fore"]
            if name == "two_peaked"
            else PAIRS
        )
        for pair in PAIRS if name == "duty" else [""]:
            own = f"duty_{pair}" if pair else name
            judged(f"walk: {own}", walk, own, judge, [judge["bar"]], [pair] if pair else pairs)
    trots = [one for one in standing if min(one["lag"], 0.5 - one["lag"]) < TROT]
    trot = near(1.0, trots)
    for pair in PAIRS:
        judge = judges["trot"][f"peak_{pair}"]
        judged(f"trot-like: peak_{pair} [N/kg]", trot, f"peak_{pair}", judge, [judge["bar"]], [pair])
    for froude, judge in judges["duty"].items():
        if froude == "source":
            continue
        one = near(float(froude), trots)
        one = one if one and abs(one["froude"] - float(froude)) < 0.1 else None
        bars = [(x - judge["bar"], x + judge["bar"]) for x in judge["horse"]]
        for pair in PAIRS:
            about = {**judge, "source": judges["duty"]["source"]}
            judged(f"trot-like at {froude}: duty_{pair}", one, f"duty_{pair}", about, bars, [pair])
    for name, judge in judges["reported"].items():
        one = near(judge["froude"], standing) if "froude" in judge else None
        ours = one.get(name) if one else min((trot["froude"] for trot in trots), default=None)
        off = "-" if ours is None else f"off by {ours / judge['horse'] - 1:+.0%}"
        rows.append((
            name, "-" if one is None else f"{one['froude']:.2f}", str(judge["horse"]), "none",
            "-" if ours is None else f"{ours:.3g}", off, judge["source"],
        ))  # fmt: skip
    return rows


HEAD = ("judge", "Froude number", "horse", "bar", "ours", "verdict", "source")
SHOWN = (
    "reached", "fell", "peak_fore", "peak_hind", "peak_over_mean_fore", "peak_over_mean_hind", "duty_fore",
    "duty_hind", "stances_per_turn_fore", "stances_per_turn_hind", "slip_fore", "slip_hind", "lag",
    "two_peaked", "braking_fore", "propulsion_fore", "braking_hind", "propulsion_hind", "stride_over_hip",
    "impulse_fore", "transport",
)  # fmt: skip


def of_all(each: list[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Figures of several policies at each speed as one: means, and under "intervals" their 95 % intervals as
    text. Policies that do not stand at a speed are left out there, but for "fell"."""
    found = []
    for same in zip(*each, strict=True):
        standing = [one for one in same if "lag" in one]
        one: dict[str, Any] = {name: same[0][name] for name in ("speed", "froude")}
        one["intervals"] = {}
        for name in SHOWN if standing else ("fell",):
            who = same if name == "fell" else standing
            values = [other[name] for other in who if np.isfinite(other[name])]
            if name == "lag":  # a trot may be just before 0 or just after
                middle = mean_lag(values)
                values = [middle + (x - middle + 0.25) % 0.5 - 0.25 for x in values]
            interval = estimate(values)
            one[name] = interval.mean % 0.5 if name == "lag" else interval.mean
            one["intervals"][name] = interval.text(3)
        if standing:
            one["counts"] = which_count(one)
        found.append(one)
    return found


def table_of(name: str, figures: list[dict[str, Any]]) -> str:
    """Verdicts and all figures of a policy, Markdown."""
    head = ("figure", *(f"Fr {one['froude']:.3g}, {one['speed']:.2f} m/s" for one in figures), "horse")
    reported = json.loads(JUDGES.read_text(encoding="utf-8"))["reported"]
    body = []
    for key in SHOWN:
        ours = (
            one.get("intervals", {}).get(key) or (f"{one[key]:.3g}" if key in one else "-") for one in figures
        )
        body.append((key, *ours, str(reported.get(key, {}).get("horse", ""))))
    verdict = markdown_table(HEAD, verdicts(figures))
    units = "Forces in N/kg, slip in m, lag in strides."
    return f"# {name}\n\n{verdict}\n\n{units}\n\n{markdown_table(head, body)}\n"


def shape_of(froude: float, pair: str) -> Floats | None:
    """Normal force of a horse over its stance [N/kg] in the form of Alexander & Jayes (1978, J. Zool.
    185:27), cos x - q cos 3x, scaled to the published peak: with two peaks (q = 0.4) at a walk, half a sine
    at a trot. None at other speeds."""
    judges = json.loads(JUDGES.read_text(encoding="utf-8"))
    for gait, q in (("walk", 0.4), ("trot", 0.0)):
        if abs(froude - {"walk": judges["walk"]["froude"], "trot": 1.0}[gait]) < 0.01:
            x = np.linspace(-0.5, 0.5, 101) * np.pi
            shape = np.cos(x) - q * np.cos(3 * x)
            return judges[gait][f"peak_{pair}"]["horse"] * shape / shape.max()
    return None


def draw(figures: dict[str, list[dict[str, Any]]], out: Path) -> None:
    """Force curves at each speed where the first policy stands, two strides of its footfall there, and lag,
    duty and cost of transport over speed; none where it stands at no speed."""
    from matplotlib.figure import Figure

    first = next(iter(figures.values()))
    shown = [one for one in first if "curves" in one]
    if not shown:
        return print("no pictures: the first policy falls at every speed")
    picture = Figure((3.0 * len(shown), 5.2), layout="constrained")
    axes = picture.subplots(2, len(shown), sharex=True, sharey=True, squeeze=False)
    for column, one in enumerate(shown):
        for row, pair in enumerate(PAIRS):
            for other in figures.values():
                same = next((o for o in other if o["speed"] == one["speed"] and "curves" in o), None)
                if same and same["curves"][pair]:
                    axes[row, column].plot(
                        same["curves"][pair], lw=1.2, color="C0" if row == 0 else "C1", alpha=0.8
                    )
            if (shape := shape_of(one["froude"], pair)) is not None:
                axes[row, column].plot(shape, "k--", lw=1, label="horse, idealised")
                axes[row, column].legend(fontsize=7)
            axes[row, column].grid(alpha=0.3)
        axes[0, column].set_title(
            f"Fr {one['froude']:.2f}, duty {one['duty_fore']:.2f} / {one['duty_hind']:.2f}", fontsize=9
        )
        axes[1, column].set_xlabel("stance [%]")
    for row, pair in enumerate(PAIRS):
        axes[row, 0].set_ylabel(f"{pair}: normal force [N/kg]")
    picture.savefig(out / "forces.png", dpi=110)
    picture = Figure((2.6 * len(shown), 1.9), layout="constrained")
    for axis, one in zip(picture.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        for leg, began, ended in one["footfall"]:
            axis.barh(len(LEGS) - leg, ended - began, left=began, height=0.6, color=f"C{leg // 2}")
        axis.set_yticks(range(len(LEGS), 0, -1), [name.replace("_", " ") for name in LEGS], fontsize=8)
        axis.set_ylim(0.4, len(LEGS) + 0.6)
        axis.set_title(f"Fr {one['froude']:.2f}", fontsize=9)
        axis.set_xlabel("time [s]")
    picture.savefig(out / "footfall.png", dpi=110)
    picture = Figure((10, 3.2), layout="constrained")
    panels = picture.subplots(1, 3)
    for name, some in figures.items():
        good = [one for one in some if "lag" in one]
        froude = [one["froude"] for one in good]
        lags = [min(one["lag"], 0.5 - one["lag"]) for one in good]
        panels[0].plot(froude, lags, "o-", ms=3, label=Path(name).name)
        for pair, style in zip(PAIRS, ("o-", "s--"), strict=True):
            panels[1].plot(
                froude, [one[f"duty_{pair}"] for one in good], style, ms=3, label=f"{Path(name).name}, {pair}"
            )
        panels[2].plot(froude, [one["transport"] for one in good], "o-", ms=3)
    judges = json.loads(JUDGES.read_text(encoding="utf-8"))
    panels[1].plot(
        [float(f) for f in judges["duty"] if f != "source"],
        [j["horse"][0] for f, j in judges["duty"].items() if f != "source"],
        "k*",
        label="horses, trot",
    )
    panels[0].plot([0.25], [0.25], "k*", label="horses, walk")
    panels[1].plot([0.25], [0.62], "k^", label="horses, walk")
    for panel, what in zip(
        panels, ("lag of hind to fore [strides]", "duty factor [-]", "cost of transport [-]"), strict=True
    ):
        panel.set_xlabel("Froude number [-]")
        panel.set_ylabel(what)
        panel.grid(alpha=0.3)
    if len(figures) <= 3:
        panels[0].legend(fontsize=7)
        panels[1].legend(fontsize=7)
    picture.savefig(out / "speeds.png", dpi=110)


def main(argv: list[str] | None = None) -> None:
    """Judge policies, and write tables and pictures."""
    import tyro

    from agents.command import parse_pairs

    args = tyro.cli(Args, args=argv, prog="python -m agents.judge", description=__doc__)
    if not args.policies:
        raise ParameterError("policies: expected at least one, got none")
    count("--episodes", args.episodes)
    for froude in args.froude or [None]:
        check_number("--froude", froude, low=0, exclusive_low=True)
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    args.out.mkdir(parents=True, exist_ok=True)
    envs = make_rows(ENV_ID, args.episodes, **env_kwargs)
    figures: dict[str, list[dict[str, Any]]] = {}
    text = []
    assert envs is not None
    if envs.batch.episode_seconds < SECONDS:
        raise ParameterError(
            f"episode_seconds: expected {SECONDS:g} or more, for that long is judged, got"
            f" {envs.batch.episode_seconds:g}"
        )
    pace = envs.batch.body.height / HIP_HEIGHT  # Froude numbers are of the animal's own hips
    with runs.make_env(ENV_ID, **env_kwargs) as env:
        for name in args.policies:
            policy = find_policy(name, env, ENV_ID)
            speeds = [speed_of(froude) * pace**0.5 for froude in args.froude]
            figures[name] = [play(envs, policy, speed) for speed in speeds]
            text.append(table_of(name, figures[name]))
            print(text[-1])
    if len(figures) > 1:
        text.append(table_of(f"All {len(figures)}", of_all(list(figures.values()))))
        print(text[-1])
    about = {"command": runs.command(), "versions": runs.versions(), "figures": figures}
    runs.write_text(args.out / "figures.json", json.dumps(about, indent=1) + "\n")
    runs.write_text(args.out / "table.md", "\n".join(text))
    draw(figures, args.out)
    print(f"written: {args.out}")


if __name__ == "__main__":
    run(main)

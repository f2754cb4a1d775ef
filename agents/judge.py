"""Policies on the horse compared with living horses.

    python -m agents.judge reference
    python -m agents.judge runs/ppo-Horse-v0-s0 runs/ppo-Horse-v0-s1 --out runs/judge

A policy is what `hoof-env evaluate` takes. It gets one speed after the other, each for a whole episode; the
first two seconds do not count. `agents/judges.json` has the horse's figures, their sources and the bars;
nothing in it may enter a reward or a setting.

Rows that are marked `searched` there are given to the search for kinematic gaits (`agents.kinematic_gaits`).
For such a gait, and for an agent trained around it, these rows are printed as searched, inside or outside of
the bar, and never count as met: the other rows judge it. For any other policy all rows judge.

A horse's figure at a Froude number is compared with the gait at the nearest speed. Ours counts only
if the policy falls in a tenth of the episodes at most and keeps the commanded speed to 15 %, the hooves slip
less than 0.10 m a stance and land 0.95 to 1.05 times a turn of their crank, and the Froude number of the
speed that was reached is within 0.1 of the horse's. The last does not hold for the peaks of a trot: they are
compared with the trot-like gait nearest Froude number 1, but not below 0.35: slower horses walk.

Of several policies, as the seeds of an algorithm, there is a table of all, too: means with 95 % intervals.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.command import parse, parse_pairs, run
from agents.gait_figures import SECONDS, mean_lag, play
from agents.horse_gaits import speed_of
from agents.judge_pictures import draw
from agents.judges import of_speeds, read_judges
from agents.rules import TROT, rejection_reason
from hoof_env._output import markdown_table
from hoof_env.envs.policies import start_of
from hoof_env.errors import ParameterError, check_number, count
from hoof_env.evaluation.episodes import make_rows
from hoof_env.evaluation.statistics import estimate
from hoof_env.policies.find import find_policy
from hoof_env.tasks.horse import HIP_HEIGHT
from hoof_env.tasks.horse_gaits import PAIRS, kinematic_speeds

ENV_ID = "hoof_env/Horse-v0"
NEAR = 0.1  # largest difference between the Froude numbers reached and of the horse
WALK = (
    "lag",
    "duty_fore",
    "duty_hind",
    "two_peaked_fore",
    "stride_over_hip",
    "two_peaked_hind",
    "peak_fore",
    "peak_hind",
)
"""Figures by which a walk is judged."""


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


def distance(figures: dict[str, Any], froude: float) -> float:
    """Return the distance between the Froude number that was reached and another."""
    return abs(float(figures["froude_reached"]) - froude)


# The judges


@dataclass(frozen=True)
class Gait:
    """Gait at one speed that is judged, or why there is none, or why it is not comparable."""

    figures: dict[str, Any] | None
    flaw: str = ""


def at_speed(froude: float, gaits: list[dict[str, Any]], what: str = "gait", near: float = NEAR) -> Gait:
    """Return the gait with the speed nearest a Froude number; it has a flaw if that is not near."""
    if not gaits:
        return Gait(None, f"there is no {what}")
    nearest = min(gaits, key=lambda gait: distance(gait, froude))
    flaw = "" if distance(nearest, froude) < near else f"no {what} is near Froude number {froude:g}"
    return Gait(nearest, flaw)


def trots_of(standing: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the gaits with the lag of a trot or a pace."""
    return [gait for gait in standing if min(gait["lag"], 0.5 - gait["lag"]) < TROT]


def pairs_of(name: str) -> Sequence[str]:
    """Return the pairs of legs that a figure is about."""
    last_word = name.rpartition("_")[2]
    # The share of the impulse is about both pairs, whatever its name ends in
    return [last_word] if last_word in PAIRS and name != "impulse_fore" else PAIRS


def excess(ours: float, bars: Sequence[tuple[float, float]]) -> str:
    """Return how far a figure is beyond the end of the nearest bar: relative to it, as text."""
    beyond = min((end for bar in bars for end in bar), key=lambda end: abs(ours - end))
    return f"{ours / beyond - 1:+.0%}" if beyond else f"{ours:+.2g}"


def judged(
    title: str, gait: Gait, name: str, judge: dict[str, Any], bars: list[tuple[float, float]]
) -> tuple[str, ...]:
    """Return a row of the table for a figure; without bars its distance from the horse's is reported."""
    ours = float((gait.figures or {}).get(name, "nan"))
    known = bool(np.isfinite(ours))
    flaws = [gait.flaw, rejection_reason(gait.figures, pairs_of(name)) if gait.figures else ""]
    why = ", ".join(filter(None, flaws))
    # A reason comes before a missing figure: a gait that falls has no figures
    if not known:
        verdict = why or "not measured"
    elif bars and why:
        verdict = f"does not count: {why}"
    elif bars:
        inside = any(low <= ours <= high for low, high in bars)
        if judge.get("searched") and gait.figures and gait.figures.get("searched"):
            verdict = f"searched, {'inside' if inside else 'outside'}"
        else:
            verdict = "met" if inside else f"missed by {excess(ours, bars)}"
    else:
        verdict = f"off by {ours / judge['horse'] - 1:+.0%}" + (f", does not count: {why}" if why else "")
    return (
        title,
        "-" if gait.figures is None else f"{gait.figures['froude_reached']:.2f}",
        str(judge["horse"]),
        " or ".join(f"{low:g} to {high:g}" for low, high in bars) or "none",
        f"{ours:.3g}" if known else "-",
        verdict,
        judge["source"],
    )


def verdicts(figures: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return rows of the table: figure, Froude number, the horse's figure, the bar, ours, the verdict or why
    there is none, and the source. Empty if the policy falls at every speed."""
    judges = read_judges()
    standing = [gait for gait in figures if "lag" in gait]
    if not standing:
        return []
    return [*_walk(judges, standing), *_trot(judges, standing), *_reported(judges, standing)]


def _walk(judges: dict[str, Any], standing: list[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield rows of the walk."""
    walk = at_speed(judges["walk"]["froude"], standing)
    for name in WALK:
        judge = judges["walk"]["duty" if name.startswith("duty") else name]
        yield judged(f"walk: {name}", walk, name, judge, [judge["bar"]])
    yield from _foals(judges, "walk", walk)


def _trot(judges: dict[str, Any], standing: list[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield rows of the trot: lag, peaks and signs at one speed, and duty factors and strides at several."""
    trots = trots_of(standing)
    lowest = judges["reported"]["walk_to_trot"]["horse"]
    # Slower ones would be compared with peaks that no horse has at a walk's speed
    quick = [trot for trot in trots if trot["froude_reached"] >= lowest]
    what = f"trot-like gait from Froude number {lowest:g} on"
    trot = at_speed(judges["trot"]["froude"], quick, what, near=np.inf)
    if trot.figures and trot.figures.get("searched"):
        # Of other gaits the lag is what makes them trot-like: it would always be met
        folded = trot.figures | {"lag": min(trot.figures["lag"], 0.5 - trot.figures["lag"])}
        judge = judges["trot"]["lag"]
        yield judged("trot-like: lag", Gait(folded, trot.flaw), "lag", judge, [judge["bar"]])
    for name, judge in judges["trot"].items():
        if name not in ("froude", "lag"):
            unit = " [N/kg]" if name.startswith(("peak", "net")) else ""
            of_name = name.removesuffix("_2")
            yield judged(f"trot-like: {name}{unit}", trot, of_name, judge, [judge["bar"]])
    for group, names in (("duty", ("duty_fore", "duty_hind")), ("stride_over_hip", ("stride_over_hip",))):
        also = {key: judges[group][key] for key in ("source", "searched")}
        for froude, judge in of_speeds(judges[group]):
            gait = at_speed(froude, trots, "trot-like gait")
            # Published mean of each source, plus and minus the spread
            bars = [(x - judge["bar"], x + judge["bar"]) for x in judge["horse"]]
            for name in names:
                yield judged(f"trot-like at {froude}: {name}", gait, name, judge | also, bars)
    yield from _foals(judges, "trot", trot)


def _foals(judges: dict[str, Any], kind: str, gait: Gait) -> Iterator[tuple[str, ...]]:
    """Yield rows of foals at the Froude number that a gait reaches."""
    foals = judges["foals"]
    froude = float((gait.figures or {}).get("froude_reached", "nan"))
    for name, (intercept, slope) in foals[kind].items():
        expected = round(intercept + slope * froude, 2) if np.isfinite(froude) else "-"
        title = f"foals, {kind}: {name} [N/kg]"
        yield judged(title, gait, name, {"horse": expected, "source": foals["source"]}, [])


def _reported(judges: dict[str, Any], standing: list[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield rows of figures that are reported without a bar."""
    for name, judge in judges["reported"].items():
        if "froude" in judge:
            yield judged(name, at_speed(judge["froude"], standing), name, judge, [])
        else:
            counting = [trot for trot in trots_of(standing) if not rejection_reason(trot, PAIRS)]
            first = min(counting, key=lambda trot: float(trot["froude_reached"]), default=None)
            if first is None:
                gait = Gait(None, "there is no trot-like gait that counts")
            elif first is min(standing, key=lambda one: float(one["froude_reached"])):
                gait = Gait(None, "no slower gait was played, from which it would change")
            else:
                gait = Gait(first)
            yield judged(name, gait, "froude_reached", judge, [])


HEAD = ("judge", "Froude number reached", "horse", "bar", "ours", "verdict", "source")
SHOWN = (
    "reached",
    "froude_reached",
    "fell",
    "peak_fore",
    "peak_hind",
    "peak_over_mean_fore",
    "peak_over_mean_hind",
    "duty_fore",
    "duty_hind",
    "stances_per_turn_fore",
    "stances_per_turn_hind",
    "slip_fore",
    "slip_hind",
    "depth_fore",
    "depth_hind",
    "lag",
    "two_peaked_fore",
    "two_peaked_hind",
    "peak_braking_fore",
    "peak_propulsion_fore",
    "peak_braking_hind",
    "peak_propulsion_hind",
    "mean_braking_fore",
    "mean_propulsion_fore",
    "mean_braking_hind",
    "mean_propulsion_hind",
    "net_fore",
    "net_hind",
    "loading_fore",
    "loading_hind",
    "stride_over_hip",
    "impulse_fore",
    "transport",
)


def pool(each: list[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return figures of several policies at each speed as one: means, and under "intervals" their 95 %
    intervals as text. Policies that do not stay up at a speed are left out there, except for "fell"."""
    pooled = []
    for at_this_speed in zip(*each, strict=True):
        standing = [policy for policy in at_this_speed if "lag" in policy]
        mean_figures: dict[str, Any] = {name: at_this_speed[0][name] for name in ("speed", "froude")}
        mean_figures["intervals"] = {}
        # A figure that one of them was searched with is no result of all
        mean_figures["searched"] = any(policy.get("searched") for policy in at_this_speed)
        for name in SHOWN if standing else ("fell",):
            counted = at_this_speed if name == "fell" else standing
            values = [policy[name] for policy in counted if np.isfinite(policy[name])]
            if not values:  # none that was watched stayed up
                continue
            # An arithmetic mean of 0.01 and 0.49 would be a walk
            if name == "lag":  # a trot may be just before 0 or just after
                middle = mean_lag(values)
                values = [middle + (x - middle + 0.25) % 0.5 - 0.25 for x in values]
            interval = estimate(values)
            mean_figures[name] = interval.mean % 0.5 if name == "lag" else interval.mean
            mean_figures["intervals"][name] = interval.text(3)
        pooled.append(mean_figures)
    return pooled


def table_of(name: str, figures: list[dict[str, Any]]) -> str:
    """Return verdicts and all figures of a policy, Markdown."""
    speeds = (f"Fr {gait['froude']:.3g}, {gait['speed']:.2f} m/s" for gait in figures)
    head = ("figure", *speeds, "horse")
    reported = read_judges()["reported"]
    body = []
    for key in SHOWN:
        ours = []
        for gait in figures:
            measured = f"{gait[key]:.3g}" if key in gait else "-"
            ours.append(gait.get("intervals", {}).get(key) or measured)
        body.append((key, *ours, str(reported.get(key, {}).get("horse", ""))))
    verdict = markdown_table(HEAD, verdicts(figures))
    units = "Forces in N/kg, loading in N/kg/s, slip and depth in m, lag in strides."
    return f"# {name}\n\n{verdict}\n\n{units}\n\n{markdown_table(head, body)}\n"


def is_searched(envs: Any, policy: Any) -> bool:
    """Return True if a policy plays a kinematic gait, or offsets from one."""
    gaits = (envs.settings.gait, start_of(policy).get("gait"))
    return any(isinstance(gait, str) and gait in kinematic_speeds() for gait in gaits)


def main(argv: list[str] | None = None) -> None:
    """Judge policies, and write tables and pictures."""
    args = parse(Args, argv, "python -m agents.judge", __doc__)
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
    if envs.settings.episode_seconds < SECONDS:
        raise ParameterError(
            f"episode_seconds: expected at least {SECONDS:g}, the time that is judged, got"
            f" {envs.settings.episode_seconds:g}"
        )
    # An animal of another size reaches a Froude number at another speed
    pace = envs.body.height / HIP_HEIGHT  # Froude numbers are of the animal's own hips
    with runs.make_env(ENV_ID, **env_kwargs) as env:
        for name in args.policies:
            policy = find_policy(name, env, ENV_ID)
            speeds = [speed_of(froude) * pace**0.5 for froude in args.froude]
            searched = is_searched(envs, policy)
            figures[name] = [play(envs, policy, speed) | {"searched": searched} for speed in speeds]
            text.append(table_of(name, figures[name]))
            print(text[-1])
    if len(figures) > 1:
        text.append(table_of(f"All {len(figures)}", pool(list(figures.values()))))
        print(text[-1])
    about = {"command": runs.command(), "versions": runs.versions(), "figures": figures}
    runs.write_text(args.out / "figures.json", json.dumps(about, indent=1) + "\n")
    runs.write_text(args.out / "table.md", "\n".join(text))
    draw(figures, args.out)
    print(f"written: {args.out}")


if __name__ == "__main__":
    run(main)

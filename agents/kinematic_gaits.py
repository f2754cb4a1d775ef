"""Kinematic gaits of the horse, found by CMA-ES: `python -m agents.kinematic_gaits`.

The searches of `agents.horse_gaits` know the return alone. These are also given the kinematics of living
horses: the rows of `agents/judges.json` that are marked `searched`, which are lag, duty factors, number of
force peaks and length of the stride. Many gaits have these, and a criterion decides: the least mean square of
the forces on the hooves, which is high at peaks and where legs pull against each other. `--criterion` chooses
another one: the least positive work of single limbs on the centre of mass (Donelan, Kram and Kuo 2002, J.
Biomech. 35:117) or of the drives, the highest return, the lowest peaks or the slowest loading. No criterion
contains a figure of a horse, and the search is not given the figures that judge its gaits: peaks, braking,
propulsion, impulses and loading of horses.

A search begins with the reference gait of its speed, with a stride of 1.3 to 2.3 hip heights and several
leads of the fore pair. The best lead of each stride is improved, and then the best of these. Searches that
are in the file are not made again.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse, run
from agents.evolution import generations, make_strategy, require
from agents.horse_gaits import speed_of
from agents.judges import Bars, searched_bars
from hoof_env.dynamics.layout import Features, stride_sums
from hoof_env.dynamics.observables import stance_figures
from hoof_env.errors import HoofEnvError, check_choice, parse_json
from hoof_env.evaluation.episodes import make_rows
from hoof_env.simd.threads import limit_threads
from hoof_env.tasks.horse import HIP_HEIGHT
from hoof_env.tasks.horse_gaits import LEGS, PAIRS, bounds, horse_gaits, reference_gaits

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/Horse-v0"
POPULATION = 16
STARTS = 6
SECONDS = 6.0
SETTLED = 2.0
"""Candidates of a generation, episodes of each, their length and the time after which figures count [s]."""
BINS = 32  # of a turn of the crank, in which the force of a pair is averaged

PHASES = np.arange(0.0, 0.5, 0.025)  # of starts that are tried [strides]
DROPPED = 512  # starts from each
AT_ONCE = 1.4  # [s]

STRIDES = (1.3, 1.6, 1.95, 2.3)  # of the gaits that searches begin with [hip heights]
LEADS = np.arange(0.0, 0.5, 0.05)  # of these [strides]
SPREAD = 0.15  # of a search that begins there, in the box
AGAIN = 0.07  # of one that goes on

SWING = ((0.2, 1.7), (-0.7, 0.9), (-1.3, 0.3), (-0.5, 0.5), (-0.5, 0.5))
"""Least and largest offset and coefficients of the swing in a search [rad]; other numbers have the limits of
`RATE`, `LEAD` and `PART`."""
RATE = (2.5, 14.0)  # [rad/s]
LEAD = (-0.5, 0.5)  # [strides]
PART = (-0.6, 0.6)  # of the crank's speed [-]

SCALES = {
    "lag": 0.02,
    "duty_fore": 0.02,
    "duty_hind": 0.02,
    "stride_over_hip": 0.1,
    "dip_fore": 0.05,
    "dip_hind": 0.05,
    "slip_fore": 0.02,
    "slip_hind": 0.02,
    "stances_per_turn_fore": 0.03,
    "stances_per_turn_hind": 0.03,
    "speed_ratio": 0.03,
}
"""Scale of the distance from a bar, by figure."""
MARGIN = 0.25  # distance within a bar from which on it costs nothing, in these
NEEDED: Bars = {
    "slip_fore": [(0.0, 0.09)],
    "slip_hind": [(0.0, 0.09)],
    "stances_per_turn_fore": [(0.96, 1.04)],
    "stances_per_turn_hind": [(0.96, 1.04)],
    "speed_ratio": [(0.95, 1.05)],
}
"""What a gait needs so that its figures count; see `agents.judge`."""
MISS = 4.0  # cost of a scale beyond a bar
FALL = 60.0  # cost of a gait that always falls
CRITERIA = {
    "force": ("force", 40.0),
    "limbs": ("limb_work", 20.0),
    "work": ("transport", 4.0),
    "return": ("return", -0.02),
    "peak": ("peak", 4.0),
    "loading": ("loading", 0.1),
}
"""Figure that decides between gaits with the wanted kinematics, and the cost of 1 of it, by criterion.

They are the mean square of the forces on all hooves over the weight [-], positive work of single limbs on the
centre of mass or of the drives over weight and distance [-], return of `SECONDS`, mean of the stances' peaks
over the weight [-] and of their steepest rises [1/s].
"""
TWO_PEAKED = (0.12, 1.0)
ONE_PEAKED = (0.0, 0.02)
"""Depth of the dip between two peaks, over the higher one, of a force with two and of one with one."""


def box() -> tuple[Floats, Floats]:
    """Return the least and the largest numbers of a gait in a search, shape (16,) each."""
    low, high = np.transpose([RATE, LEAD, *[PART, PART, *SWING] * len(PAIRS)])
    limits = bounds()
    return np.maximum(low, limits[0]), np.minimum(high, limits[1])


def decode(points: Floats) -> Floats:
    """Convert points of the box [-1, 1] to gaits, both of shape (n, 16)."""
    low, high = box()
    gaits: Floats = low + (np.clip(points, -1, 1) + 1) / 2 * (high - low)
    return gaits


def encode(gaits: Floats) -> Floats:
    """Convert gaits, shape (n, 16), to points within the box; the inverse of `decode`."""
    low, high = box()
    points: Floats = np.clip(2 * (gaits - low) / (high - low) - 1, -1, 1)
    return points


def first_gaits(kind: str, speed: float, stride: float) -> Floats:
    """Return the gait with which searches for a walk or a trot begin, at a speed [m/s] and with a stride [hip
    heights], once for each of `LEADS`, shape (n, 16).

    It is the reference gait of the speed, or the stored trot-like gait with the leads around its own. Cranks
    turn faster as the stride is shorter, and the swing is smaller.
    """
    gaits = np.repeat(reference_gaits(np.array([speed])), len(LEADS), axis=0)
    gaits[:, 1] = LEADS
    if kind == "trot":
        gaits[:] = horse_gaits()["trot-like"].to_array()
        gaits[:, 1] += (LEADS - LEADS.mean()) / 2
    rate = 2 * np.pi * speed / (stride * HIP_HEIGHT)
    smaller = min(gaits[0, 0] / rate, 1.0)
    gaits[:, 0] = rate
    for k in range(len(PAIRS)):
        # Past the crank's two numbers and the swing's offset
        swing = slice(2 + 7 * k + 3, 2 + 7 * (k + 1))
        gaits[:, swing] *= smaller
    return decode(encode(gaits))


def dips(curves: Floats) -> Floats:
    """Return the depth of the deepest dip between two peaks of curves over a turn, over their highest value.

    Args:
        curves: forces at equal steps of a turn, shape (bins, n).

    Returns:
        Depths [-], shape (n,): 0 for a curve with a single peak.
    """
    # From the lowest force on, which lies in the swing
    first = curves.argmin(0)
    rows = (first + np.arange(len(curves))[:, None]) % len(curves)
    turned = np.take_along_axis(curves, rows, 0)
    before = np.maximum.accumulate(turned, 0)
    after = np.maximum.accumulate(turned[::-1], 0)[::-1]
    depths: Floats = (np.minimum(before, after) - turned).max(0) / np.maximum(turned.max(0), 1e-9)
    return depths


class Rig:
    """Horses that play candidates of a search.

    Args:
        num_envs: number of horses.
        **settings: arguments of the environment.
    """

    def __init__(self, num_envs: int, **settings: Any) -> None:
        envs: Any = make_rows(ENV_ID, num_envs, **{"num_threads": limit_threads(2), **settings})
        self.envs = envs
        features = Features(self.envs.body.harmonics, self.envs.settings.hoof_stiffness is not None, True)
        self.names = stride_sums(features)
        measured = self.envs.reset(seed=0)[1]["measured"].names
        # Names are found once, not in every step
        of_legs = (*self.names, "crank_angle", "stance_began")
        self.of_legs = {name: [measured.index(f"{leg}_{name}") for leg in LEGS] for name in of_legs}
        self.of_sums = np.array([self.of_legs[name] for name in self.names])
        self.of_trunk = [measured.index(name) for name in ("x", "vx", "vy")]

    def play(
        self,
        gaits: Floats,
        speed: float,
        seed: int,
        starts: int,
        seconds: float | None = None,
        settled: float | None = None,
        actions: Floats | None = None,
    ) -> dict[str, Floats]:
        """Play the beginning of episodes at a commanded speed.

        Args:
            gaits: gaits, shape (m, 16), with m times `starts` not more than the horses.
            speed: commanded speed [m/s].
            seed: seed of the first of the `starts` starts, which all gaits meet.
            starts: episodes of each gait.
            seconds: length that is played [s]; None for `SECONDS`.
            settled: time from which on figures count [s]; None for `SETTLED`.
            actions: constant actions of each gait, shape (m, 16); None for zeros.

        Returns:
            Means of figures over upright episodes, shape (m,) each, named as in `gait_figures.play`; "dip"
            of fore and hind is that of `dips`, "touch" of a leg is its landing after the left hind leg's, as
            a share of the stride, "peak" of a leg is in weights, and "return" is over all episodes.
        """
        envs = self.envs
        m = len(gaits)
        rows = np.repeat(gaits, starts, axis=0)
        rows = np.concatenate([rows, np.repeat(rows[-1:], envs.num_envs - len(rows), axis=0)])
        n = len(rows)
        envs.reset(seed=[seed + k % starts for k in range(n)], options={"gait": rows, "target_speed": speed})
        acted = np.zeros((n, 16), np.float32)
        if actions is not None:
            of_rows = np.repeat(actions, starts, axis=0)
            acted[: len(of_rows)] = of_rows
        sums = np.zeros((len(self.names), len(LEGS), n))
        upright = np.ones(n, bool)
        returns = np.zeros(n)
        # Sums over landings of fore and of hind hooves, and of each
        landed = np.zeros((len(PAIRS), n), complex)
        touched = np.zeros((len(LEGS), n), complex)
        place = np.zeros((1 + len(LEGS), n))
        forces = np.zeros((len(PAIRS), BINS, n))
        counts = np.full((len(PAIRS), BINS, n), 1e-9)
        column = np.arange(n)
        limb_work = np.zeros(n)
        squares = np.zeros(n)
        counted = round((SETTLED if settled is None else settled) / envs.dt)
        steps = round((SECONDS if seconds is None else seconds) / envs.dt)
        for k in range(steps):
            _, rewards, failed, _, infos = envs.step(acted)
            upright &= ~failed
            returns += np.where(upright, rewards, 0.0)
            measured = np.asarray(infos["measured"]).T
            before = place[1:]
            x, vx, vy = measured[self.of_trunk]
            place = np.concatenate([x[None], measured[self.of_legs["crank_angle"]]])
            if k == counted - 1:
                began = place
            if k >= counted:
                sums += measured[self.of_sums]
                step = {name: measured[rows_of] for name, rows_of in self.of_legs.items()}
                forwards = step["propulsion"] - step["braking"]
                ups = step["normal_impulse"]
                for forward, up in zip(forwards, ups, strict=True):
                    squares += forward**2 + up**2
                    limb_work += np.maximum(forward * vx + up * vy, 0.0)
                # The time of a landing within the step, from the crank's angle
                turned = (step["stance_began"] - before) % (2 * np.pi)
                part = np.clip(turned / np.maximum((place[1:] - before) % (2 * np.pi), 1e-9), 0, 1)
                # Two turns a stride: left and right are half a stride apart
                phase = 2 * rows[:, 0] * (k + part) * envs.dt
                landings = step["stances"] * np.exp(1j * phase)
                touched += step["stances"] * np.exp(0.5j * phase)
                landed += landings.reshape(len(PAIRS), 2, n).sum(1)
                at = (place[1:] / (2 * np.pi) * BINS).astype(int) % BINS
                for i in range(len(LEGS)):
                    # The mean force over the step, but for a factor
                    forces[i // 2, at[i], column] += ups[i]
                    counts[i // 2, at[i], column] += 1
        moved = place - began
        turns = moved[1:] / (2 * np.pi)
        of_names = dict(zip(self.names, sums, strict=True))
        figures = self._figures(of_names, (steps - counted) * envs.dt, moved[0], turns)
        figures["force"] = squares / envs.dt**2 / (steps - counted) / envs.weight**2
        figures["limb_work"] = limb_work / (envs.weight * np.abs(moved[0]))
        for k, pair in enumerate(PAIRS):
            figures[f"dip_{pair}"] = dips(forces[k] / counts[k])
        figures["speed_ratio"] = figures["reached"] / speed
        touches = dict(zip(LEGS, touched * touched[2].conj(), strict=True))
        return self._means(figures, landed[0] * landed[1].conj(), touches, returns, upright, m, starts)

    def _figures(
        self, sums: dict[str, Floats], seconds: float, travelled: Floats, turns: Floats
    ) -> dict[str, Floats]:
        """Return the figures of each episode, shape (n,)."""
        stances = stance_figures(sums, seconds, turns)
        figures = {}
        with np.errstate(all="ignore"):
            for k, pair in enumerate(PAIRS):
                for name in ("duty", "slip", "stances_per_turn"):
                    figures[f"{name}_{pair}"] = stances[name][2 * k : 2 * k + 2].mean(0)
            figures["reached"] = travelled / seconds
            weight = self.envs.weight
            figures["transport"] = sums["positive_work"].sum(0) / (weight * np.abs(travelled))
            figures["peak"] = stances["peak"].mean(0) / weight
            for leg, peak in zip(LEGS, stances["peak"], strict=True):
                figures[f"peak_{leg}"] = peak / weight
            figures["loading"] = (sums["loading_rate_increase"] / sums["stances"]).mean(0) / weight
            figures["stride_over_hip"] = travelled / turns.mean(0) / self.envs.body.height
        return figures

    @staticmethod
    def _means(
        figures: dict[str, Floats],
        lags: Any,
        touches: dict[str, Any],
        returns: Floats,
        upright: Any,
        m: int,
        starts: int,
    ) -> dict[str, Floats]:
        """Return means over the upright episodes of each gait."""
        size = m * starts
        ok = upright[:size].reshape(m, starts)
        count = np.maximum(ok.sum(1), 1)
        means = {}
        for name, values in figures.items():
            each = np.where(ok, np.nan_to_num(values[:size].reshape(m, starts), nan=1e3, posinf=1e3), 0.0)
            means[name] = np.where(ok.any(1), each.sum(1) / count, np.nan)
        lag = np.where(ok, lags[:size].reshape(m, starts), 0.0).sum(1)
        means["lag"] = np.where(ok.any(1), np.angle(lag) / (4 * np.pi) % 0.5, np.nan)
        for leg, values in touches.items():
            touch = np.where(ok, values[:size].reshape(m, starts), 0.0).sum(1)
            means[f"touch_{leg}"] = np.where(ok.any(1), np.angle(touch) / (2 * np.pi) % 1.0, np.nan)
        means["return"] = returns[:size].reshape(m, starts).mean(1)
        means["fell"] = 1 - ok.mean(1)
        return means


def misses_of(figures: dict[str, Floats], bars: Bars, fall: float = FALL) -> Floats:
    """Return what gaits cost by what they miss, shape (m,): distances from bars and from `NEEDED` over
    `SCALES`, and falls."""
    cost = np.zeros(len(figures["fell"]))
    for name, of_name in (bars | NEEDED).items():
        scale = SCALES[name]
        distances = [distance(figures[name], low, high, scale, name == "lag") for low, high in of_name]
        far = np.min(distances, axis=0)
        # Far from the bar a cost grows more slowly, so that no figure hides all others
        cost += MISS * np.where(np.isfinite(far), far / (1 + far / 20), 20.0)
    missed: Floats = cost + fall * figures["fell"]
    return missed


def costs_of(figures: dict[str, Floats], bars: Bars, criterion: str = "force", fall: float = FALL) -> Floats:
    """Return the cost of gaits, shape (m,): `misses_of`, and one of `CRITERIA`."""
    name, price = CRITERIA[criterion]
    total: Floats = misses_of(figures, bars, fall) + price * np.nan_to_num(figures[name], nan=10.0)
    return total


def distance(values: Floats, low: float, high: float, scale: float, is_lag: bool) -> Floats:
    """Return the distance from a bar, over a scale; it is 0 from `MARGIN` within the bar on, if that is wide
    enough. The lag is a number of strides within half of one, which is 0 again."""
    margin = min(MARGIN * scale, (high - low) / 4)
    # Slip and dips are never below 0
    below, above = low + margin * (low != 0), high - margin
    if is_lag:
        middle = (low + high) / 2
        values = middle + (values - middle + 0.25) % 0.5 - 0.25
    apart: Floats = np.maximum(np.maximum(below - values, values - above), 0.0) / scale
    return apart


def peaked(bars: Bars) -> Bars:
    """Return bars with the number of peaks as the depth of a dip, which changes smoothly with a gait."""
    dips_of = {}
    for name, of_name in bars.items():
        if name.startswith("two_peaked"):
            name = name.replace("two_peaked", "dip")
            of_name = [TWO_PEAKED if of_name[0][0] > 0.5 else ONE_PEAKED]
        dips_of[name] = of_name
    return dips_of


@dataclass
class Args:
    """Arguments of the command."""

    gaits: tuple[str, ...] = ("walk", "trot")
    """gaits to search for: walk, trot"""
    froude: tuple[float, ...] = (0.2, 0.85)
    """Froude number of each"""
    criterion: str = "force"
    """criterion between gaits with the wanted kinematics: force, limbs, work, return, peak or loading"""
    out: Path = Path("runs/kinematic.json")
    """file of the searches; one that exists is continued"""
    shipped: Path = Path("runs/kinematic-gaits.json")
    """file of the gaits found, in the form of hoof_env/data/horse/kinematic.json"""
    begin: Path | None = None
    """file of gaits from which searches start, in the form of `shipped`; otherwise from several strides"""
    first: int = 120
    """generations from each stride"""
    more: int = 300
    """generations from the best of these"""
    seed: int = 0
    """of searches and their episodes"""
    starts: int = STARTS
    """episodes of each candidate"""
    fall: float = FALL
    """cost of a gait that always falls"""
    spread: float = AGAIN
    """of a search that goes on, in the box of the gaits"""


class Finder:
    """Searches for one gait at one speed.

    Args:
        kind: "walk" or "trot".
        froude: Froude number of the commanded speed.
        seed: seed of the searches and their episodes.
        criterion: one of `CRITERIA`.
        starts: episodes of each candidate.
        fall: cost of a gait that always falls.
        **settings: arguments of the environment.
    """

    def __init__(
        self,
        kind: str,
        froude: float,
        seed: int,
        criterion: str = "force",
        starts: int = STARTS,
        fall: float = FALL,
        **settings: Any,
    ) -> None:
        require("agents.kinematic_gaits", "cma")
        self.kind = kind
        self.speed = speed_of(froude)
        self.bars = peaked(searched_bars(kind, froude))
        self.seed = seed
        self.criterion = criterion
        self.count = 0
        self.starts = starts
        self.fall = fall
        self.rig = Rig(POPULATION * starts, **settings)

    def costs(self, gaits: Floats) -> list[float]:
        """Return the costs of gaits, at most `POPULATION`; every call has other starts."""
        self.count += 1
        seed = 100_000 * (self.seed + 1) + self.starts * self.count
        figures = self.rig.play(gaits, self.speed, seed, self.starts)
        found: list[float] = costs_of(figures, self.bars, self.criterion, self.fall).tolist()
        return found

    def begin(self, stride: float) -> Floats:
        """Return the best first gait of a stride [hip heights], shape (16,)."""
        gaits = first_gaits(self.kind, self.speed, stride)
        best: Floats = gaits[int(np.argmin(self.costs(gaits)))]
        return best

    def improve(self, first: Floats, spread: float, count: int, tick: Any) -> Floats:
        """Return the gait to which `count` generations lead from another, shape (16,)."""
        strategy = make_strategy(encode(first[None])[0], spread, POPULATION, self.seed + 1)
        search = generations(strategy, lambda points: self.costs(decode(np.array(points))), count)
        for _, costs in search:
            tick(min(costs))
        # The mean of the distribution, not its luckiest candidate
        gait: Floats = decode(strategy.result.xfavorite[None])[0].round(5)
        return gait

    def check(self, gait: Floats) -> dict[str, Any]:
        """Return a gait and its figures over starts of their own."""
        starts = POPULATION * self.starts
        figures = self.rig.play(gait[None], self.speed, 10**7, starts)
        cost = float(costs_of(figures, self.bars, self.criterion, self.fall)[0])
        shown = {name: round(float(values[0]), 4) for name, values in figures.items()}
        return {"gait": gait.tolist(), "cost": round(cost, 4), **shown}


class Records:
    """Searches in a file, which is written after each of them.

    Args:
        out: the file.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.content: dict[str, Any] = {"searches": {}}
        if out.is_file():
            self.content = parse_json(out.read_text(encoding="utf-8"))

    def keep(self, name: str, look: Any) -> dict[str, Any]:
        """Return what a search found under this name, or finds now."""
        from tqdm import tqdm

        if name not in self.content["searches"]:
            began = time.monotonic()
            with tqdm(desc=name, unit=" generations", leave=False, disable=None) as bar:

                def tick(best: float) -> None:
                    bar.update()
                    bar.set_postfix(best=f"{best:.2f}")

                found = look(tick)
            found["wall_s"] = round(time.monotonic() - began, 1)
            self.content["searches"][name] = found
            self.content |= {"command": runs.command(), "versions": runs.versions()}
            self.out.parent.mkdir(parents=True, exist_ok=True)
            runs.write_text(self.out, json.dumps(self.content, indent=1) + "\n")
            print(name, {key: value for key, value in found.items() if key != "gait"}, flush=True)
        kept: dict[str, Any] = self.content["searches"][name]
        return kept


def find(kind: str, froude: float, args: Args, records: Records) -> dict[str, Any]:
    """Return the best gait of a kind at a Froude number: searches from each stride, and one from the best of
    these."""
    finder = Finder(kind, froude, args.seed, args.criterion, args.starts, args.fall)
    title = f"{kind} at {froude:g} by {args.criterion}, seed {args.seed}"

    def improve(first: Floats, spread: float, count: int) -> Any:
        return lambda tick: finder.check(finder.improve(first, spread, count, tick))

    if args.begin is not None:
        known = parse_json(args.begin.read_text(encoding="utf-8"))
        best = np.array(known[check_choice("gait", f"kinematic-{kind}", known)]["gait"])
        return records.keep(f"{title}, from {args.begin.name}", improve(best, args.spread, args.more))
    begun = [
        records.keep(f"{title}, stride {stride:g}", improve(finder.begin(stride), SPREAD, args.first))
        for stride in STRIDES
    ]
    best = np.array(min(begun, key=lambda one: float(one["cost"]))["gait"])
    return records.keep(f"{title}, best", improve(best, args.spread, args.more))


def phase_of(gait: Floats, speed: float) -> float | None:
    """Return the phase of the stride at which episodes in a gait should start: the middle of the longest run
    of `PHASES` from which no horse falls at once; None if none falls from any.

    A start is level and at rest but for its speed, which a gait with flight may not take at any phase.

    Raises:
        HoofEnvError: horses fall from each phase.
    """
    envs: Any = make_rows(ENV_ID, DROPPED, num_threads=limit_threads(2))
    idle = np.zeros((DROPPED, 16), np.float32)
    falls = []
    for phase in PHASES:
        options = {"gait": gait, "target_speed": speed, "phase": float(phase)}
        envs.reset(seed=[2 * 10**6 + k for k in range(DROPPED)], options=options)
        fell = np.zeros(DROPPED, bool)
        for _ in range(round(AT_ONCE / envs.dt)):
            fell |= envs.step(idle)[2]
        falls.append(int(fell.sum()))
    if not any(falls):
        return None
    # Twice around, for the run may pass the end; left and right are alike half a stride apart
    runs_of = [0]
    for count in falls * 2:
        runs_of.append(runs_of[-1] + 1 if count == 0 else 0)
    longest = min(max(runs_of), len(PHASES))
    if longest == 0:
        raise HoofEnvError(
            f"the gait at {speed:.2f} m/s: expected a phase from which no horse falls, got none"
        )
    last = runs_of.index(max(runs_of)) - 1
    middle: float = round((last - (longest - 1) / 2) / len(PHASES) / 2 % 0.5, 4)
    return middle


def main(argv: list[str] | None = None) -> None:
    """Find gaits."""
    args = parse(Args, argv, "python -m agents.kinematic_gaits", __doc__)
    records = Records(args.out)
    shipped = {}
    for kind, froude in zip(args.gaits, args.froude, strict=True):
        found = find(kind, froude, args, records)
        # A gait is filed under the speed that it reaches
        speed = round(found["reached"], 3)
        phase = phase_of(np.array(found["gait"]), speed)
        start = {} if phase is None else {"phase": phase}
        shipped[f"kinematic-{kind}"] = {"speed": speed, **start, "gait": found["gait"]}
    runs.write_text(args.shipped, json.dumps(shipped, indent=1) + "\n")
    print(f"written: {args.out}, {args.shipped}")


if __name__ == "__main__":
    run(main)

"""What policies on the horse look like beside living horses.

    python -m agents.judge reference
    python -m agents.judge runs/ppo-Horse-v0-s0 runs/ppo-Horse-v0-s1 --out runs/judge

A policy is what agents.score takes. It is asked for one speed after the other, each kept for a whole episode;
the first two seconds do not count. `agents/judges.json` has the horse's figures, their sources and the bars;
nothing in it may enter a reward, a search or a choice of settings. A figure counts only where a hoof slips
less than 0.10 m a stance and lands 0.95 to 1.05 times a turn of its crank.

Left and right legs of a pair are interchangeable in the plane: the lag is how long after a hind hoof the next
fore hoof lands, over the stride and within half of one, so that 0 is a trot or a pace and 0.25 a walk.
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
from agents.horse_gaits import speed_of
from agents.score import find_policy, make_rows
from hoof_env._output import markdown_table
from hoof_env.dynamics.layout import Features, stride_sums
from hoof_env.dynamics.observables import stance_figures
from hoof_env.dynamics.parts import GRAVITY
from hoof_env.envs.horse import HIP_HEIGHT
from hoof_env.envs.reference import LEGS, PAIRS
from hoof_env.errors import ParameterError

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/Horse-v0"
SETTLED, SECONDS = 2.0, 10.0  # from where on figures count, and the length of an episode [s]
WATCHED = 8  # episodes whose forces are kept at every substep
MOST_SLIP, TURNS = 0.10, (0.95, 1.05)  # where a figure counts: [m], stances a turn
SHORTEST, DIP = 0.05, 0.05  # of a stance [s]; between two peaks, over the higher one [-]
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
    """folder for figures.json, table.md, forces.png and speeds.png"""


@dataclass
class Stance:
    """One stance: hoof, times [s] and normal force [N] at every substep."""

    leg: int
    began: float
    ended: float
    force: Floats

    @property
    def is_two_peaked(self) -> bool:
        """Whether the force, smoothed over a tenth of the stance, falls by `DIP` between two peaks."""
        width = max(len(self.force) // 10, 1)
        smooth = np.convolve(self.force, np.ones(width) / width, "same")
        top = int(np.argmax(smooth))
        for side in (smooth[:top][::-1], smooth[top + 1 :]):  # away from the highest peak
            lowest = np.minimum.accumulate(side)
            if len(side) and (side - lowest).max() > DIP * smooth[top]:
                return True
        return False


def stances_of(time: Floats, forces: Floats, lift_off: float) -> list[Stance]:
    """Whole stances in a record, `forces` of shape (n, 4)."""
    found = []
    for leg in range(forces.shape[1]):
        loaded = np.concatenate([[False], forces[:, leg] > lift_off, [False]])
        begins, ends = (
            np.flatnonzero(np.diff(loaded.astype(int)) == 1),
            np.flatnonzero(np.diff(loaded.astype(int)) == -1),
        )
        for begin, end in zip(begins, ends, strict=True):
            if begin > 0 and end < len(time) and time[end - 1] - time[begin] > SHORTEST:
                found.append(Stance(leg, time[begin], time[end - 1], forces[begin:end, leg]))
    return found


def lag_of(stances: list[Stance], stride: float) -> float:
    """From hind to fore hoofs [strides], within half a stride, as a circular mean; NaN without any."""
    fore = np.array([one.began for one in stances if one.leg < 2])
    hind = np.array([one.began for one in stances if one.leg >= 2])
    if not len(fore) or not len(hind):
        return float("nan")
    gaps = [(fore[fore >= landed].min() - landed) / stride for landed in hind if (fore >= landed).any()]
    turned = np.mean(np.exp(4j * np.pi * np.array(gaps)))  # half a stride is a whole turn
    return float(np.angle(turned) / (4 * np.pi) % 0.5)


def play(envs: Any, policy: Any, speed: float) -> dict[str, Any]:
    """Episodes at one commanded speed [m/s]: figures of each pair of legs, means over the episodes that did
    not end early; and stances of those that are watched."""
    seeds = [3_000_000 + k for k in range(envs.num_envs)]
    seen, _ = envs.reset(seed=seeds, options={"target_speed": speed})
    envs.record(0)
    n, dt = envs.num_envs, envs.dt
    features = Features(envs.batch.body.harmonics, envs.settings.hoof_stiffness is not None, True)
    names, settled = stride_sums(features), round(SETTLED / dt)
    sums = {name: np.zeros((4, n)) for name in names}
    start, upright, state = np.ones(n, bool), np.ones(n, bool), None
    watched: list[list[Any]] = [[] for _ in range(min(WATCHED, n))]
    mass = envs.weight / GRAVITY
    steps = round(SECONDS / dt)
    for k in range(steps):
        actions, state = policy.predict(seen, state, episode_start=start, deterministic=True)
        seen, _, failed, _, infos = envs.step(np.asarray(actions, np.float32))
        start, upright = np.zeros(n, bool), upright & ~failed
        measured = infos["measured"]
        if k == settled:
            began = {name: measured[name].copy() for name in ("x", *(f"{leg}_theta" for leg in LEGS))}
        if k >= settled and k < steps - 1:  # the last one may have started again
            for name in names:
                sums[name] += np.array([measured[f"{leg}_{name}"] for leg in LEGS])
            last = {name: measured[name].copy() for name in began}
            for env, kept in enumerate(watched):
                record = envs.record(env)
                kept.append({name: record[name] for name in ("time", "toe_normal", "heel_normal")})
    seconds = (steps - 1 - settled) * dt
    travelled = last["x"] - began["x"]
    turns = np.array([last[f"{leg}_theta"] - began[f"{leg}_theta"] for leg in LEGS]) / (2 * np.pi)
    found = stance_figures(sums, seconds, turns)
    strides = turns.mean(0)
    kilograms = float(mass[0])
    result: dict[str, Any] = {
        "speed": speed, "froude": speed**2 / (GRAVITY * envs.batch.body.height),
        "fell": float(1 - upright.mean()),
    }  # fmt: skip
    if not upright.any():
        return result
    pairs = {
        name: np.nanmean(values.reshape(2, 2, n)[..., upright], axis=(1, 2)) for name, values in found.items()
    }
    for k, pair in enumerate(PAIRS):
        for name in ("peak", "mean", "braking", "propulsion"):
            result[f"{name}_{pair}"] = float(pairs[name][k]) / kilograms
        for name in ("duty", "slip", "stances_per_turn"):
            result[f"{name}_{pair}"] = float(pairs[name][k])
        result[f"peak_over_mean_{pair}"] = result[f"peak_{pair}"] / result[f"mean_{pair}"]
    impulse = sums["load_impulse"][:, upright].reshape(2, -1).sum(1)
    work = sums["positive_work"][:, upright].sum(0)
    period = seconds / strides[upright].mean()
    result |= {
        "reached": float(travelled[upright].mean() / seconds),
        "stride_over_hip": float(np.mean(travelled[upright] / strides[upright]) / envs.batch.body.height),
        "impulse_fore": float(impulse[0] / impulse.sum()),
        "transport": float(np.mean(work / (kilograms * GRAVITY * travelled[upright]))),
    }
    stances, lags, lift_off = [], [], 0.05 * kilograms * GRAVITY / 4
    for env, kept in enumerate(watched):
        if upright[env]:
            time, forces = forces_of(kept)
            own = stances_of(time, forces, lift_off)
            stances += own
            lags.append(lag_of(own, period))
    turned = np.nanmean(np.exp(4j * np.pi * np.array(lags))) if lags else np.nan
    result["lag"] = float(np.angle(turned) / (4 * np.pi) % 0.5) if lags else float("nan")
    fore = [one for one in stances if one.leg < 2]
    result["two_peaked"] = float(np.mean([one.is_two_peaked for one in fore])) if fore else float("nan")
    result["curves"] = {
        pair: curve_of([o for o in stances if o.leg // 2 == k], kilograms) for k, pair in enumerate(PAIRS)
    }
    result["counts"] = {
        pair: result[f"slip_{pair}"] < MOST_SLIP
        and TURNS[0] <= result[f"stances_per_turn_{pair}"] <= TURNS[1]
        for pair in PAIRS
    }
    return result


def forces_of(records: list[Any]) -> tuple[Floats, Floats]:
    """Times, shape (n,), and normal forces of the legs, shape (n, 4), of records one after the other."""
    time = np.concatenate([record["time"].ravel() for record in records])
    forces = np.concatenate([(record["toe_normal"] + record["heel_normal"])[..., 0] for record in records])
    return time, forces


def curve_of(stances: list[Stance], mass: float) -> list[float]:
    """Mean normal force [N/kg] at each hundredth of a stance."""
    grid = np.linspace(0, 1, 101)
    curves = [np.interp(grid, np.linspace(0, 1, len(one.force)), one.force) for one in stances]
    return [round(float(x), 4) for x in np.mean(curves, 0) / mass] if curves else []


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
    return rows


HEAD = ("judge", "Froude number", "horse", "bar", "ours", "verdict", "source")
SHOWN = (
    "reached", "fell", "peak_fore", "peak_hind", "peak_over_mean_fore", "peak_over_mean_hind", "duty_fore",
    "duty_hind", "stances_per_turn_fore", "stances_per_turn_hind", "slip_fore", "slip_hind", "lag",
    "two_peaked", "braking_fore", "propulsion_fore", "braking_hind", "propulsion_hind", "stride_over_hip",
    "impulse_fore", "transport",
)  # fmt: skip


def table_of(name: str, figures: list[dict[str, Any]]) -> str:
    """Verdicts and all figures of a policy, Markdown."""
    head = ("figure", *(f"Fr {one['froude']:.3g}, {one['speed']:.2f} m/s" for one in figures), "horse")
    reported = json.loads(JUDGES.read_text(encoding="utf-8"))["reported"]
    body = []
    for key in SHOWN:
        ours = (f"{one[key]:.3g}" if key in one else "-" for one in figures)
        body.append((key, *ours, str(reported.get(key, {}).get("horse", ""))))
    verdict = markdown_table(HEAD, verdicts(figures))
    units = "Forces in N/kg, slip in m, lag in strides."
    return f"# {name}\n\n{verdict}\n\n{units}\n\n{markdown_table(head, body)}\n"


def draw(figures: dict[str, list[dict[str, Any]]], out: Path) -> None:
    """Force curves at each speed, and lag, duty and cost over speed."""
    from matplotlib.figure import Figure

    first = next(iter(figures.values()))
    shown = [one for one in first if "curves" in one]
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
            axes[row, column].grid(alpha=0.3)
        axes[0, column].set_title(
            f"Fr {one['froude']:.2f}, duty {one['duty_fore']:.2f} / {one['duty_hind']:.2f}", fontsize=9
        )
        axes[1, column].set_xlabel("stance [%]")
    for row, pair in enumerate(PAIRS):
        axes[row, 0].set_ylabel(f"{pair}: normal force [N/kg]")
    picture.savefig(out / "forces.png", dpi=110)
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
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    args.out.mkdir(parents=True, exist_ok=True)
    envs = make_rows(ENV_ID, args.episodes, **env_kwargs)
    figures: dict[str, list[dict[str, Any]]] = {}
    text = []
    assert envs is not None
    pace = envs.batch.body.height / HIP_HEIGHT  # Froude numbers are of the animal's own hips
    with runs.make_env(ENV_ID, **env_kwargs) as env:
        for name in args.policies:
            policy = find_policy(name, env, ENV_ID)
            speeds = [speed_of(froude) * pace**0.5 for froude in args.froude]
            figures[name] = [play(envs, policy, speed) for speed in speeds]
            text.append(table_of(name, figures[name]))
            print(text[-1])
    about = {"command": runs.command(), "versions": runs.versions(), "figures": figures}
    runs.write_text(args.out / "figures.json", json.dumps(about, indent=1) + "\n")
    runs.write_text(args.out / "table.md", "\n".join(text))
    draw(figures, args.out)
    print(f"written: {args.out}")


if __name__ == "__main__":
    run(main)

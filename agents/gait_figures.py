"""What a policy on the horse does at a commanded speed: forces, stances, slip, lag, cost of transport.

Left and right legs of a pair are interchangeable in the plane: the lag is how long after a hind hoof the next
fore hoof lands, over the stride and within half of one, so that 0 is a trot or a pace and 0.25 a walk.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.layout import Features, stride_sums
from hoof_env.dynamics.observables import stance_figures
from hoof_env.dynamics.parts import GRAVITY
from hoof_env.envs.reference import LEGS, PAIRS

Floats = NDArray[np.float64]

SETTLED, SECONDS = 2.0, 10.0  # from where on figures count, and the length of an episode [s]
WATCHED = 8  # episodes whose forces are kept at every substep
MOST_SLIP, TURNS = 0.10, (0.95, 1.05)  # where a figure counts: [m], stances a turn
SHORTEST, DIP = 0.05, 0.05  # of a stance [s]; between two peaks, over the higher one [-]


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
    return mean_lag(gaps)


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
            if "footfall" not in result:
                result["footfall"] = footfall_of(own, time[-1], 2 * period)
    result["lag"] = mean_lag(lags) if lags else float("nan")
    fore = [one for one in stances if one.leg < 2]
    result["two_peaked"] = float(np.mean([one.is_two_peaked for one in fore])) if fore else float("nan")
    result["curves"] = {
        pair: curve_of([o for o in stances if o.leg // 2 == k], kilograms) for k, pair in enumerate(PAIRS)
    }
    result["counts"] = which_count(result)
    return result


def footfall_of(stances: list[Stance], end: float, span: float) -> list[list[float]]:
    """Leg, begin and end [s] of the stances in the last `span` [s] of a record that ends there."""
    begin = end - span
    return [
        [one.leg, round(max(one.began - begin, 0.0), 4), round(one.ended - begin, 4)]
        for one in stances
        if one.ended > begin
    ]


def which_count(figures: dict[str, Any]) -> dict[str, bool]:
    """Whether those of each pair of legs do."""
    return {
        pair: figures[f"slip_{pair}"] < MOST_SLIP
        and TURNS[0] <= figures[f"stances_per_turn_{pair}"] <= TURNS[1]
        for pair in PAIRS
    }


def mean_lag(lags: list[float]) -> float:
    """Of lags within half a stride, which is a whole turn."""
    return float(np.angle(np.nanmean(np.exp(4j * np.pi * np.array(lags)))) / (4 * np.pi) % 0.5)


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

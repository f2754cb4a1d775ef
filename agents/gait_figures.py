"""Figures of a policy on the horse at a commanded speed: forces, stances, slip, lag, cost of transport.

Most figures come from the engine's sums over all episodes that did not end early. Those that need forces at
every substep are of such episodes among the first `WATCHED`, for which a record is kept: the lag, the number
of peaks, normal and horizontal force over a stance, and the peaks of braking and propulsion, the highest
horizontal force backward and forward of each whole stance (0 if there is none), averaged over stances.

The loading of a pair is the mean of the stances' steepest rises of the normal force. The net force of a pair
is the mean over time of the horizontal force on its two hooves: positive forward. The depth is the mean over
hooves and episodes of the deepest that a toe or heel gives way on its spring, as deep as pictures show it in
the ground; NaN of rigid hooves.

Left and right legs of a pair are interchangeable in the plane: the lag is the time from the landing of a hind
hoof to the next landing of a fore hoof, over the stride and within half of one, so that 0 is a trot or a pace
and 0.25 a walk.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.layout import Features, stride_sums
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.observables import stance_figures
from hoof_env.policies.actor import Actor
from hoof_env.tasks.horse_gaits import LEGS, PAIRS

Floats = NDArray[np.float64]

SETTLED = 2.0  # time after which figures count [s]
SECONDS = 10.0  # length of an episode [s]
WATCHED = 8  # episodes whose forces are kept at every substep
SHORTEST = 0.05  # stance [s]
DIP = 0.05  # least dip next to a peak, over the highest one [-]
FORCES = ("toe_normal", "heel_normal", "toe_friction", "heel_friction")  # columns of a record that are kept
DEPTHS = ("toe_deflection_normal", "heel_deflection_normal")  # columns that compliant hooves add
HORIZONTAL = ("braking", "propulsion")  # forces backward and forward
NEEDED = ("loading_rate_increase", "stances", *HORIZONTAL)  # sums of loading and net force


@dataclass
class Stance:
    """Stance of one hoof.

    Attributes:
        leg: number of the leg, as in `LEGS`.
        began: time of landing [s].
        ended: time of the last load [s].
        force: normal force at every substep [N].
        push: horizontal force, positive forward, at every substep [N].
    """

    leg: int
    began: float
    ended: float
    force: Floats
    push: Floats

    @property
    def is_two_peaked(self) -> bool:
        """True if the force, smoothed over a tenth of the stance, has two peaks, neither one nor three. A
        peak is within the stance and `DIP` of the highest force above the dips on either side of it."""
        from scipy.signal import find_peaks

        width = max(len(self.force) // 10, 1)
        padded = np.pad(self.force, (width // 2, width - 1 - width // 2), "edge")  # no fall at the ends
        smooth = np.convolve(padded, np.ones(width) / width, "valid")
        return len(find_peaks(smooth, prominence=DIP * smooth.max())[0]) == 2

    @property
    def peak_braking(self) -> float:
        """Highest force backward [N]."""
        return max(float(-self.push.min()), 0.0)

    @property
    def peak_propulsion(self) -> float:
        """Highest force forward [N]."""
        return max(float(self.push.max()), 0.0)


@dataclass
class Played:
    """Sums over n episodes from `SETTLED` on.

    Attributes:
        seconds: time that they cover [s].
        sums: sums of the engine over this time, each shape (4, n).
        travelled: distance [m], shape (n,).
        turns: turns of the cranks [-], shape (4, n).
        upright: True for episodes that did not end early, shape (n,).
        watched: records of the first `WATCHED` episodes, as `forces_of` takes them.
    """

    seconds: float
    sums: dict[str, Floats]
    travelled: Floats
    turns: Floats
    upright: NDArray[np.bool_]
    watched: list[list[dict[str, Floats]]]


def stances_of(time: Floats, forces: Floats, pushes: Floats, lift_off: float) -> list[Stance]:
    """Return the whole stances in a record; normal and horizontal forces have shape (n, 4)."""
    stances = []
    for leg in range(forces.shape[1]):
        loaded = np.concatenate([[False], forces[:, leg] > lift_off, [False]])
        begins = np.flatnonzero(np.diff(loaded.astype(int)) == 1)
        ends = np.flatnonzero(np.diff(loaded.astype(int)) == -1)
        for begin, end in zip(begins, ends, strict=True):
            # A stance cut off by the record's ends has no duration; a short one is a bounce
            if begin > 0 and end < len(time) and time[end - 1] - time[begin] > SHORTEST:
                when = slice(begin, end)
                stances.append(Stance(leg, time[begin], time[end - 1], forces[when, leg], pushes[when, leg]))
    return stances


def lag_of(stances: list[Stance], stride: float) -> float:
    """Return the lag from hind to fore hooves [strides], within half a stride, as a circular mean; NaN
    without landings. `stride` is the duration of a stride [s]."""
    fore = np.array([stance.began for stance in stances if stance.leg < 2])
    hind = np.array([stance.began for stance in stances if stance.leg >= 2])
    if not len(fore) or not len(hind):
        return float("nan")
    # The next landing of either fore hoof: left and right are interchangeable
    gaps = [(fore[fore >= landed].min() - landed) / stride for landed in hind if (fore >= landed).any()]
    return mean_lag(gaps)


def watch(envs: Any, policy: Any, speed: float, gait: Floats | None = None) -> Played:
    """Play episodes at one commanded speed [m/s]; `gait`, shape (16,), replaces the reference gait."""
    seeds = [3_000_000 + k for k in range(envs.num_envs)]
    around = {} if gait is None else {"gait": gait}
    n = envs.num_envs
    actor = Actor(policy)
    actor.begin(n)
    seen, _ = envs.reset(seed=seeds, options={**actor.start, "target_speed": speed, **around})
    dt = envs.dt
    features = Features(envs.body.harmonics, envs.settings.hoof_stiffness is not None, True)
    sums = {name: np.zeros((4, n)) for name in stride_sums(features)}
    upright = np.ones(n, bool)
    watched: list[list[dict[str, Floats]]] = [[] for _ in range(min(WATCHED, n))]
    settled = round(SETTLED / dt)
    steps = round(SECONDS / dt)
    for k in range(steps):
        # All rows are asked together; a failed one plays on, but is not counted
        seen, _, failed, _, infos = envs.step(np.asarray(actor.act(seen), np.float32))
        upright = upright & ~failed
        measured = infos["measured"]
        if k == settled - 1:  # the first step that counts begins here
            began = _place(measured)
        if settled <= k < steps - 1:  # the last one may have started again
            for name, total in sums.items():
                total += np.array([measured[f"{leg}_{name}"] for leg in LEGS])
            last = _place(measured)
            for env, kept in enumerate(watched):
                record = envs.record(env)
                names = ("time", *FORCES, *(name for name in DEPTHS if name in record))
                kept.append({name: record[name] for name in names})
    moved = last - began
    return Played((steps - 1 - settled) * dt, sums, moved[0], moved[1:] / (2 * np.pi), upright, watched)


def _place(measured: Any) -> Floats:
    """Return position [m] and crank angles [rad], shape (5, n)."""
    return np.array([measured[name] for name in ("x", *(f"{leg}_crank_angle" for leg in LEGS))])


def play(envs: Any, policy: Any, speed: float, gait: Floats | None = None) -> dict[str, Any]:
    """Play episodes at one commanded speed [m/s] and return their figures: of each pair of legs, as means
    over the episodes that did not end early, and stances of watched ones."""
    played = watch(envs, policy, speed, gait)
    height = envs.body.height
    kilograms = float(envs.weight[0]) / GRAVITY
    result: dict[str, Any] = {
        "speed": speed,
        "froude": froude_of(speed, height),
        "fell": float(1 - played.upright.mean()),
    }
    if not played.upright.any():
        return result
    return result | _from_sums(played, kilograms, height) | _from_stances(played, kilograms)


def froude_of(speed: float, height: float) -> float:
    """Return the Froude number [-] of a speed [m/s] at a height of the hips [m]."""
    return speed**2 / (GRAVITY * height)


def _from_sums(played: Played, kilograms: float, height: float) -> dict[str, float]:
    """Return the figures that the engine's sums give, over upright episodes of an animal with its hips at
    `height` [m] and a mass of `kilograms`."""
    upright = played.upright
    travelled = played.travelled[played.upright]
    figures = stance_figures(played.sums, played.seconds, played.turns)
    pairs = {
        name: np.nanmean(values.reshape(2, 2, -1)[..., upright], axis=(1, 2))
        for name, values in figures.items()
    }
    result: dict[str, float] = {}
    # Forces by the mass of the animal, which makes sizes comparable
    for k, pair in enumerate(PAIRS):
        for name, of in (("peak", "peak"), ("mean", "mean"), *((f"mean_{x}", x) for x in HORIZONTAL)):
            result[f"{name}_{pair}"] = float(pairs[of][k]) / kilograms
        for name in ("duty", "slip", "stances_per_turn"):
            result[f"{name}_{pair}"] = float(pairs[name][k])
        result[f"peak_over_mean_{pair}"] = result[f"peak_{pair}"] / result[f"mean_{pair}"]
        legs = slice(2 * k, 2 * k + 2)
        total = {name: played.sums[name][legs][:, upright].sum(0) for name in NEEDED}
        result[f"loading_{pair}"] = _mean(total["loading_rate_increase"] / total["stances"]) / kilograms
        net = total["propulsion"] - total["braking"]
        result[f"net_{pair}"] = _mean(net) / played.seconds / kilograms
    impulse = played.sums["normal_impulse"][:, upright].reshape(2, -1).sum(1)
    work = played.sums["positive_work"][:, upright].sum(0)
    reached = float(travelled.mean() / played.seconds)
    return result | {
        "reached": reached,
        "froude_reached": froude_of(reached, height),
        "stride_over_hip": float(np.mean(travelled / played.turns.mean(0)[upright]) / height),
        "impulse_fore": float(impulse[0] / impulse.sum()),
        "transport": float(np.mean(work / (kilograms * GRAVITY * travelled))),
    }


def _from_stances(played: Played, kilograms: float) -> dict[str, Any]:
    """Return the figures that need the forces at every substep, over watched episodes that are upright; NaN
    if there are none."""
    # Mean duration of a stride: turns of the cranks are strides
    period = played.seconds / float(played.turns.mean(0)[played.upright].mean())
    lift_off = LIFT_OFF * kilograms * GRAVITY / len(LEGS)
    stances = []
    lags = []
    depths = []
    footfall: list[list[float]] = []
    for env, records in enumerate(played.watched):
        if not played.upright[env]:
            continue
        time, forces, pushes = forces_of(records)
        of_episode = stances_of(time, forces, pushes, lift_off)
        stances += of_episode
        lags.append(lag_of(of_episode, period))
        if DEPTHS[0] in records[0]:
            depths.append(np.max([record[name].max(0) for record in records for name in DEPTHS], axis=0))
        # Of the first upright episode
        footfall = footfall or footfall_of(of_episode, time[-1], 2 * period)
    of_pairs = {pair: [stance for stance in stances if stance.leg // 2 == k] for k, pair in enumerate(PAIRS)}
    result: dict[str, Any] = {
        "lag": mean_lag(lags) if lags else float("nan"),
        "footfall": footfall,
        "curves": {
            pair: curve_of([stance.force for stance in of_pair], kilograms)
            for pair, of_pair in of_pairs.items()
        },
        "pushes": {
            pair: curve_of([stance.push for stance in of_pair], kilograms)
            for pair, of_pair in of_pairs.items()
        },
    }
    for pair, of_pair in of_pairs.items():
        k = PAIRS.index(pair)
        result[f"depth_{pair}"] = _mean([depth[2 * k : 2 * k + 2].mean() for depth in depths])
        result[f"two_peaked_{pair}"] = _mean([stance.is_two_peaked for stance in of_pair])
        for name in HORIZONTAL:
            peaks = [getattr(stance, f"peak_{name}") for stance in of_pair]
            result[f"peak_{name}_{pair}"] = _mean(peaks) / kilograms
    return result


def _mean(values: Any) -> float:
    """Return the mean, NaN without values."""
    return float(np.mean(values)) if len(values) else float("nan")


def footfall_of(stances: list[Stance], end: float, span: float) -> list[list[float]]:
    """Return leg, begin and end [s] of the stances in the last `span` [s] of a record that ends at `end`
    [s]."""
    begin = end - span
    return [
        [stance.leg, round(max(stance.began - begin, 0.0), 4), round(stance.ended - begin, 4)]
        for stance in stances
        if stance.ended > begin
    ]


def mean_lag(lags: list[float]) -> float:
    """Return the circular mean of lags within half a stride, which counts as a whole turn."""
    return float(np.angle(np.nanmean(np.exp(4j * np.pi * np.array(lags)))) / (4 * np.pi) % 0.5)


def forces_of(records: list[dict[str, Floats]]) -> tuple[Floats, Floats, Floats]:
    """Return times, shape (n,), and normal and horizontal forces of the legs, shape (n, 4), of consecutive
    records."""
    time, toe, heel, toe_push, heel_push = (
        np.concatenate([record[name] for record in records]) for name in ("time", *FORCES)
    )
    return time.ravel(), (toe + heel)[..., 0], (toe_push + heel_push)[..., 0]


def curve_of(forces: list[Floats], mass: float) -> list[float]:
    """Return the mean [N/kg] of the forces of stances [N] at each hundredth of a stance."""
    grid = np.linspace(0, 1, 101)
    curves = [np.interp(grid, np.linspace(0, 1, len(force)), force) for force in forces]
    return [round(float(x), 4) for x in np.mean(curves, 0) / mass] if curves else []

"""What a hoof does when it meets the ground: episodes substep by substep, their stances, figures and curves.

A stance lasts while the normal force is above 5 % of the weight, as on a force plate; it begins with the
touch-down. The first seconds of an episode, in which a gait settles, are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.evaluate import find_policy
from hoof_env.dynamics.trunk_model import LIFT_OFF
from hoof_env.gait.parameters import PARAMETERS

Floats = NDArray[np.float64]

SETTLED = 3.0
"""Seconds of an episode that are left out."""

WINDOW = 0.005
"""The loading rate is the steepest rise of the force over so many seconds."""

AROUND = (-0.06, 0.26)
"""Seconds around touch-down that curves show."""

TOUCH_DOWN: Mapping[str, tuple[str, float]] = {
    "crank_down": ("crank speed at touch-down rad/s", 1.0),
    "crank_stance": ("through the stance, mean rad/s", 1.0),
    "crank_lowest": ("lowest rad/s", 1.0),
    "crank_highest": ("highest rad/s", 1.0),
    "hoof_angle": ("hoof angle at touch-down °", 180 / np.pi),
    "approach": ("approach speed m/s", 1.0),
    "slide": ("slide of the hoof at touch-down m/s", 1.0),
    "loading_rate": ("loading rate kN/s", 1e-3),
    "to_peak": ("time to peak ms", 1e3),
    "peak": ("peak kN", 1e-3),
    "duration": ("stance ms", 1e3),
}
"""Figures of a stance: title and factor for people. The hoof angle is 0 where the sole lies flat and positive
where the heel is higher; approach is the speed into the ground of the part of the hoof that bears more at
touch-down, when it entered; the slide is its speed along the ground, forward positive."""


@dataclass(frozen=True)
class Episode:
    """The settled part of an episode.

    Attributes:
        record: state and report of the engine at each substep by name, shape (substeps,).
        weight: of trunk and leg [N].
        dt: substep [s].
        failed: whether it ended by failure; it may be short, or empty, then.
    """

    record: Mapping[str, Floats]
    weight: float
    dt: float
    failed: bool

    @cached_property
    def normal(self) -> Floats:
        """Normal force on the hoof [N]."""
        return self.record["toe_normal"] + self.record["heel_normal"]

    @cached_property
    def grf(self) -> Floats:
        """Resultant ground reaction force [N]."""
        return np.hypot(self.normal, self.record["toe_friction"] + self.record["heel_friction"])

    @cached_property
    def hoof_angle(self) -> Floats:
        """Of the sole to the ground, heel up positive [rad]."""
        r = self.record
        return np.arctan2(r["heel_y"] - r["toe_y"], r["toe_x"] - r["heel_x"])

    @cached_property
    def stances(self) -> NDArray[np.int64]:
        """First substep of each whole stance and the first after it, shape (stances, 2)."""
        loaded = np.concatenate([[True], self.normal > LIFT_OFF * self.weight, [True]])
        down, up = (np.flatnonzero(np.diff(loaded.astype(int)) == sign) for sign in (1, -1))
        return np.stack([down[:-1], up[1:]], 1) if len(down) > 1 else np.zeros((0, 2), np.int64)

    def per_stance(self) -> dict[str, Floats]:
        """`TOUCH_DOWN` of each stance in SI units, shape (stances,)."""
        found = [self._of_stance(int(first), int(end)) for first, end in self.stances]
        return {name: np.array([one[name] for one in found]) for name in TOUCH_DOWN}

    def _of_stance(self, first: int, end: int) -> dict[str, float]:
        r, crank = self.record, self.record["theta_rate"][first:end]
        part = "toe" if r["toe_normal"][first] >= r["heel_normal"][first] else "heel"
        slowness = r[f"{part}_slowness"][first]
        top = first + int(np.argmax(self.grf[first:end]))
        return {
            "crank_down": crank[0],
            "crank_stance": crank.mean(),
            "crank_lowest": crank.min(),
            "crank_highest": crank.max(),
            "hoof_angle": self.hoof_angle[first],
            "approach": 1 / slowness if slowness > 0 else r[f"{part}_rate"][first],
            "slide": r[f"{part}_slide"][first],
            "loading_rate": steepest(self.normal[max(first - 1, 0) : top + 1], self.dt),
            "to_peak": (top - first) * self.dt,
            "peak": self.grf[top],
            "duration": (end - first) * self.dt,
        }

    def figures(self) -> dict[str, float]:
        """`GAIT` of the settled part and the means of `TOUCH_DOWN` over its stances, in SI units; NaN where
        there is no stance, no swing or no way forward."""
        r = self.record
        loaded = self.normal > LIFT_OFF * self.weight
        seconds = self.dt * len(loaded)
        far = r["x"][-1] - r["x"][0]
        work = self.dt * float(sum(np.maximum(r[f"{name}_power"], 0).sum() for name in ("crank", "hip")))
        crank = r["theta_rate"]
        found = {
            "speed": far / seconds,
            "crank_speed": crank.mean(),
            "crank_swing": _mean(crank[~loaded]),
            **{name: r[name].mean() for name in PARAMETERS[1:]},
            "swing_amplitude": np.hypot(r["swing_sin"], r["swing_cos"]).mean(),
            "stances": len(self.stances) / seconds,
            "duty_factor": loaded.mean(),
            "weight_share": self.normal.mean() / self.weight,
            "highest": self.grf.max(),
            "cost_of_transport": work / (self.weight * far) if far > 0 else np.nan,
        }
        means = {name: _mean(values) for name, values in self.per_stance().items()}
        return {name: float(value) for name, value in (found | means).items()}

    def curves(self) -> dict[str, Floats]:
        """What a picture shows around each touch-down that is far enough from the ends, shape (stances,
        instants)."""
        low, high = (round(edge / self.dt) for edge in AROUND)
        seen = [int(k) for k in self.stances[:, 0] if k + low >= 0 and k + high < len(self.normal)]
        place = np.array(seen, int)[:, None] + np.arange(low, high + 1)
        r = self.record
        shown = {
            "crank_speed": r["theta_rate"],
            "hoof_angle": np.degrees(self.hoof_angle),
            "height": 100 * np.minimum(r["toe_y"], r["heel_y"]),
            "force": self.normal / self.weight,
        }
        return {name: values[place] for name, values in shown.items()}


GAIT: Mapping[str, tuple[str, float]] = {
    "speed": ("speed m/s", 1.0),
    "crank_speed": ("crank speed rad/s", 1.0),
    "crank_stance": ("in stance rad/s", 1.0),
    "crank_swing": ("in swing rad/s", 1.0),
    "swing_offset": ("swing offset rad", 1.0),
    "swing_sin": ("swing sine rad", 1.0),
    "swing_cos": ("swing cosine rad", 1.0),
    "stances": ("stances 1/s", 1.0),
    "duty_factor": ("duty factor", 1.0),
    "peak": ("stance peak kN", 1e-3),
    "highest": ("highest kN", 1e-3),
    "loading_rate": ("loading rate kN/s", 1e-3),
    "hoof_angle": ("hoof angle °", 180 / np.pi),
    "approach": ("approach m/s", 1.0),
    "cost_of_transport": ("cost of transport", 1.0),
    "weight_share": ("weight share", 1.0),
}
"""Figures of a gait that tables show: title and factor."""


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else float("nan")


def steepest(force: Floats, dt: float) -> float:
    """Steepest rise of a force over `WINDOW` [N/s], over all of it where it is shorter.

    Args:
        force: shape (n,), `dt` [s] apart.
        dt: see there.
    """
    width = min(max(1, round(WINDOW / dt)), len(force) - 1)
    return float((force[width:] - force[:-width]).max() / (width * dt)) if width > 0 else 0.0


def watch(
    policy: Any,
    env_id: str,
    seeds: Sequence[int],
    tick: Callable[[], Any] = lambda: None,
    **env_kwargs: Any,
) -> list[Episode]:
    """Play an episode for each seed and keep its substeps.

    Args:
        policy: anything with Stable-Baselines3's `predict`, or a name or path as `agents.evaluate` takes it.
        env_id: registered environment.
        seeds: of the episodes.
        tick: called after each.
        env_kwargs: arguments of the environment; they may differ from those of the policy's training.

    Raises:
        ParameterError, DataFileError: unknown environment or policy, or one that does not fit.
    """
    episodes = []
    with runs.make_env(env_id, **env_kwargs) as env:
        leg: Any = env.unwrapped
        if isinstance(policy, str):
            policy = find_anyway(policy, env, env_id)
        for seed in seeds:
            observation, _ = env.reset(seed=seed)
            rows, start, failed, done = [leg.record()], np.ones(1, bool), False, False
            while not done:
                action, _ = policy.predict(observation, episode_start=start, deterministic=True)
                observation, _, failed, truncated, _ = env.step(action)
                rows.append(leg.record())
                start, done = np.zeros(1, bool), failed or truncated
            whole = {name: np.concatenate([row[name] for row in rows]).reshape(-1) for name in rows[0]}
            late = whole["time"] > min(SETTLED, 0.5 * leg.settings.episode_seconds)
            record = {name: values[late] for name, values in whole.items()}
            episodes.append(Episode(record, leg.weight, leg.sim_dt, failed))
            tick()
    return episodes


def find_anyway(name: str, env: Any, env_id: str) -> Any:
    """A policy that may have been trained with other arguments of the environment, which is not told."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return find_policy(name, env, env_id)


def mean_figures(episodes: Sequence[Episode]) -> dict[str, float]:
    """Means of `Episode.figures` over episodes that did not fail, leaving out what is not known of one; and
    "failed", the share of those that did."""
    each = [one.figures() for one in episodes if not one.failed]
    names = each[0] if each else dict.fromkeys((*GAIT, *TOUCH_DOWN))
    columns = {name: np.array([one[name] for one in each], float) for name in names}
    found = {name: _mean(column[np.isfinite(column)]) for name, column in columns.items()}
    return found | {"failed": 1 - len(each) / len(episodes)}

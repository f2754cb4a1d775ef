"""Horses that play candidates of a search, and measure figures from what every control step reports.

`agents.gait_figures` measures the same from every substep, a gait at a time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.layout import Features, stride_sums
from hoof_env.dynamics.observables import stance_figures
from hoof_env.evaluation.episodes import make_rows
from hoof_env.simd.threads import limit_threads
from hoof_env.tasks.horse_gaits import LEGS, PAIRS

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/Horse-v0"
SECONDS = 6.0
SETTLED = 2.0
"""Length of an episode and the time after which figures count [s]."""
BINS = 32  # of a turn of the crank, in which the force of a pair is averaged


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
        env_id: id of their environment.
        **settings: its arguments.
    """

    def __init__(self, num_envs: int, env_id: str = ENV_ID, **settings: Any) -> None:
        envs: Any = make_rows(env_id, num_envs, **{"num_threads": limit_threads(2), **settings})
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
        policy: Any = None,
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
            policy: acts in place of them around the environment's own gaits, which `gaits` then repeats.

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
        options = {"target_speed": speed} | ({"gait": rows} if policy is None else {})
        seen, _ = envs.reset(seed=[seed + k % starts for k in range(n)], options=options)
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
            if policy is not None:
                acted = np.asarray(policy.predict(seen, deterministic=True)[0], np.float32)
            seen, rewards, failed, _, infos = envs.step(acted)
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

"""Runs of the plain horse, as exact as it gets: an adaptive eighth-order scheme that stops at every touch.

Between touches the equations are smooth but for the corners of friction, servo and a ground that does not
pull, where the step shrinks by itself. A hoof point's approach speed is its speed at the touch-down itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError
from hoof_env.gait import SPEED, GaitParameters
from tests.oracle.horse import WORKS

Array = NDArray[np.generic]


@dataclass(frozen=True)
class Touch:
    """A hoof point that enters the ground or leaves it: when [s], which, and how fast it came in [m/s]."""

    t: float
    point: int
    down: bool
    approach: float


@dataclass(frozen=True)
class Run:
    """A horse at K times."""

    t: Array  # (K,) [s]
    trunk: Array  # x, y, pitch, (K, 3) [m, rad]
    trunk_rate: Array
    theta: Array  # of each crank, (K, N) [rad]
    theta_rate: Array
    work: dict[str, Array]  # since the start, of each of `WORKS`, (K,) each [J]
    approach: Array  # v0 of each hoof point in the ground at each time, else NaN, (K, N, 2) [m/s]
    touches: list[Touch]  # in order; point 2 i is the toe of leg i, 2 i + 1 its heel


def follow(rate, depth, state, times, floor, tolerance=1e-12, longest=5e-3):
    """Integrate from `times[0]`, stopping where any of P points crosses the ground.

    Args:
        rate: the state's, of the state and the points' approach speeds, NaN outside the ground.
        depth: penetration [m] and its rate [m/s] of each point, shape (P,), of the state.
        state: at the start; a point in the ground has entered it at its present rate.
        times: increasing, shape (K,) [s].
        floor: of the approach speed [m/s].
        tolerance: relative and absolute.
        longest: bound on a step [s], so that no brief touch is missed.

    Returns:
        States, shape (K, ...), approach speeds, shape (K, P), and the touches.
    """
    from scipy.integrate import solve_ivp

    def crossing(point, inside):
        def event(_, y):
            return float(depth(y)[0][point])

        event.terminal, event.direction = True, -1.0 if inside else 1.0
        return event

    times = np.asarray(times, float)
    now, y, touches = times[0], np.asarray(state, float), []
    into, speed = depth(y)
    approach = np.where(into > 0, np.maximum(speed, floor), np.nan)
    states, speeds = np.empty((len(times), len(y))), np.empty((len(times), len(into)))
    states[0], speeds[0], done = y, approach, 1
    while done < len(times):
        events = [crossing(k, not np.isnan(v0)) for k, v0 in enumerate(approach)]
        part = solve_ivp(
            lambda _, y, v0=approach: rate(y, v0), (now, times[-1]), y, "DOP853", times[done:],
            events=events, rtol=tolerance, atol=tolerance, max_step=longest,
        )  # fmt: skip
        if part.status < 0:
            raise HoofEnvError(f"no step is short enough after t = {now:g} s: {part.message}")
        count = len(part.t)
        if count:
            states[done : done + count], speeds[done : done + count] = part.y.T, approach
        done += count
        if part.status == 0:
            break
        point = next(k for k, found in enumerate(part.t_events) if len(found))
        now, y = float(part.t_events[point][0]), part.y_events[point][0]
        down = bool(np.isnan(approach[point]))
        approach = approach.copy()
        approach[point] = max(float(depth(y)[1][point]), floor) if down else np.nan
        touches.append(Touch(now, point, down, float(approach[point])))
    return states, speeds, touches


def depths(ground, at, velocity):
    """Penetration [m] and its rate [m/s] of points, shape (P,); far from ground where there is none."""
    if ground is None:
        return np.full(at.shape, -1.0), np.zeros(at.shape)
    found = np.array([ground.depth(complex(z), complex(v)) for z, v in zip(at, velocity, strict=True)])
    return found[:, 0], found[:, 1]


def simulate(horse, gaits, times, theta, theta_rate=None, trunk=None, trunk_rate=(0.0, 0.0, 0.0)):
    """A horse under steady gaits, one for each leg, at times of which the first is the start.

    A `theta_rate` of None is the gait's, as it always is with a prescribed crank; `trunk` is x, y and
    pitch at the start, None (0, trunk height, 0).
    """
    n = horse.size
    gaits = np.array([g.to_array() if isinstance(g, GaitParameters) else g for g in gaits], float)
    wanted = gaits[:, SPEED]
    theta_rate = np.where(horse.motors, wanted if theta_rate is None else theta_rate, wanted)
    trunk = (0.0, horse.trunk.height, 0.0) if trunk is None else trunk

    def split(y):
        return y[:3], y[3:6], y[6 : 6 + n], y[6 + n : 6 + 2 * n]

    def rate(y, approach):
        x, v, angle, w = split(y)
        now = horse.at(x, v, angle, w, gaits, approach.reshape(n, 2))
        return np.concatenate([v, now.trunk_acc, w, now.theta_acc, [now.power[name] for name in WORKS]])

    def depth(y):
        x, v, angle, w = split(y)
        at, velocity = horse.hooves(x, v, angle, w, gaits)
        return depths(horse.ground, at.ravel(), velocity.ravel())

    start = np.concatenate([trunk, trunk_rate, theta, theta_rate, np.zeros(len(WORKS))])
    floor = horse.ground.ground.approach_floor if horse.ground else np.inf
    y, approach, touches = follow(rate, depth, start, times, floor)
    parts = split(y.T)
    work = dict(zip(WORKS, y.T[6 + 2 * n :], strict=True))
    return Run(np.asarray(times, float), parts[0].T, parts[1].T, parts[2].T, parts[3].T, work,
               approach.reshape(-1, n, 2), touches)  # fmt: skip

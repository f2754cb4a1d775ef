"""A horse's strokes (docs/evidence/README.md), driven through the engine and its command filters: a stance
that is level, at a constant speed, and a swing that clears the ground."""

import json
from pathlib import Path

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, Trunk
from hoof_env.gait import QUICK, HarmonicGait
from hoof_env.leg.geometry import load_geometry
from tests.legs import FIRST_FIT

HIP_HEIGHT, HIGH, TURN = 1.4, 10.0, 2 * np.pi  # of the horse; of O in the test, away from the ground [m]
GAITS = json.loads(Path(__file__).with_name("data").joinpath("strokes.json").read_text(encoding="utf-8"))
LEAD = 1 / (5 * QUICK.gain) + 5e-4  # how long the filter's rate takes [s]
PULL = 60.0  # of what is missing on the command [1/s]


def chosen(case):
    """Two harmonics, but for the one case where the crank leaves no time: the long stroke of a walk."""
    hard = (case["leg"], case["stroke"], case["froude"]) == ("identified", 1.09, 0.25)
    return case["harmonics"] == (3 if hard else 2)


def crank_speed(case):
    """The crank's speed as a function of its angle, and its acceleration [rad/s, rad/s^2]."""
    grid, squares = np.linspace(0, TURN, 129), np.square(case["crank_speed_rad_s"])
    squares = np.append(squares, squares[0])

    def speed(theta):
        return np.sqrt(np.interp(theta % TURN, grid, squares))

    return speed, lambda theta: (speed(theta + 0.02) ** 2 - speed(theta - 0.02) ** 2) / 0.08


def drive(case):
    """Rows of the second turn, each millisecond: angle from touch-down, lowest point of the hoof and its
    speed relative to the hip, crank acceleration, swing rate."""
    geometry = load_geometry(FIRST_FIT if case["leg"] == "first_fit" else "identified")
    geometry = geometry.scaled(HIP_HEIGHT / geometry.hip_height)
    offset, sine, cosine, *higher = case["coefficients"].values()
    harmonics, (speed, acceleration) = case["harmonics"], crank_speed(case)
    start = case["stance_start_rad"] - 1.0
    gait = HarmonicGait(speed(start), offset, sine, cosine, tuple(higher[: 2 * harmonics - 2]))
    engine = TrunkEngine(
        Limb(geometry, drive=Prescribed()), Trunk("fixed", height=HIGH), harmonics=harmonics, filters=QUICK
    )
    engine.reset(gait, start)
    command, rows, theta = gait.to_array(), [], start
    while theta < start + 2 * TURN:
        now, ahead = engine.state, theta
        for _ in range(10):
            ahead += LEAD / 10 * speed(ahead)
        value, rate = now["crank_speed"][0, 0], now["crank_speed_rate"][0, 0]
        wanted = acceleration(ahead) + PULL * (speed(ahead) - value - rate * LEAD)
        command[0] = value + wanted / QUICK.gain
        engine.advance(command)
        s, r = engine.state, engine.report
        theta, low = s["crank_angle"][0, 0], "toe" if r["toe_y"][0, 0] < r["heel_y"][0, 0] else "heel"
        height, slide = r[f"{low}_y"][0, 0] - HIGH, r[f"{low}_slide"][0, 0]
        rows.append([theta, height, slide, s["crank_speed_rate"][0, 0], r["swing_angle_rate"][0, 0]])
    rows = np.array(rows)[np.array(rows)[:, 0] > start + TURN]
    rows[:, 0] = (rows[:, 0] - case["stance_start_rad"]) % TURN
    return rows.T


@pytest.mark.parametrize(
    "case", [*filter(chosen, GAITS)], ids=lambda c: f"{c['leg']}-{c['stroke']}-{c['froude']}-{c['harmonics']}"
)
def test_a_stroke_is_level_and_even_and_the_swing_is_clear(case):
    """The bars of the study: 3 cm peak to peak, 5 %, 3 cm; with 100 rad/s^2 and 15 rad/s."""
    angle, height, slide, acceleration, swing_rate = drive(case)
    stance = angle < case["stance_angle_rad"]
    assert np.ptp(height[stance]) < 0.03
    assert np.abs(slide[stance] / np.sqrt(case["froude"] * GRAVITY * HIP_HEIGHT) + 1).max() < 0.05
    assert height[~stance].max() > height[stance].max() + 0.03
    assert height[~stance].min() > height[stance].min()
    assert np.abs(acceleration).max() <= 100 * (1 + 1e-9)
    assert np.abs(swing_rate).max() < 15.0


def test_one_harmonic_is_not_level():
    for case in GAITS:
        if case["harmonics"] == 1:
            offset, a, b, *_ = case["coefficients"].values()
            gait = HarmonicGait(6.0, offset, a, b)
            assert gait.higher == (0.0, 0.0)
            angle, height, *_ = drive({**case, "harmonics": 2})
            assert np.ptp(height[angle < case["stance_angle_rad"]]) > 0.03

"""Commands, starts, the manual page, and the errors of the environments."""

from __future__ import annotations

import re

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import Trunk
from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.envs.horse_leg_fixed import HorseLegFixedEnv
from hoof_env.envs.observation import MIDDLE
from hoof_env.envs.policies import make_policy, policy_names
from hoof_env.envs.reward import RewardWeights
from hoof_env.errors import ParameterError
from hoof_env.gait.parameters import LIMITS, GaitParameters, load_gait
from hoof_env.ground.contact import Ground

LEG, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"


def traces(env, action):
    rows, done = [], False
    while not done:
        *_, terminated, truncated, _ = env.step(action)
        rows.append(env.unwrapped.trace)
        done = terminated or truncated
    return np.concatenate(rows)


def test_commands_span_the_limits_and_contain_both_gaits():
    env = gym.make(LEG).unwrapped
    low, high = np.array(list(LIMITS.values())).T
    np.testing.assert_allclose(env.command_of(-np.ones(4, np.float32)), low)
    np.testing.assert_allclose(env.command_of(np.ones(4, np.float32)), high)
    for name in ("walk", "run"):
        gait = load_gait(name, "first_fit")
        np.testing.assert_allclose(env.command_of(env.action_for(gait)), gait.to_array(), atol=1e-6)
        assert np.abs(env.action_for(gait)).max() < 1


@pytest.mark.parametrize("name", ["walk", "run"])
def test_zero_action_on_the_fixed_trunk_is_the_gait_to_the_bit(name):
    env = gym.make(FIXED, gait=name, preset="first_fit")
    env.reset(seed=0)
    seen = traces(env, np.zeros(4, np.float32))
    gait, leg = load_gait(name, "first_fit"), env.unwrapped.geometry
    engine = LegEngine(leg, Trunk(kind="fixed", height=leg.hip_height), Ground(), 1e-4)
    engine.reset(gait)
    expected = new_trace(10_000)
    engine.advance(gait.to_array(), expected)
    for field in seen.dtype.names:
        if field != "t":  # summed by control steps
            np.testing.assert_array_equal(seen[field], expected[field])
    np.testing.assert_allclose(seen["t"], expected["t"], atol=1e-12)


@pytest.mark.parametrize("name", ["walk", "run"])
@pytest.mark.parametrize("restitution", [1.0, 0.0])
def test_constant_action_elsewhere_agrees_with_the_reproduction(name, restitution):
    fixed = gym.make(FIXED, gait=name, preset="first_fit", restitution=restitution)
    fixed.reset(seed=0)
    paper = traces(fixed, np.zeros(4, np.float32))
    leg = gym.make(
        LEG,
        trunk="fixed",
        restitution=restitution,
        approach_floor=1e-4,
        friction_fast=1e-2,
        sim_dt=1e-4,
        episode_seconds=1.0,
    )
    leg.reset(seed=0, options={"gait": name, "crank_angle": 0.0})
    other = traces(leg, leg.unwrapped.action_for(load_gait(name, "first_fit")))
    for field in ("normal", "grf", "crank_torque", "hip_torque"):
        scale = np.abs(paper[field]).max()
        assert np.abs(other[field] - paper[field]).max() < 1e-5 * scale


def test_reset_options_set_the_start():
    env = gym.make(LEG)
    gait = {"crank_speed": 5.0, "swing_offset": 0.5, "swing_sin": -0.1, "swing_cos": 0.1}
    _, info = env.reset(seed=0, options={"gait": gait, "crank_angle": 1.0, "speed": 0.5, "height": 2.0})
    row = env.unwrapped.trace[-1]
    assert (row["theta"], row["trunk_y"], info["gait"]["swing_offset"]) == (1.0, pytest.approx(2.0), 0.5)
    assert row["trunk_vx"] == pytest.approx(0.5)
    assert row["theta_rate"] == 5.0


@pytest.mark.parametrize("trunk", ["suspended", "rail", "fixed"])
def test_starts_are_in_the_air(trunk):
    env = gym.make(LEG, trunk=trunk)
    for seed in range(40):
        env.reset(seed=seed)
        row = env.unwrapped.trace[-1]
        assert max(row["toe_penetration"], row["heel_penetration"]) <= 1e-12


def test_without_friction_and_drag_nothing_pushes_the_animal():
    env = gym.make(LEG, friction=0.0, trunk_drag=0.0)
    env.reset(seed=0, options={"gait": "run", "speed": 0.0})
    momentum = float(env.unwrapped.engine.state.body["px"])
    trace = traces(env, env.unwrapped.action_for(load_gait("run", "first_fit")))
    assert trace["normal"].max() > 1000
    assert env.unwrapped.engine.state.body["px"] == pytest.approx(momentum, abs=1e-9)


def test_episodes_with_different_substeps_agree():
    speeds = []
    for sim_dt in (1e-3, 2.5e-4):
        env = gym.make(LEG, sim_dt=sim_dt, episode_seconds=4.0)
        env.reset(seed=0, options={"gait": "run", "crank_angle": 0.0, "speed": 0.0, "height": 2.0})
        speeds.append(traces(env, env.unwrapped.action_for(load_gait("run", "first_fit")))["trunk_x"][-1] / 4)
    assert speeds[0] == pytest.approx(speeds[1], rel=0.02)


def speed_and_peaks(gait, **kwargs):
    env = gym.make(LEG, **kwargs)
    env.reset(seed=0, options={"gait": gait, "crank_angle": 0.0, "speed": 0.0})
    trace = traces(env, env.unwrapped.action_for(gait))
    return trace["trunk_x"][-1] / 10, trace["grf"].max()


def test_the_middle_of_the_ranges_moves_forward_and_no_swing_backward():
    """As docs/environment.md says of the ranges."""
    middle = GaitParameters.from_array(MIDDLE)
    assert speed_and_peaks(middle)[0] > 0.5
    assert speed_and_peaks(GaitParameters(2 * np.pi, 0.7, 0.0, 0.0))[0] < -2.0


@pytest.mark.parametrize(
    "change", [{"approach_floor": 1e-4}, {"friction_fast": 1e-2}, {"sim_dt": 1e-4}], ids=str
)
def test_assumed_contact_settings_hardly_matter_to_the_run(change):
    """As docs/environment.md says of floor, friction threshold and substep."""
    run = load_gait("run", "first_fit")
    assert speed_and_peaks(run, **change) == pytest.approx(speed_and_peaks(run), rel=0.01)


def table(docstring, heading):
    """Rows of the first table under a heading of a manual page."""
    part = docstring.split(f"## {heading}", 1)[1].split("##", 1)[0]
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")]
        for line in part.splitlines()
        if "|" in line
    ]
    return [row for row in rows if not re.fullmatch(r"-+", row[0])]


def test_manual_page_matches_the_spaces():
    env = gym.make(LEG).unwrapped
    rows = table(HorseLegEnv.__doc__, "Observation space")[1:]
    assert tuple(row[1] for row in rows) == env.observation_names
    assert [int(row[0]) for row in rows] == list(range(env.observation_space.shape[0]))
    assert f"({env.observation_space.shape[0]},)" in HorseLegEnv.__doc__
    fixed = gym.make(FIXED).unwrapped
    assert f"({fixed.observation_space.shape[0]},)" in HorseLegFixedEnv.__doc__
    for row, (low, high) in zip(table(HorseLegEnv.__doc__, "Action space")[1:], LIMITS.values(), strict=True):
        assert float(row[2]) == pytest.approx(low)
        assert float(row[3].split()[0]) == pytest.approx(high, rel=1e-4)
    for row, (low, high) in zip(
        table(HorseLegFixedEnv.__doc__, "Action space")[1:], LIMITS.values(), strict=True
    ):
        assert float(row[3]) == pytest.approx((high - low) / 2, rel=1e-3)
        assert float(row[2]) == -float(row[3])


def test_manual_page_matches_weights_and_defaults():
    weights = RewardWeights()
    for row in table(HorseLegEnv.__doc__, "Rewards")[1:]:
        name, value = re.match(r"`(\w+)` = ([\d.]+)", row[1]).groups()
        assert getattr(weights, name) == float(value)
    defaults = HorseLegEnv.__init__.__kwdefaults__
    listed = set()
    for row in table(HorseLegEnv.__doc__, "Arguments")[1:]:
        names = re.findall(r"`(\w+)`", row[0])
        values = [value.strip().strip('"') for value in row[1].split(",")]
        for name, value in zip(names, values, strict=True):
            listed.add(name)
            default = defaults[name]
            assert str(default) == value or float(default) == float(value), name
    assert listed == set(defaults)


def test_policies_have_names_and_do_what_they_say():
    env = gym.make(LEG)
    assert policy_names(env) == ["run", "walk", "idle", "random", "bang-bang", "drag", "airborne"]
    duty = {}
    for name in ("drag", "airborne", "idle"):
        observation, _ = env.reset(seed=1)
        policy, done = make_policy(name, env), False
        while not done:
            observation, _, terminated, truncated, info = env.step(policy.predict(observation)[0])
            done = terminated or truncated
        duty[name] = info["episode_summary"]["duty_factor"]
    assert duty["drag"] > 0.9
    assert duty["airborne"] < 0.5
    with pytest.raises(ParameterError, match=r"expected one of.*walk.*got 'gallop'"):
        make_policy("gallop", env)


BAD = [
    ({"preset": "no_such_leg"}, "preset: expected one of first_fit, identified, got 'no_such_leg'"),
    ({"trunk": "floating"}, "trunk: expected one of fixed, rail, suspended, got 'floating'"),
    ({"normal_law": "hertz"}, "normal_law: expected one of .*lankarani-nikravesh.*got 'hertz'"),
    ({"friction_law": "stick"}, "friction_law: expected one of ambrosio.*got 'stick'"),
    ({"render_mode": "ansi"}, "render_mode: expected one of human, rgb_array, got 'ansi'"),
    ({"dt": 0.0205}, "dt: expected a whole multiple of sim_dt = 0.001 s, got 0.0205 s"),
    ({"dt": 0.0005}, "dt: expected a whole multiple"),
    ({"dt": 1e300, "sim_dt": 1e-300}, "dt: expected.* got 1e.300 s .ratio inf; at most 100000"),
    ({"sim_dt": 0.0}, "sim_dt: expected"),
    ({"dt": float("nan")}, "dt: expected.*got nan"),
    ({"trunk_mass": -80.0}, "trunk_mass: expected.*got -80.0"),
    ({"trunk_mass": "heavy"}, "trunk_mass: expected.*got 'heavy'"),
    ({"trunk_share": 1.5}, "trunk_share: expected.*got 1.5"),
    ({"trunk_stiffness": -1.0}, "trunk_stiffness: expected.*got -1.0"),
    ({"hip_height": 0.0}, "height: expected.*got 0.0"),
    ({"stiffness": float("inf")}, "stiffness: expected.*got inf"),
    ({"restitution": 1.1}, "restitution: expected.*got 1.1"),
    (
        {"restitution": 0.0, "normal_law": "flores"},
        "restitution: expected a number in .0.01, 1. for 'flores'",
    ),
    ({"exponent": 0.0}, "exponent: expected.*got 0.0"),
    ({"friction": -0.1}, "friction: expected.*got -0.1"),
    ({"friction_fast": 1e-4}, "friction_fast: expected more than friction_slow"),
    ({"episode_seconds": -1.0}, "episode_seconds: expected.*got -1.0"),
    ({"episode_seconds": 1e308}, "episode_seconds: expected.*got 1e.308"),
    ({"episode_seconds": 10.0, "dt": 20.0}, r"episode_seconds: expected.*\[20, .*got 10.0"),
    ({"reward_weights": {"speed": 1.0}}, "reward_weights: expected a mapping with some of progress.*got"),
    ({"reward_weights": {"peak": float("nan")}}, "reward_weights.'peak'.: expected.*got nan"),
    ({"reward_weights": 3}, "reward_weights: expected a mapping"),
]


@pytest.mark.parametrize(("kwargs", "message"), BAD, ids=[str(sorted(k.items())) for k, _ in BAD])
def test_bad_arguments_say_what_came_and_what_was_expected(kwargs, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(LEG, **kwargs)


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"gait": "trot"}, "gait: expected one of carrying_walk, run, walk, got 'trot'"),
        ({"solver": "fast"}, "solver: expected one of exact, paper, got 'fast'"),
    ],
)
def test_bad_gait_and_solver(kwargs, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(FIXED, **kwargs)


def test_unknown_id_names_the_known_ones():
    with pytest.raises(gym.error.NameNotFound, match="HorseLegg"):
        gym.make("hoof_env/HorseLegg-v0")


@pytest.mark.parametrize(
    "action",
    [np.zeros(3), np.zeros((1, 4)), [0, 0, 0, np.nan], [0, 0, 0, np.inf], "go", None, 1.0],
    ids=str,
)
def test_bad_actions(action):
    env = gym.make(LEG).unwrapped
    env.reset(seed=0)
    before = env.engine.state.copy()
    with pytest.raises(ParameterError, match="action: expected 4 finite numbers"):
        env.step(action)
    assert env.engine.state.motion["theta"] == before.motion["theta"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"phase": 1.0}, "options: expected a mapping with some of gait, crank_angle, speed, height"),
        (["gait"], "options: expected a mapping"),
        ({"gait": "trot"}, r"options\['gait'\]: expected one of run, walk, got 'trot'"),
        ({"gait": {"speed": 1}}, r"options\['gait'\]: expected a gait name \(run, walk\) or a mapping"),
        ({"gait": 7}, r"options\['gait'\]: expected a gait name"),
        ({"crank_angle": float("nan")}, r"options\['crank_angle'\]: expected.*got nan"),
        ({"speed": 1e3}, r"options\['speed'\]: expected.*got 1000.0"),
        ({"height": -1}, r"options\['height'\]: expected.*got -1"),
    ],
)
def test_bad_reset_options(options, message):
    env = gym.make(LEG)
    with pytest.raises(ParameterError, match=message):
        env.reset(options=options)


@pytest.mark.parametrize("trunk", ["rail", "fixed"])
def test_a_trunk_that_cannot_rise_refuses_a_height(trunk):
    env = gym.make(LEG, trunk=trunk)
    with pytest.raises(ParameterError, match=f"height: a {trunk} trunk is at 1.718.* m, got 3 m"):
        env.reset(options={"height": 3.0})


def test_a_step_that_could_not_be_simulated_pays_for_nothing_but_the_failure():
    env = gym.make(LEG).unwrapped
    env.reset(seed=0, options={"gait": "run"})
    for _ in range(20):
        _, reward, *_ = env.step(env.action_for(env.gaits["run"]))
    assert reward != 0.0
    distance, work = env._account["distance"], env._account["total_work"]
    env.engine.state.body["px"] = np.nan
    _, reward, terminated, _, info = env.step(env.action_for(env.gaits["run"]))
    assert terminated
    assert "finite" in info["failure"]
    assert reward == info["reward_failure"] == -300.0
    assert info["episode_summary"]["distance_m"] == distance
    assert info["episode_summary"]["drive_work_j"] == work


def test_the_papers_solver_can_be_made_exact():
    """rk4 instead of Euler removes the drift: the force curve is the closed form's."""
    runs = [
        {"solver": "paper", "integrator": "rk4"},
        {"solver": "paper"},
        {"solver": "exact", "sim_dt": 1e-3},
    ]
    forces = []
    for kwargs in runs:
        env = gym.make(FIXED, gait="run", episode_seconds=0.4, **kwargs)
        env.reset(seed=0)
        forces.append(traces(env, np.zeros(4, np.float32))["normal"])
    assert np.abs(forces[0] - forces[2]).max() < 1e-6 * forces[2].max()
    assert np.abs(forces[1] - forces[2]).max() > 1e-3 * forces[2].max()


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"integrator": "leapfrog"}, "integrator: expected one of euler.*got 'leapfrog'"),
        ({"baumgarte_beta": -1.0}, "baumgarte_beta: expected.*got -1.0"),
    ],
)
def test_bad_scheme(kwargs, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(FIXED, **kwargs)

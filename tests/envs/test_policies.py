"""Scripted policies: many at once as one by one, clocks that restart, open-loop gaits and their files."""

import json
import warnings

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs.open_loop import check_blind, load_open_loop, open_loop
from hoof_env.envs.policies import make_policy, policy_names, start_of
from hoof_env.errors import ParameterError
from hoof_env.gait import PARAMETERS, GaitParameters, load_gait
from hoof_env.tasks import horse as horse_body
from hoof_env.tasks.horse_gaits import horse_gaits, kinematic_speeds
from hoof_env.tasks.observation import HALF_RANGE, HIGH, LOW, MIDDLE
from hoof_env.tasks.one_leg import POLICIES

ENV_ID = "hoof_env/HorseLeg-v0"
COEFFICIENTS = [[[5.0, 0.4, 0.1, 0.0], [1.0, 0.0, 0.0, 0.1], [0.0, 0.2, 0.0, 0.0]]]
"""Coefficients of 1, sine and cosine: gait parameters [rad/s, rad, rad, rad]."""

CLOCKED = {"coefficients": COEFFICIENTS, "frequency_hz": 0.25}
PHASE = {"coefficients": COEFFICIENTS}


@pytest.fixture(scope="module")
def env():
    return gym.make(ENV_ID)


def write(path, **changes):
    path.write_text(json.dumps({"env_id": ENV_ID, "form": "gait", "parameters": CLOCKED} | changes))
    return path


def seen_in(env, gaits):
    """Observations that show some gaits, shape (n, 4), and nothing else."""
    leg = env.unwrapped
    first, width = leg.observation_names.index("crank speed"), leg.observation_space.shape[0]
    seen = np.zeros((*np.shape(gaits)[:-1], width), np.float32)
    seen[..., first : first + 4] = (np.asarray(gaits) - MIDDLE) / HALF_RANGE
    return seen


def reach_in(env):
    """How far an action of 1 puts the command from where the gait is heading, shape (4,)."""
    leg = env.unwrapped
    return leg.body.reach(leg.engine, leg.dt)


def gait_of(env):
    """Gait parameters at present."""
    return np.array([env.unwrapped.engine.state[name].item() for name in PARAMETERS])


@pytest.mark.parametrize("name", ["run", "walk", *(name for name in POLICIES if name != "random")])
def test_many_are_commanded_as_each_alone(env, name):
    assert name in policy_names(env)
    shape = 30, 3, *env.observation_space.shape
    seen = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
    alone = [make_policy(name, env) for _ in range(3)]
    many = make_policy(name, env)
    for step in range(30):
        actions, _ = many.predict(seen[step])
        assert actions.dtype == np.float32
        for row, policy in enumerate(alone):
            np.testing.assert_array_equal(actions[row], policy.predict(seen[step, row])[0])


def test_random_draws_for_each(env):
    actions, _ = make_policy("random", env, 1).predict(np.zeros((50, 24)))
    assert actions.shape == (50, 4)
    assert len(np.unique(actions)) == 200


def test_a_named_gait_starts_in_it_and_keeps_it(env):
    """So does one by its parameters; other policies leave the start to the environment."""
    for name in ("run", "walk", "carrying_walk"):
        policy = make_policy(name, env)
        assert start_of(policy) == {"gait": load_gait(name)}
        seen, _ = env.reset(seed=0, options=start_of(policy))
        for _ in range(20):
            action, _ = policy.predict(seen)
            np.testing.assert_array_equal(action, np.zeros(4, np.float32))
            seen, *_ = env.step(action)
        np.testing.assert_array_equal(gait_of(env), load_gait(name).to_array())
    for name in POLICIES:
        assert start_of(make_policy(name, env)) == {}
    assert start_of(open_loop(CLOCKED, env)) == {}
    assert start_of(object()) == {}


def test_a_policy_acts_on_what_it_sees_as_action_for_does_on_the_state(env):
    """From any start it goes to its gait, with the same actions but for the rounding of observations."""
    policy = make_policy("run", env)
    seen, _ = env.reset(seed=0, options={"gait": "walk"})
    for _ in range(150):
        action, _ = policy.predict(seen)
        np.testing.assert_allclose(action, env.unwrapped.action_for("run"), atol=1e-4)
        seen, *_ = env.step(action)
    np.testing.assert_allclose(gait_of(env), load_gait("run").to_array(), atol=1e-5)


def test_a_horse_has_no_gait_to_go_to():
    horse = gym.make("hoof_env/Horse-v0")
    assert policy_names(horse) == [*horse_body.POLICIES, *kinematic_speeds()]
    action, _ = make_policy("reference", horse).predict(np.zeros(66))
    np.testing.assert_array_equal(action, np.zeros(16))


@pytest.mark.parametrize("size", [1.0, 0.5])
@pytest.mark.parametrize("name", kinematic_speeds())
def test_a_kinematic_gait_of_a_horse_plays_at_its_own_speed(name, size):
    """And at a similar animal's, which is the same Froude number."""
    horse = gym.make("hoof_env/Horse-v0", size=size)
    policy = make_policy(name, horse)
    horse.reset(seed=3, options=policy.start)
    speed = kinematic_speeds()[name] * size**0.5
    rows = horse.unwrapped.batch.rows.named
    assert rows.target[0] == pytest.approx(speed)
    np.testing.assert_allclose(rows.gait[:, 0], horse_gaits()[name].of_size(size).to_array())
    places = []
    for _ in range(400):
        _, _, failed, _, _ = horse.step(policy.predict(np.zeros(66))[0])
        assert not failed
        places.append(float(horse.unwrapped.record()["x"][-1, 0]))
    reached = (places[-1] - places[99]) / (300 * horse.unwrapped.dt)
    assert reached == pytest.approx(speed, rel=0.05)


def test_the_clock_of_one_restarts_and_the_others_go_on(env):
    policy, twin = open_loop(CLOCKED, env), open_loop(CLOCKED, env)
    seen = seen_in(env, [COEFFICIENTS[0][0]] * 2)
    first, _ = policy.predict(seen)
    for _ in range(9):
        policy.predict(seen)
    later, _ = policy.predict(seen, episode_start=np.array([False, True]))
    np.testing.assert_array_equal(later[1], first[1])
    for _ in range(10):
        twin.predict(seen[0])
    np.testing.assert_array_equal(later[0], twin.predict(seen[0])[0])
    assert not np.array_equal(later[0], first[0])


def formula(time):
    """The gait of `CLOCKED` at a time."""
    phase = 2 * np.pi * CLOCKED["frequency_hz"] * time
    c, a, b = np.array(COEFFICIENTS[0])
    return np.clip(c + a * np.sin(phase) + b * np.cos(phase), LOW, HIGH)


def test_a_clocked_gait_goes_towards_its_formula(env):
    policy, reach, here = open_loop(CLOCKED, env), reach_in(env), MIDDLE + 0.01
    for step in range(7):
        found, _ = policy.predict(seen_in(env, here))
        expected = np.clip((formula(0.02 * step) - here) / reach, -1, 1)
        np.testing.assert_allclose(found, expected, atol=1e-4)
        assert np.abs(found).min() < 1  # not all at their limits


def test_a_slow_clock_is_followed(env):
    """As far behind it as the filters and a control step are."""
    policy = open_loop(CLOCKED, env)
    seen, _ = env.reset(seed=0, options={"gait": GaitParameters.from_array(formula(0.0))})
    for step in range(300):
        seen, *_ = env.step(policy.predict(seen)[0])
        if step > 50:
            time = 0.02 * (step + 1)
            lag = np.abs(gait_of(env) - formula(time - 0.07))
            assert (lag < [0.15, 0.03, 0.02, 0.02]).all()


def test_a_gait_that_is_locked_to_the_crank_goes_towards_its_formula():
    """At any crank angle, with the command in the weights, whatever else is seen."""
    env = gym.make("hoof_env/HorseLegSpeed-v0")
    names, reach = env.unwrapped.observation_names, reach_in(env)
    rng = np.random.default_rng(0)
    coefficients = rng.uniform(-0.3, 0.3, (2, 5, 4)) * HALF_RANGE
    coefficients[0, 0] += MIDDLE
    policy = open_loop({"coefficients": coefficients}, env)
    for angle in rng.uniform(-np.pi, np.pi, 20):
        seen, here, command = rng.uniform(-1, 1, len(names)), MIDDLE + 0.01, rng.uniform(0, 1)
        seen[names.index("crank speed") :][:4] = (here - MIDDLE) / HALF_RANGE
        seen[names.index("crank speed") + 4 :][:4] = 0.0
        seen[names.index("sin(crank angle)")] = np.sin(angle)
        seen[names.index("cos(crank angle)")] = np.cos(angle)
        seen[names.index("commanded speed")] = command
        basis = [1.0, np.sin(angle), np.cos(angle), np.sin(2 * angle), np.cos(2 * angle)]
        gait = np.clip(basis @ (coefficients[0] + command * coefficients[1]), LOW, HIGH)
        found, _ = policy.predict(seen)
        np.testing.assert_allclose(found, np.clip((gait - here) / reach, -1, 1), atol=1e-6)


def test_each_leg_of_a_horse_follows_its_own_crank_and_left_is_as_right():
    env = gym.make("hoof_env/Horse-v0")
    names = env.unwrapped.observation_names
    rng = np.random.default_rng(0)
    coefficients = rng.uniform(-0.5, 0.5, (1, 3, 8))
    policy, seen = open_loop({"coefficients": coefficients}, env), rng.uniform(-1, 1, len(names))
    angles = dict(
        zip(("left fore", "right fore", "left hind", "right hind"), rng.uniform(-3, 3, 4), strict=True)
    )
    for leg, angle in angles.items():
        for function in (np.sin, np.cos):
            seen[names.index(f"{leg}: {function.__name__}(crank angle)")] = function(angle)
    found, _ = policy.predict(seen)
    for k, (leg, angle) in enumerate(angles.items()):
        own = coefficients[0][:, :4] if "fore" in leg else coefficients[0][:, 4:]
        expected = np.clip(np.array([1.0, np.sin(angle), np.cos(angle)]) @ own, -1, 1)
        np.testing.assert_allclose(found[4 * k : 4 * k + 4], expected, atol=1e-6)
        action = env.unwrapped.action_names[4 * k]
        assert action.startswith(leg.replace(" ", "_"))


def test_a_motor_takes_a_clock_and_not_its_crank(env):
    motor = gym.make(ENV_ID, drive="motor")
    with pytest.raises(ParameterError, match=r'expected .*"frequency_hz".*drive .*motor'):
        open_loop(PHASE, motor)
    open_loop(CLOCKED, motor)
    open_loop(PHASE, motor, blind=False)
    with pytest.raises(ParameterError, match=r"expected 'target' .*groups"):
        open_loop({"coefficients": COEFFICIENTS * 2}, env)
    with pytest.raises(ParameterError, match=r"expected 8 .*horse, got 4"):
        open_loop(PHASE, gym.make("hoof_env/Horse-v0"))
    with pytest.raises(ParameterError, match=r"expected 'crank' .*groups"):
        open_loop(PHASE, gym.make(ENV_ID, observation=["gait"]))


@pytest.mark.parametrize(
    ("groups", "drive", "seeing"),
    [
        (["crank", "gait"], "prescribed", ""),
        (["gait", "crank", "trunk"], "prescribed", "got trunk"),
        (["crank", "gait"], "motor", "got crank; the ground changes the crank of a motor"),
        (["gait"], "motor", ""),
    ],
)
def test_observations_of_the_ground_are_reported(groups, drive, seeing):
    settings = gym.make(ENV_ID, observation=groups, drive=drive).unwrapped.settings
    if seeing:
        with pytest.raises(ParameterError, match=seeing):
            check_blind(settings)
    else:
        check_blind(settings)


def test_a_gait_beyond_the_limits_is_gone_to_as_far_as_they_reach(env):
    held = [[[12.0, 1.39, 0.0, 0.0], *COEFFICIENTS[0][1:]]]
    policy = open_loop({"coefficients": held, "frequency_hz": 0.0}, env)
    np.testing.assert_allclose(formula(0.0), [5.0, 0.6, 0.1, 0.0])
    seen, _ = env.reset(seed=0)
    for _ in range(200):
        seen, *_ = env.step(policy.predict(seen)[0])
    np.testing.assert_allclose(gait_of(env), [12.0, HIGH[1], 0.0, 0.0], atol=1e-5)


def test_a_gait_for_each_of_many(env):
    generator = np.random.default_rng(0)
    gaits = {"coefficients": generator.uniform(-1, 1, (3, 1, 3, 4))}
    gaits["frequency_hz"] = np.array([0.5, 1.0, 2.0])
    many, seen = open_loop(gaits, env), seen_in(env, generator.uniform(LOW, HIGH, (3, 4)))
    alone = [open_loop({name: value[row] for name, value in gaits.items()}, env) for row in range(3)]
    for _ in range(5):
        actions, _ = many.predict(seen)
        each = [policy.predict(row)[0] for policy, row in zip(alone, seen, strict=True)]
        np.testing.assert_array_equal(actions, each)


def test_the_clock_of_a_file_is_the_environments(tmp_path):
    path = write(tmp_path / "gait.json")
    for dt in (0.02, 0.05):
        env = gym.make(ENV_ID, dt=dt)
        policy, reach = load_open_loop(path, env), reach_in(env)
        seen = seen_in(env, formula(2 * dt))
        for _ in range(2):
            policy.predict(seen)
        np.testing.assert_allclose(policy.predict(seen)[0] * reach, 0.0, atol=1e-6)
        later = policy.predict(seen)[0] * reach
        np.testing.assert_allclose(later, formula(3 * dt) - formula(2 * dt), atol=2e-6)


def test_a_gait_of_another_id_is_reported(env, tmp_path):
    path = write(tmp_path / "gait.json")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for same in (env, gym.make("hoof_env/HorseLegMO-v0", disable_env_checker=True)):
            load_open_loop(path, same)
        load_open_loop(write(tmp_path / "bare.json", env_id=None), env)
    with pytest.warns(UserWarning, match=r"found for hoof_env/HorseLeg-v0, here hoof_env/HorseLegRail-v0"):
        load_open_loop(path, gym.make("hoof_env/HorseLegRail-v0"))
    with pytest.warns(UserWarning, match=r"found for dt=0\.04, here 0\.02"):
        load_open_loop(write(tmp_path / "slow.json", dt=0.04), env)


FIXED = "hoof_env/HorseLegFixed-v0"


def held(name, env, seconds=12.0):
    """Gaits and heights of the lower hoof point in the last second of a policy."""
    leg, policy, gaits, heights = env.unwrapped, make_policy(name, env), [], []
    observation, _ = env.reset(seed=0)
    for step in range(round(seconds / leg.dt)):
        observation, *_ = env.step(policy.predict(observation)[0])
        if step * leg.dt > seconds - 1:
            gaits.append(gait_of(env))
            heights.append(min(leg.record()["toe_y"][-1].item(), leg.record()["heel_y"][-1].item()))
    return np.array(gaits), np.array(heights)


@pytest.mark.parametrize("rates", [{}, {"crank_rate": 3.0}], ids=["", "slow"])
@pytest.mark.parametrize("gait", ["walk", "run", "carrying_walk"])
def test_policies_hold_their_posture_wherever_they_start(gait, rates):
    """The crank stops, at the highest place of the hoof and at the lowest."""
    env = gym.make(FIXED, gait=gait, episode_seconds=13.0, **rates)
    heights = {}
    for name in ("idle", "airborne", "drag"):
        gaits, heights[name] = held(name, env)
        assert (gaits[:, 0] < 0.02).all()
    low, high = heights["drag"].min(), heights["airborne"].mean()
    assert low < heights["idle"].mean() < high
    for offset in (LOW[1], HIGH[1]):
        for crank in np.linspace(0, 2 * np.pi, 24, endpoint=False):
            env.reset(options={"crank_angle": crank, "gait": GaitParameters(0.0, offset, 0.0, 0.0)})
            record = env.unwrapped.record()
            assert min(record["toe_y"].item(), record["heel_y"].item()) < high + 0.01


def test_policies_that_see_the_crank_find_it_wherever_it_is():
    one, other = gym.make(ENV_ID), gym.make(ENV_ID, observation=["hoof", "gait", "crank"])
    for name in ("drag", "airborne"):
        seen = [seen_in(env, np.tile(MIDDLE, (9, 1))) for env in (one, other)]
        for env, rows in zip((one, other), seen, strict=True):
            angle, first = np.linspace(0.0, 6.0, 9), env.unwrapped.observation_names.index("sin(crank angle)")
            rows[:, first], rows[:, first + 1] = np.sin(angle), np.cos(angle)
        commands = [
            make_policy(name, env).predict(rows)[0] for env, rows in zip((one, other), seen, strict=True)
        ]
        assert len(np.unique(commands[0][:, 0])) > 1
        np.testing.assert_array_equal(*commands)

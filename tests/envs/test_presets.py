"""Legs of other mechanisms in the environments: every id of one leg takes them, and their gaits walk."""

import gymnasium as gym
import numpy as np
import pytest

import hoof_env  # noqa: F401  (registers the environments)
from hoof_env.envs.policies import make_policy
from hoof_env.errors import ParameterError
from hoof_env.policies.find import default_policy
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.registry import HOP, TASKS

PRESETS = ("jansen", "klann", "fourbar")
IDS = [task.id for task in TASKS.values() if task.body is OneLeg]


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("env_id", IDS)
def test_every_id_of_one_leg_steps_with_every_preset(env_id, preset):
    env = gym.make(env_id, preset=preset)
    policy = make_policy("walk", env)
    observation, _ = env.reset(seed=0, options=policy.start)
    pressed = 0.0
    for k in range(40):
        assert env.observation_space.contains(observation)
        action, _ = policy.predict(observation, episode_start=k == 0)
        observation, reward, terminated, truncated, _ = env.step(action)
        assert np.isfinite(reward).all()
        falls = env.unwrapped.settings.trunk in ("boom", "floating")
        assert falls or not terminated
        report = env.unwrapped.engine.report
        pressed = max(pressed, report["toe_normal"].item())
        assert report["heel_normal"].item() == 0.0
        if terminated or truncated:
            break
    # A trunk that pitches may fall over before the hoof lands
    assert pressed > 50 or (terminated and env.unwrapped.settings.trunk == "floating")


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("env_id", IDS)
def test_no_start_of_a_preset_fails_at_once(env_id, preset):
    """A trunk that is raised out of the ground stays below the height at which an episode fails."""
    envs = gym.make_vec(env_id, num_envs=64, preset=preset).unwrapped
    envs.reset(seed=0)
    *_, terminated, _, infos = envs.step(np.zeros((64, 4), np.float32))
    assert not terminated.any()
    if envs.settings.trunk in ("boom", "floating"):
        # No fall from a height that only another leg needs
        assert infos["measured"]["y"].max() < 1.4 * envs.engine.trunk.height


def test_a_leg_without_the_gait_of_a_task_is_played_in_one_of_its_own():
    named = [
        default_policy(gym.make("hoof_env/HorseLegHop-v0", preset=name)) for name in ("identified", "klann")
    ]
    assert named == ["zero", "run"]


def test_reset_options_of_a_leg_that_reaches_too_far_are_refused_or_drawn_again():
    env = gym.make("hoof_env/HorseLegHop-v0", preset="klann")
    with pytest.raises(ParameterError, match=r"gait and a crank_angle.* 3.895 m.*got .*'crank_angle': 3.2"):
        env.reset(options={"gait": HOP, "crank_angle": 3.2})
    _, taken = env.reset(seed=0, options={"gait": HOP, "crank_angle": 3.2, "height": 2.0})
    assert taken["height"] == 2.0
    # Half of the crank angles are too far: those drawn again are not
    envs = gym.make_vec("hoof_env/HorseLegHop-v0", num_envs=64, preset="klann")
    _, infos = envs.reset(seed=0, options={"gait": HOP})
    assert infos["height"].max() < 2.0 * envs.unwrapped.engine.trunk.height
    assert infos["measured"]["toe_penetration"].max() < 1e-12


@pytest.mark.parametrize("trunk", ["rail", "fixed", "boom"])
def test_a_leg_of_another_shape_starts_above_the_ground_under_any_trunk(trunk):
    envs = gym.make_vec("hoof_env/HorseLegHop-v0", num_envs=64, preset="klann", trunk=trunk)
    envs.reset(seed=0)
    assert envs.unwrapped.engine.report["toe_y"].min() >= 0.0


@pytest.mark.parametrize("preset", PRESETS)
def test_gaits_of_presets_carry_the_trunk_and_keep_their_speed(preset):
    """The walk has the Froude number 0.25, the run makes the most of 2.5 m/s."""
    speeds = {}
    for name in ("walk", "run"):
        envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=8, preset=preset)
        with_gait = gym.make("hoof_env/HorseLeg-v0", preset=preset)
        policy = make_policy(name, with_gait)
        observations, _ = envs.reset(seed=0, options=policy.start)
        start = np.ones(8, bool)
        done = np.zeros(8, bool)
        while not done.any():
            actions, _ = policy.predict(observations, episode_start=start)
            observations, _, terminated, truncated, infos = envs.step(actions)
            start[:] = False
            done = terminated | truncated
        summary = infos["episode_summary"]
        assert not summary["failed"].any()
        assert (summary["weight_share"] > 0.6).all()
        speeds[name] = float(np.mean(summary["speed_m_s"]))
    assert speeds["walk"] == pytest.approx(2.04, rel=0.1)
    assert speeds["run"] > 2.0


@pytest.mark.parametrize("preset", PRESETS)
def test_the_paper_is_not_reproduced_by_another_leg(preset):
    from hoof_env.paper.reproduce import reproduce

    with pytest.raises(ParameterError, match=r"preset: expected a leg .*paper's mechanism .*gaits"):
        reproduce(preset=preset)

"""One leg under a trunk that pitches: momentum in the air, falls, observations, and the value of seeing."""

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import score_vector
from hoof_env.tasks.one_leg import GYRATION, PITCH

ID = "hoof_env/HorseLegBalance-v0"
SPEED = "hoof_env/HorseLegBalanceSpeed-v0"
SEEDS = range(40)


def in_the_air(action):
    """State of the engine after each step of a flight under one action."""
    env = gym.make(ID).unwrapped
    env.reset(seed=0, options={"height": 3.0})
    states = []
    for _ in range(15):
        *_, info = env.step(np.asarray(action, np.float32))
        assert info["measured"]["normal_impulse"] == 0.0
        states.append({name: env.engine.state[name][0] for name in ("pitch", "angular_momentum")})
    return states


def test_in_the_air_what_turns_the_leg_turns_the_trunk_back():
    """The angular momentum of all bodies about their centre stays, whatever the leg does."""
    forward, back = in_the_air([0, 1, 0, 0]), in_the_air([0, -1, 0, 0])
    for states in (forward, back):
        spins = np.array([state["angular_momentum"] for state in states])
        assert np.ptp(spins) < 1e-9 * max(1.0, np.abs(spins).max())
    turned = forward[-1]["pitch"] - back[-1]["pitch"]
    # Swings of 3 rad/s for 0.3 s in opposite directions, of a leg much lighter than the trunk
    assert 0.01 < abs(turned) < 1.0
    env = gym.make(ID).unwrapped
    assert turned * env.body.geometry.travel < 0.0


def test_the_trunk_has_the_similar_inertia_of_a_horses():
    env = gym.make(ID).unwrapped
    trunk = env.engine.trunk
    assert trunk.kind == "floating"
    assert trunk.pitch_inertia == pytest.approx(trunk.mass * (GYRATION * env.body.geometry.hip_height) ** 2)


def test_nothing_resists_the_trunk():
    """Forward momentum of all bodies changes by nothing in the air."""
    env = gym.make(ID).unwrapped
    env.reset(seed=0, options={"height": 3.0, "speed": 3.0})
    before = env.engine.state["momentum_x"][0]
    for _ in range(10):
        env.step(np.zeros(4, np.float32))
    assert env.engine.state["momentum_x"][0] == pytest.approx(before, rel=1e-9)


@pytest.mark.parametrize("env_id", [ID, SPEED])
def test_with_zero_actions_the_trunk_falls_over(env_id):
    env = gym.make(env_id).unwrapped
    for seed in range(5):
        env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            *_, terminated, truncated, info = env.step(np.zeros(4, np.float32))
        assert terminated
        assert 0.5 < info["episode_summary"]["seconds"] < 8.0
        assert "the trunk pitched beyond its limits" in info["end"]
        assert abs(env.engine.state["pitch"][0]) > PITCH


def test_pitch_is_observed_where_the_trunk_pitches():
    names = ["pitch", "pitch rate"]
    env = gym.make(ID).unwrapped
    assert [name for name in env.observation_names if "pitch" in name] == names
    observation, _ = env.reset(seed=0)
    at = env.observation_names.index("pitch")
    for _ in range(20):
        observation, *_ = env.step(np.zeros(4, np.float32))
    assert observation[at] == pytest.approx(np.tanh(env.engine.state["pitch"][0] / 0.3), abs=1e-6)
    assert observation[at] != 0.0
    held = gym.make(ID, trunk="boom").unwrapped
    assert not [name for name in held.observation_names if "pitch" in name]


@pytest.mark.parametrize(
    ("env_id", "kwargs", "message"),
    [
        (ID, {"trunk_share": 0.5}, "trunk_share: .*suspended.*floating"),
        (ID, {"size": 1.2}, "size: expected none for one leg"),
        (ID, {"terrain": {"kind": "slope", "angle": 0.05}}, "under a floating trunk"),
        ("hoof_env/Horse-v0", {"trunk": "floating"}, 'trunk: expected "free" for a horse'),
        ("hoof_env/HorseLeg-v0", {"trunk": "free"}, "trunk: expected one of .*floating.*got 'free'"),
    ],
)
def test_contradictions_are_refused_by_name(env_id, kwargs, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(env_id, **kwargs)


def mean(episodes, name="return"):
    return np.mean([episode[name] for episode in episodes])


@pytest.mark.parametrize("env_id", [ID, SPEED])
def test_seeing_is_worth_a_quarter_of_what_the_agent_gains(env_id):
    """The best policy without feedback falls over, and the shipped agent does not."""
    agent, blind, zero = (score_vector(name, env_id, SEEDS) for name in ("shipped", "open-loop", "zero"))
    assert mean(agent) - mean(blind) > 0.25 * (mean(agent) - mean(zero))
    assert mean(blind, "failed") > 0.9
    assert mean(agent, "failed") < 0.1

"""A leg that carries itself: what its reward charges, that it stands on the ground, and that no wild policy
comes near the gait of a hop."""

import gymnasium as gym
import numpy as np
import pytest
from family import together

from hoof_env.envs.open_loop import load_open_loop
from hoof_env.envs.policies import make_policy, towards
from hoof_env.evaluation.episodes import play_rows
from hoof_env.tasks.registry import TASKS

ID = TASKS["hop"].id
EPISODES = 40


def played(policy_of, **settings):
    """Summaries of the first episodes of a policy, which a function makes of an environment."""
    envs = gym.make_vec(ID, num_envs=EPISODES, autoreset_mode=gym.vector.AutoresetMode.SAME_STEP, **settings)
    return play_rows(envs.unwrapped, policy_of(gym.make(ID, **settings)), range(EPISODES))


def mean(episodes, name="return"):
    return np.mean([episode[name] for episode in episodes])


@pytest.fixture(scope="module")
def hop():
    """Episodes of the best gait without feedback."""
    return played(lambda env: load_open_loop(ID, env))


def test_the_gait_of_a_hop_goes_on_forward_and_hardly_slides(hop):
    assert mean(hop, "failed") == 0.0
    assert mean(hop, "speed_m_s") > 2.0
    assert mean(hop, "slip_m") < 0.1
    assert mean(hop, "weight_share") == pytest.approx(1.0, abs=0.03)  # it carries itself, start and end apart


def gone_to(crank_speed, offset, sine=0.0, cosine=0.0, size=0.0, hertz=0.0):
    """A policy that goes to a gait, whose swing offset may be a wave."""

    class Policy:
        def __init__(self, env):
            self.step, self.dt = 0, env.unwrapped.dt
            self.act = towards(env, lambda seen, time: self.gait)

        def predict(self, seen, *_, **__):
            wave = size * np.sin(2 * np.pi * hertz * self.step * self.dt)
            self.gait = np.array([crank_speed, offset + wave, sine, cosine])
            self.step += 1
            return self.act(seen, 0.0), None

    return Policy


WILD = {
    **{name: lambda env, name=name: make_policy(name, env)
       for name in ("zero", "idle", "drag", "airborne", "random", "bang-bang", "walk", "run")},
    "standing": gone_to(0.0, 0.8),
    "falling forward": gone_to(0.0, -0.4),
    "falling backward": gone_to(0.0, 1.4),
    "going limp at once": gone_to(12.0, 1.4, 0.9, 0.9),
    **{f"crank stopped, swing at {hertz:g} Hz": gone_to(0.0, 0.8, size=0.3, hertz=hertz)
       for hertz in (0.5, 1.0, 2.0, 4.0, 8.0)},
    "crawling": gone_to(1.0, 0.8, size=0.2, hertz=0.3),
}  # fmt: skip
"""Policies that must not pay, by name."""


@pytest.mark.parametrize("name", WILD)
def test_wild_policies_stay_below_the_gait_of_a_hop(name, hop):
    assert mean(played(WILD[name])) < mean(hop) - 50.0


def test_falling_never_pays():
    """An early end costs more than was gained until then, at the highest speed of a start, too."""
    env = gym.make(ID).unwrapped
    env.reset(seed=0, options={"speed": 4.0})
    total, terminated = 0.0, False
    while not terminated:
        _, reward, terminated, truncated, info = env.step(env.action_for(np.array([0.0, -0.4, 0.0, 0.0])))
        total += reward
        assert not truncated
    assert info["reward_failure"] == pytest.approx(-5.0 * (10.0 - env.batch.rows.named.time[0]))
    assert total < 0.0


def test_the_charge_of_a_stance_is_the_square_of_its_peak():
    """From the forces of all substeps, stance by stance."""
    env = gym.make(ID).unwrapped
    env.reset(seed=3)
    records, paid = [env.record()], 0.0
    for _ in range(150):
        *_, info = env.step(np.zeros(4, np.float32))
        records.append(env.record())
        paid += info["reward_peak"]
    found = together(records[1:])
    forces, loaded = found["grf"], found["toe_normal"] + found["heel_normal"] > 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], loaded, [False]]).astype(int)))
    peaks = [forces[first:last].max() for first, last in edges.reshape(-1, 2)]
    assert len(peaks) > 2
    assert paid == pytest.approx(-0.3 * np.sum(np.square(peaks)) / env.weight**2, rel=0.02)


def test_soles_sink_by_less_than_2_cm_and_no_start_is_in_the_ground():
    envs = gym.make_vec(ID, num_envs=EPISODES).unwrapped
    policy = load_open_loop(ID, gym.make(ID))
    observations, _ = envs.reset(seed=0)
    deepest = 0.0
    for step in range(500):
        observations, _, terminated, _, infos = envs.step(policy.predict(observations)[0])
        assert not terminated.any()
        depth = np.maximum(infos["measured"]["toe_penetration"], infos["measured"]["heel_penetration"])
        deepest = max(deepest, depth.max())
        assert step or depth.max() < 0.0
    assert 0.005 < deepest < 0.02


def test_nothing_resists_the_motion_of_the_trunk_but_the_ground():
    """In the air the speed is constant, and on the ground momentum changes by the friction alone."""
    env = gym.make(ID, sim_dt=2.5e-4).unwrapped
    env.reset(seed=1, options={"speed": 3.0})
    env.record()
    env.reset(seed=1, options={"speed": 3.0})
    momentum, impulse = env.engine.state["momentum_x"][0], 0.0
    for _ in range(25):
        env.step(np.zeros(4, np.float32))
        record = env.record()
        force = (record["toe_friction"] + record["heel_friction"])[:, 0, 0]
        impulse += np.sum((force[1:] + force[:-1]) / 2 * np.diff(record["time"][:, 0]))
    gained = env.engine.state["momentum_x"][0] - momentum
    assert abs(impulse) > 1.0  # it has landed
    assert gained == pytest.approx(impulse, rel=0.02)  # a drag of HorseLeg's would take a quarter


@pytest.mark.parametrize("kwargs", [{}, {"preset": "fourbar"}, {"hoof_length": 0.6}])
def test_no_drawn_start_has_its_sole_in_the_ground(kwargs):
    env = gym.make(ID, **kwargs)
    for seed in range(8):
        measured = env.reset(seed=seed)[1]["measured"]
        assert max(measured["toe_penetration"], measured["heel_penetration"]) < 1e-12


def test_a_gait_that_is_set_beats_the_gait_of_the_task():
    env = gym.make(ID, gait="run")
    run = env.unwrapped.gaits["run"].to_array()
    np.testing.assert_array_equal(env.reset(seed=0)[1]["gait"], run)
    assert not np.array_equal(gym.make(ID).reset(seed=0)[1]["gait"], run)


@pytest.mark.parametrize("trunk", ["rail", "fixed"])
def test_a_trunk_that_keeps_its_height_starts_there(trunk):
    env = gym.make(ID, trunk=trunk)
    assert env.reset(seed=0)[1]["height"] == env.unwrapped.engine.trunk.height

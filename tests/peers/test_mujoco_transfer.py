"""The agent of HorseLeg-v0 in MuJoCo: what it sees there, and how near it comes."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks import mujoco_transfer as transfer
from hoof_env import make_policy
from hoof_env.policies.find import find_policy

pytestmark = pytest.mark.peers


@pytest.fixture(scope="module")
def env():
    return transfer.runs.make_env(transfer.ENV_ID)


@pytest.mark.parametrize("seed", range(4))
def test_at_the_start_it_observes_what_the_environment_shows(env, seed):
    observation, _ = env.reset(seed=seed)
    there = transfer.MujocoEpisode(env, transfer.CONTACT)
    # A start puts the lowest point on the ground, on either side of which rounding may leave it
    told = [not name.endswith(("contact", "approach speed")) for name in env.unwrapped.observation_names]
    np.testing.assert_allclose(there.observe()[told], observation[told], atol=2e-6)


def test_in_the_air_both_move_alike(env):
    """Until the hoof lands there is no contact to fit: a fifth of a second from a crank angle in swing."""
    policy = make_policy("run", env)
    observation, _ = env.reset(seed=5, options={"gait": "run", "crank_angle": 5.0})
    there = transfer.MujocoEpisode(env, transfer.CONTACT)
    for _ in range(10):
        action, _ = policy.predict(observation)
        observation = env.step(action)[0]
        there.step(action)
        report = env.unwrapped.engine.report
        assert report["toe_normal"].item() == 0.0
        assert there.theta == pytest.approx(env.unwrapped.engine.state["crank_angle"].item(), abs=2e-3)
        assert there.data.qpos[there.swing] == pytest.approx(report["swing_angle"].item(), abs=1e-2)
        for joint, name in ((there.x, "x"), (there.z, "y")):
            assert there.data.qpos[joint] == pytest.approx(report[name].item(), abs=2e-3)


def test_the_agent_comes_near(env):
    """With the contact of the run: speed within 10 %, peak within 25 %, return within 15 %."""
    policy = find_policy(transfer.POLICY, env, transfer.ENV_ID)
    seeds = transfer.SEEDS[:6]
    here = transfer.mean([transfer.play_here(env, policy, seed) for seed in seeds])
    there = transfer.mean([transfer.play_there(env, policy, seed, transfer.CONTACT) for seed in seeds])
    assert there.failed == 0.0
    assert (np.abs(transfer.misses(there, here)) < [0.1, 0.25, 0.15]).all()

"""A spring at the hoof as an option of every id."""

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import hoof_env
from hoof_env.errors import ParameterError

LEG, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"
SOFT = {"hoof_stiffness": 4e4}


def play(env, steps=150):
    """Observations and rewards on the way to the paper's run and in it, from one start, and the info of the
    last step."""
    observation, info = env.reset(seed=3)
    seen = [observation]
    for _ in range(steps):
        observation, reward, _, truncated, info = env.step(env.unwrapped.action_for("run"))
        seen += [observation, np.float64(reward)]
        if truncated:
            break
    return seen, info


@pytest.fixture(scope="module")
def soft():
    return gym.make(LEG, **SOFT)


@pytest.mark.filterwarnings("ignore:.*is not in the environment spec:UserWarning")
def test_gymnasium_finds_nothing_wrong(soft):
    check_env(soft.unwrapped, skip_render_check=True)


def test_a_softer_hoof_has_lower_peaks():
    peaks = [play(gym.make(FIXED, gait="run", hoof_stiffness=k))[1]["episode_summary"]["highest_grf_n"]
             for k in (None, 1e5, 2e4)]  # fmt: skip
    assert peaks[0] > 1.1 * peaks[1] > 1.3 * peaks[2]


def test_states_pickles_and_infos_know_the_spring(soft):
    play(soft, 30)
    state, kept = soft.unwrapped.get_state(), pickle.loads(pickle.dumps(soft.unwrapped))
    measured = play(soft, 30)[1]["measured"]
    assert {"toe_deflection_normal", "heel_deflection_tangential"} <= set(measured.names)
    soft.unwrapped.set_state(state)
    action = soft.unwrapped.action_for("walk")
    assert np.array_equal(soft.step(action)[0], kept.step(action)[0])
    with pytest.raises(ParameterError, match=r"state: .*settings; hoof_stiffness: None here"):
        gym.make(LEG).unwrapped.set_state(state)
    soft.unwrapped.record()  # from here on steps are recorded
    soft.step(action)
    assert len(soft.unwrapped.record()["toe_deflection_normal"]) == 20


def test_the_default_damping_follows_the_settings_whatever_is_drawn():
    env = gym.make(LEG, randomize={"trunk_mass": (30.0, 70.0)}, **SOFT)
    limb = env.unwrapped.engine.limbs[0]
    assert limb.spring.damping == pytest.approx(
        0.2 * np.sqrt(4e4 * env.unwrapped.resolved_settings.trunk_mass)
    )
    settings = env.unwrapped.engine._memory.limb_settings
    before = settings.copy()
    env.reset(seed=1)
    assert np.array_equal(settings[0, -4:], before[0, -4:])


def test_a_law_of_ones_own_has_none():
    hoof_env.register("test/OwnLaw-v0", contact_law=lambda d, rate, slowness, ground: 1e4 * d)
    with pytest.raises(ParameterError, match="contact_law: expected none together with springs"):
        gym.make("test/OwnLaw-v0", **SOFT)


def test_a_sole_whose_spring_goes_back_by_itself_bears_nothing():
    """Not what rounding leaves, which would count as time under load."""
    envs = gym.make_vec("hoof_env/Horse-v0", num_envs=64, target_speed=3.7)
    envs.reset(seed=0)
    forces, gives = [], []
    for _ in range(100):
        envs.step(np.zeros((64, 16), np.float32))
        engine = envs.unwrapped.engine
        forces.append([engine.report[f"{point}_normal"] for point in ("toe", "heel")])
        gives.append([engine.state[f"{point}_deflection_normal"] for point in ("toe", "heel")])
    force, goes_back = np.array(forces), np.array(gives) > 1e-4
    assert ((force == 0.0) & goes_back).sum() > 1000
    assert force[force > 0.0].min() > 1e-6

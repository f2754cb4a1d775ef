"""A free footfall: which legs an action moves in the stride, and how far."""

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, make
from horses import stride_phases

from hoof_env.errors import DataFileError
from hoof_env.policies.record import describe, refuse_misfit
from hoof_env.tasks.horse import PHASE_SPAN


def phases(env):
    """Places of the legs in the stride, the footfall taken off [strides]."""
    return np.angle(stride_phases(env)) / (2 * np.pi)


def apart(ahead, of):
    """Difference of two phases [strides], within half a stride."""
    return (ahead - of + 0.5) % 1 - 0.5


def test_zeros_are_the_same_gait_to_the_bit():
    fixed, free = make(HORSE), make(HORSE, footfall="free")
    both = []
    for env in (fixed, free):
        env.reset(seed=3)
        steps = [env.step(np.zeros(16, np.float32)) for _ in range(50)]
        both.append([np.append(seen, reward) for seen, reward, *_ in steps])
    np.testing.assert_array_equal(*both)


@pytest.mark.parametrize("asked", [(0.04, -0.04, 0.0, 0.0), (0.0, 0.0, 0.04, -0.04), (0.04, 0.04, 0.0, 0.0)])
def test_a_leg_goes_to_the_phase_that_its_action_asks_for(asked):
    """Asked for in strides; a phase that all legs share changes nothing."""
    env = make(HORSE, footfall="free", target_speed=1.5)
    env.reset(seed=0)
    action = np.zeros((4, 4), np.float32)
    action[:, 0] = np.array(asked) / PHASE_SPAN
    found = []
    for k in range(200):
        assert not env.step(action.ravel())[2]
        if k >= 100:
            found.append(phases(env))
    for one, other in ((0, 1), (2, 3), (0, 2)):
        moved = np.mean([apart(each[one], each[other]) for each in found])
        assert moved == pytest.approx(asked[one] - asked[other], abs=0.005)


def test_actions_have_the_names_of_what_they_move():
    free = make(HORSE, footfall="free")
    assert free.action_names[::4] == (
        "left_fore_phase", "right_fore_phase", "left_hind_phase", "right_hind_phase"
    )  # fmt: skip
    assert free.action_names[1::4] == make(HORSE).action_names[1::4]


@pytest.mark.parametrize("footfall", ["fixed", "free"])
def test_an_offset_is_observed_under_the_name_of_the_action_that_moves_it(footfall):
    env = make(HORSE, footfall=footfall, privileged=["offset"])
    for k, name in enumerate(env.action_names):
        env.reset(seed=0)
        env.step(np.eye(16, dtype=np.float32)[k])
        moved = [name for name, value in env.raw_observation().items() if "offset: " in name and value]
        one, side, *what = name.split("_")
        seen = f"offset: {one} {side}, {' '.join(what)}"
        assert moved == [seen]
        assert f"true {seen}" in env.observation_names


def test_a_policy_of_one_footfall_is_refused_by_the_other():
    fixed, free = (describe(make(HORSE, footfall=each)) for each in ("fixed", "free"))
    with pytest.raises(DataFileError, match=r"0\.25 strides"):
        refuse_misfit("policy", fixed, free)


def test_rows_side_by_side_have_the_bits_of_one():
    envs = gym.make_vec(HORSE, 3, footfall="free")
    envs.reset(seed=[4, 5, 6])
    one = make(HORSE, footfall="free")
    one.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(20):
        given = rng.uniform(-0.3, 0.3, (3, 16)).astype(np.float32)
        many = envs.step(given)[0]
        np.testing.assert_array_equal(many[1], one.step(given[1])[0])

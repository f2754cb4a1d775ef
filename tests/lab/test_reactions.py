"""Joint reactions beside a record are those of the motion that is in it."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from hoof_env import records
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import make_policy
from hoof_env.lab.reactions import joint_columns, reaction_units
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.tasks.horse_gaits import LEGS

JOINT_COLUMNS = joint_columns(PAPER)


@pytest.mark.parametrize("env_id", ["hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"])
def test_all_columns_are_there_and_the_rest_keeps_its_bits(env_id):
    with gym.make(env_id) as env:
        policy = "run" if env_id.endswith("Leg-v0") else "reference"
        plain, joints = (
            records.record_episode(env, make_policy(policy, env), 3, 0.5, reactions=also)
            for also in (False, True)
        )
        units = records.units_of(env, reactions=True)
    assert set(joints) == set(units)
    for name, values in plain.items():
        np.testing.assert_array_equal(joints[name], values, err_msg=name)
    for limb in [f"{leg}_" for leg in LEGS] if len(units) > 100 else [""]:
        for name in reaction_units(PAPER):
            column = joints[limb + name]
            assert column.shape == plain["time"].shape
            assert np.isfinite(column).all()
            assert np.ptp(column) > 0


def test_what_the_legs_do_to_the_trunk_is_its_change_of_momentum():
    """Newton's law of the trunk alone: the legs' frames, which have no mass, press on it at O and C."""
    with gym.make("hoof_env/Horse-v0", trunk_drag=0.0) as env:
        record = records.record_episode(env, make_policy("reference", env), 3, 1.0, reactions=True)
        mass = env.unwrapped.engine.trunk.mass
    at_frame = [name.removesuffix("_x") for name in JOINT_COLUMNS if name.endswith("_frame_x")]
    assert len(at_frame) == 4  # the crank at O; at C two links of the triangle and the rocker
    for axis, gravity in (("x", 0.0), ("y", GRAVITY)):
        on_trunk = -sum(record[f"{leg}_{name}_{axis}"] for leg in LEGS for name in at_frame)
        speed = record[f"v{axis}"]
        impulse = np.concatenate([[0], np.cumsum((on_trunk[1:] + on_trunk[:-1]) / 2)]) * 1e-3
        expected = mass * (speed - speed[0] + gravity * record["time"])
        assert np.ptp(impulse) > 100
        np.testing.assert_allclose(impulse, expected, atol=0.005 * np.ptp(impulse))


def test_names_say_joint_and_bodies():
    assert len(JOINT_COLUMNS) == 40
    assert JOINT_COLUMNS[:2] == ["joint_O_1_frame_x", "joint_O_1_frame_y"]
    assert "joint_G_11_10_x" in JOINT_COLUMNS

"""Joint reactions beside a record belong to its motion."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from hoof_env import records
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import make_policy
from hoof_env.gait import PARAMETERS
from hoof_env.lab.reactions import JointReactions, joint_columns, reaction_units
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


@pytest.mark.parametrize("delay", [0.0, 0.5, 1.0, 1.25])
def test_the_second_engine_has_the_bits_of_the_first_with_a_delay(delay):
    """Until an action acts within a step, the command before it stands: the second engine went on with that
    of the whole step, and joints were off by as much as they bear."""
    with gym.make("hoof_env/HorseLeg-v0", action_delay=delay) as env:
        env.action_space.seed(0)
        leg = env.unwrapped
        joints = JointReactions(env)
        env.reset(seed=0)
        for _ in range(15):
            before = joints.before()
            env.step(env.action_space.sample())
            joints.after(before, 20)
            for name, value in leg.engine.state.items():
                np.testing.assert_array_equal(joints._engine.state[name], value, err_msg=name)


def test_records_have_the_command_that_acts():
    """The commands of an action that acts half a step late begin in the middle of the step."""
    now, late = (gym.make("hoof_env/HorseLeg-v0", action_delay=delay) for delay in (0.0, 0.5))
    taken = np.random.default_rng(3).uniform(-1, 1, (4, 4)).astype(np.float32)
    for env in (now, late):
        env.reset(seed=1)
        assert records.substeps(env)["command_crank_speed"].shape == (1,)
    before = records.substeps(late)["command_crank_speed"][0]
    for action in taken:
        late.step(action)
        commands = late.unwrapped.recording().commands()
        assert commands.shape == (20, 1, 4)
        columns = records.substeps(late)
        for k, name in enumerate(PARAMETERS):
            np.testing.assert_array_equal(columns[f"command_{name}"], commands[:, 0, k])
        speeds = columns["command_crank_speed"]
        assert (speeds[:10] == before).all()
        assert (speeds[10:] == speeds[-1]).all()
        assert speeds[-1] != before
        before = speeds[-1]
    now.step(taken[0])
    assert len(np.unique(records.substeps(now)["command_crank_speed"])) == 1


def test_names_say_joint_and_bodies():
    assert len(JOINT_COLUMNS) == 40
    assert JOINT_COLUMNS[:2] == ["joint_O_1_frame_x", "joint_O_1_frame_y"]
    assert "joint_G_11_10_x" in JOINT_COLUMNS

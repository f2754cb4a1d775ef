"""Whatever is set and whatever is done: no exception, nothing that is not a number, and the same again."""

from __future__ import annotations

import copy
import os

import gymnasium as gym
import numpy as np
import pytest
from family import IDS, actions, effective, same, together
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.tasks.settings import PER_EPISODE
from tests.legs import PRESETS

STEPS = int(float(os.environ.get("HOOF_ENV_STEPS", "1e5")))
"""Random steps of each id, in all environments together; a million take seconds."""

ENVS = 100


def mixed(steps: int, envs: int, seed: int = 0, width: int = 4):
    """Actions of shape (envs, width): new ones at each step in one half, in the other held for a while, and
    at their limits half of the time."""
    generator = np.random.default_rng(seed)
    half, held = envs // 2, generator.uniform(-1, 1, (envs, width))
    for _ in range(steps):
        fresh = generator.uniform(-1, 1, (envs, width))
        fresh[envs // 4 : half] = np.sign(fresh[envs // 4 : half])
        new = generator.random(envs) < 0.03
        new[:half] = True
        held[new] = fresh[new]
        held[half::2][new[half::2]] = np.sign(held[half::2][new[half::2]])
        yield held.astype(np.float32)


@pytest.mark.parametrize("env_id", IDS)
def test_random_actions(env_id):
    env = gym.make_vec(env_id, num_envs=ENVS)
    seen, _ = env.reset(seed=0)
    low, high, ends = seen.min(0), seen.max(0), 0
    for taken in mixed(STEPS // ENVS, ENVS, width=env.action_space.shape[1]):
        seen, rewards, terminated, truncated, _ = env.step(taken)
        assert np.isfinite(rewards).all()
        assert np.abs(seen).max() <= 1.0  # false for what is not a number
        low, high, ends = np.minimum(low, seen.min(0)), np.maximum(high, seen.max(0)), ends + truncated.sum()
        ends += terminated.sum()
    assert ends >= STEPS // 1100
    names = zip(env.unwrapped.observation_names, high - low, strict=True)
    assert [name for name, span in names if span < 0.05] == []


def between(low, high):
    return st.floats(low, high, allow_nan=False)


SETTINGS = st.fixed_dictionaries(
    {},
    optional={
        "preset": st.sampled_from(list(PRESETS.values())),
        "trunk": st.sampled_from(["suspended", "rail", "fixed"]),
        "trunk_mass": between(1.0, 1000.0),
        "trunk_share": between(0.0, 1.0),
        "trunk_stiffness": between(0.0, 1e5),
        "trunk_damping": between(0.0, 1e4),
        "trunk_drag": between(0.0, 1e3),
        "stiffness": between(1e2, 1e7),
        "exponent": st.sampled_from([1.0, 1.25, 1.5, 2.0, 3.0]),
        "normal_law": st.sampled_from(list(NORMAL_LAWS)),
        "restitution": between(0.01, 1.0),
        "approach_floor": between(1e-3, 2.0),
        "friction_law": st.sampled_from(list(FRICTION_LAWS)),
        "friction": between(0.0, 10.0),
        "friction_slow": between(0.0, 1e-3),
        "friction_fast": between(2e-3, 1.0),
        "terrain": st.sampled_from(
            [{"kind": "hills", "seed": 3}, {"kind": "hills", "slope": 1.0, "rise": 0.3},
             {"kind": "slope", "angle": 0.1}, {"kind": "slope", "angle": -0.5}]
        ),
        "crank_rate": between(0.1, 20.0),
        "swing_rate": between(0.01, 6.0),
        "drive": st.sampled_from(["prescribed", "motor"]),
        "motor_gain": between(0.0, 5e3),
        "motor_torque": between(0.0, 1e4),
        "motor_inertia": between(0.0, 10.0),
        "integrator": st.sampled_from(list(SCHEMES)),
        "sim_dt": st.sampled_from([5e-4, 1e-3, 2e-3, 5e-3]),
        "dt": st.sampled_from([0.01, 0.02, 0.05]),
        "episode_seconds": between(0.06, 1.0),
        "target_speed": st.tuples(between(-5.0, 0.0), between(0.0, 5.0)),
        "target_seconds": st.tuples(between(0.05, 0.1), between(0.1, 1.0)),
    },
)  # fmt: skip


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
@given(SETTINGS, st.integers(0, 1000), st.sampled_from([1, 9]), st.data())
@settings(max_examples=60, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
def test_any_settings(chosen, seed, n, data):
    if chosen.get("terrain", {}).get("kind") == "slope":  # other trunks keep their height
        chosen = chosen | {"trunk": "fixed"}
    chosen = effective(chosen, **chosen)  # the others are refused
    varied = sorted(set(chosen) & set(PER_EPISODE))
    if varied and data.draw(st.booleans()):  # the same as ranges from the default to what was chosen
        name = data.draw(st.sampled_from(varied))
        chosen = {**chosen, "randomize": {name: (chosen[name], chosen[name])}}
    env = gym.make_vec(IDS[0], num_envs=n, **chosen)
    runs = []
    for _ in range(2):
        observations, infos = env.reset(seed=seed)
        runs.append([observations, infos])
        for taken in mixed(40, n, seed):
            observations, rewards, _, _, infos = env.step(taken)
            assert np.abs(observations).max() <= 1.0
            assert np.isfinite(rewards).all()
            runs[-1] += [observations, rewards, infos]
    same(*runs)


@pytest.mark.parametrize("name", ["run", "walk"])
def test_impulse_over_a_stride_is_the_change_of_momentum(name):
    """Of trunk and leg together, along both axes, from the forces that the records show."""
    env = gym.make("hoof_env/HorseLeg-v0", sim_dt=1e-4).unwrapped
    env.reset(seed=0, options={"gait": name})
    records = [env.record()]
    for _ in range(150):
        env.step(np.zeros(4, np.float32))
        records.append(env.record())
    trace = together(records)
    turns = trace["crank_angle"] / (2 * np.pi)
    first, last = (int(np.searchsorted(turns, turns[0] + turn)) for turn in (1, 2))
    stride = {key: values[first : last + 1] for key, values in trace.items()}
    change = {axis: np.ptp(stride[f"momentum_{axis}"][[0, -1]]) for axis in "xy"}

    def impulse(force):
        return float(np.sum(force[1:] + force[:-1]) * 0.5e-4)

    s, friction = env.settings, stride["toe_friction"] + stride["heel_friction"]
    hang = (1 - s.trunk_share) * env.weight - s.trunk_damping * stride["vy"]
    hang = hang + s.trunk_stiffness * (env.engine.trunk.height - stride["y"])
    pushes = {
        "y": impulse(stride["normal"] + hang - env.weight),
        "x": impulse(friction - s.trunk_drag * stride["vx"]),
    }
    scale = impulse(stride["normal"])
    assert scale > 100.0  # the walk hardly bears on this trunk
    for axis in "xy":
        gained = stride[f"momentum_{axis}"][-1] - stride[f"momentum_{axis}"][0]
        assert abs(gained) == change[axis]
        assert pushes[axis] == pytest.approx(gained, abs=1e-3 * scale)


def test_the_engine_keeps_that_account_to_round_off():
    """The same over the steps of an environment at its own step length, with the sums of the integrator."""
    env = gym.make("hoof_env/HorseLeg-v0", trunk_stiffness=0.0, trunk_damping=0.0, trunk_drag=0.0).unwrapped
    env.reset(seed=0, options={"gait": "run"})
    engine = copy.copy(env.engine)
    before = engine.state
    engine.advance(env.gaits["run"].to_array(), 700)
    after, account = engine.state, engine.account
    seconds = (after["time"] - before["time"])[0]
    carried = 0.8 * env.weight * seconds
    rise = after["momentum_y"] - before["momentum_y"]
    assert account["impulse_y"][0] - carried == pytest.approx(rise[0], abs=1e-8)
    push = after["momentum_x"] - before["momentum_x"]
    assert account["impulse_x"][0] == pytest.approx(push[0], abs=1e-8)
    assert account["impulse_y"][0] > 100.0
    assert GRAVITY * engine.total_mass == env.weight


def test_a_record_agrees_with_its_step():
    """Sums of the record are those that the reward was paid for."""
    env = gym.make("hoof_env/HorseLegTerrain-v0").unwrapped
    env.reset(seed=1)
    env.record()
    for taken in actions(0, 200):
        before = env.engine.state["crank_angle"].item()
        _, _, terminated, _, info = env.step(taken)
        trace = together([env.record()])
        work = np.sum(np.maximum(trace["crank_power"], 0) + np.maximum(trace["hip_power"], 0)) * 1e-3
        charge = env.weights["energy"] * work / 1000
        assert info["reward_energy"] == pytest.approx(-charge, rel=1e-9, abs=1e-15)
        assert trace["crank_angle"][-1] == env.engine.state["crank_angle"].item() >= before
        if terminated:
            break

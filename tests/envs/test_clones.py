"""States and copies as planners use them: one state in many rows, copies that share what never changes."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, HORSE, actions, same

LEG, SPEED, FIXED = (f"hoof_env/HorseLeg{name}-v0" for name in ("", "Speed", "Fixed"))


@pytest.mark.parametrize("n", [1, 4, 17])
@pytest.mark.parametrize(
    ("env_id", "settings", "steps"),
    [
        (LEG, {}, 20), (SPEED, {"target_seconds": (0.1, 0.2)}, 7), (HORSE, {}, 12), (LEG, FALLS, 60),
        (LEG, {"randomize": {"friction": (0.2, 0.8), "trunk_mass": (40.0, 60.0)}}, 9),
        (FIXED, {"solver": "paper"}, 3),
    ],
)  # fmt: skip
def test_one_state_goes_on_in_every_row(env_id, settings, steps, n):
    """With actions of each row, as the single environment goes on with them from there."""
    if settings.get("solver") and n > 4:
        pytest.skip("slow")
    env, envs = gym.make(env_id, **settings), gym.make_vec(env_id, num_envs=n, **settings)
    env.reset(seed=3), envs.reset(seed=0)
    for action in actions(0, steps, env_id=env_id) / 3:
        if env.step(action)[2]:
            break
    state, taken = env.unwrapped.get_state(), actions(1, 10, n, env_id=env_id) / 3
    observed = envs.unwrapped.set_state(state)
    same(observed, np.array([env.unwrapped.set_state(state)] * n))
    if state["episode"][envs.unwrapped.batch.ended_row, 0]:
        assert envs.unwrapped._ended.all()
        return
    rows = [envs.step(action) for action in taken[: 2 if "solver" in settings else 10]]
    for k in range(n):
        env.unwrapped.set_state(state)
        for row, action in zip(rows, taken[:, k], strict=False):
            observation, reward, terminated, truncated, info = env.step(action)
            same(row[0][k], observation)
            assert (row[1][k], row[2][k], row[3][k]) == (reward, terminated, truncated)
            same(row[4]["measured"][k], info["measured"])
            same(row[4]["gait"][k], info["gait"])
            if terminated or truncated:
                break


@pytest.mark.parametrize("env_id", [LEG, HORSE])
@pytest.mark.parametrize("many", [False, True])
def test_a_copy_shares_the_tables_and_goes_its_own_way(env_id, many):
    env = (gym.make_vec(env_id, 3) if many else gym.make(env_id)).unwrapped
    env.reset(seed=0)
    shape = (3,) if many else ()
    taken = actions(0, 10, *shape, env_id=env_id)
    for action in taken[:4]:
        env.step(action)
    twin, third = copy.deepcopy(env), copy.deepcopy(env)
    for one, other in zip(twin.engine.mechanics.model, env.engine.mechanics.model, strict=True):
        assert one is other
    assert twin.geometry is env.geometry
    assert not np.shares_memory(twin.engine.arrays[0], env.engine.arrays[0])
    first = [env.step(action) for action in taken[4:]]
    same([twin.step(action) for action in taken[4:]], first)
    env.reset(), twin.step(taken[0])
    same([third.step(action) for action in taken[4:]], first)


def test_a_state_is_its_own():
    """What is done to it changes no environment, and no other state."""
    env = gym.make(LEG).unwrapped
    env.reset(seed=0)
    state, kept = env.get_state(), env.get_state()
    state["settings"]["reward_weights"] = None
    state["settings"]["target_speed"].append(3.0)
    state["engine"]["layout"].clear()
    state["engine"]["trunk"][:] = 7.0
    state["episode"][:] = 7.0
    same(env.get_state(), kept)
    env.set_state(kept)
    env.step(actions(0))
    assert (kept["engine"]["trunk"] != env.engine.get_state()["trunk"]).any()


def test_generators_of_many_belong_to_the_rows():
    """As of Gymnasium's `SyncVectorEnv`: what reset(seed=7) seeds, what is assigned, what a state brings."""
    envs = gym.make_vec(LEG, num_envs=3).unwrapped
    theirs = gym.make_vec(LEG, num_envs=3, vectorization_mode="sync")
    for one in (envs, theirs):
        one.reset(seed=7)
    assert envs.np_random_seed == theirs.np_random_seed == (7, 8, 9)
    assert envs.call("np_random_seed") == (7, 8, 9)
    envs.reset(seed=[3, None, 5])
    assert envs.np_random_seed == (3, 8, 5)
    for one in (envs, theirs):
        one.set_attr("np_random", [np.random.default_rng(k) for k in (1, 2, 3)])
    same(envs.reset()[0], theirs.reset()[0])
    assert envs.np_random_seed == theirs.np_random_seed == (-1, -1, -1)
    starts = []
    for _ in range(2):
        envs.np_random = np.random.default_rng(5)
        starts.append(envs.reset()[0])
    same(*starts)
    assert (starts[0][0] != starts[0][1]).any()
    new = gym.make_vec(LEG, num_envs=2).unwrapped
    assert len({generator.random() for generator in new.np_random}) == 2

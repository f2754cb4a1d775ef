"""Arrays of a batch: copies, restoration and repetition follow from what each declares."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hoof_env  # noqa: F401
from hoof_env.dynamics.memory import only
from hoof_env.episodes.rows import ARRAYS, repeated

ALL = {
    "observation_history": 3,
    "last_actions": 2,
    "action_delay": 1.5,
    "randomize": {"friction": (0.2, 0.6)},
    "cost": {"peak": 900.0, "loading": 1e4, "leaning": 0.8},
}
"""Settings with which no array is empty."""


@pytest.fixture(scope="module")
def rows():
    envs = gym.make_vec("hoof_env/HorseLegSpeed-v0", num_envs=3, **ALL).unwrapped
    envs.reset(seed=0)
    envs.step(envs.action_space.sample())
    return envs.batch.rows


def arrays_of(rows):
    return {name: getattr(rows, name) for name in ARRAYS if getattr(rows, name) is not None}


def test_every_array_has_the_rows_on_its_axis(rows):
    assert set(arrays_of(rows)) == set(ARRAYS) - {"mapped"}
    for name, array in arrays_of(rows).items():
        assert array.size, name
        assert rows.get(name).shape[ARRAYS[name].axis] == 3, name


def unpickled(rows):
    made = pickle.loads(pickle.dumps(rows))
    made.open(rows.layout)
    return made


@pytest.mark.parametrize("copied", [lambda rows: rows.copy(), unpickled])
def test_copies_have_arrays_of_their_own(rows, copied):
    made = copied(rows)
    for name, array in arrays_of(rows).items():
        assert not np.shares_memory(array, getattr(made, name)), name
        np.testing.assert_array_equal(array, getattr(made, name))
    before = rows.named.target.copy()
    made.named.target[:] += 1.0
    np.testing.assert_array_equal(rows.named.target, before)
    np.testing.assert_array_equal(made.episode[made.layout.rows("target")][0], before + 1.0)


def test_all_that_kernels_write_is_declared(rows):
    """A step of a batch changes no other array but those that hold starts, plans of pushes and actions."""
    envs = gym.make_vec("hoof_env/HorseLegSpeed-v0", num_envs=3, **ALL).unwrapped
    envs.reset(seed=0)
    batch = envs.batch
    batch.rows.actions[:] = 0.5
    before = {name: array.copy() for name, array in arrays_of(batch.rows).items()}
    for _ in range(3):  # an action acts after a step and a half
        batch.calls.step(batch.calls.held)
    changed = {
        name for name, array in arrays_of(batch.rows).items() if not np.array_equal(array, before[name])
    }
    assert changed == {name for name, declared in ARRAYS.items() if declared.is_written} - {"mapped"}


def test_a_state_of_one_is_repeated_on_the_axis_of_the_rows(rows):
    for name, declared in ARRAYS.items():
        if declared.is_saved:
            one = np.take(rows.get(name), [1], declared.axis)
            many = repeated(name, one, 4)
            assert many.shape[declared.axis] == 4
            assert all(np.array_equal(np.take(many, [k], declared.axis), one) for k in range(4))


@given(st.sets(st.integers(0, 4), max_size=5), st.booleans())
def test_a_block_changes_only_the_rows_that_it_may(allowed, fails):
    first, last = np.zeros((5, 2)), np.zeros((3, 5))
    may = np.array(sorted(allowed), np.int64)

    def block():
        with only(may, 5, [(first, 0), (last, -1)]):
            first[:] = 1.0
            last[:] = 2.0
            if fails:
                raise KeyboardInterrupt

    if fails:
        with pytest.raises(KeyboardInterrupt):
            block()
    else:
        block()
    for row in range(5):
        assert (first[row] == float(row in allowed)).all()
        assert (last[:, row] == 2.0 * (row in allowed)).all()


def test_a_deep_copy_of_an_environment_shares_its_plan():
    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    env.reset(seed=0)
    made = copy.deepcopy(env)
    assert made.batch.plan is env.batch.plan
    assert made.batch.rows is not env.batch.rows
    assert pickle.loads(pickle.dumps(env)).batch.plan.asked == env.settings

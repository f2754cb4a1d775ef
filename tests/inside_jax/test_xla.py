"""Steps inside `jax.jit`: the bits of `step`, restarts, what Python may do in between, and refusals.
`make test-jax` runs this."""

import copy
import gc
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError

from hoof_env import ParameterError

jax = pytest.importorskip("jax", reason="jax is no part of the environment of set-up: make test-jax")
jnp = jax.numpy

SMALLEST = np.finfo(np.float32).tiny


def doubles():
    return jax.enable_x64(True) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64()


def make(id="HorseLeg", num_envs=3, **arguments):
    return gym.make_vec(f"hoof_env/{id}-v0", num_envs=num_envs, **arguments).unwrapped


def policy(envs, scale):
    """Weights of a linear policy."""
    sizes = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    return (np.random.default_rng(0).normal(size=sizes) * scale).astype(np.float32)


def rolled(step, weights, count):
    """A compiled function that takes `count` steps of a policy, and returns actions and states of each."""

    def body(carry, _):
        handle, observations = carry
        actions = jnp.tanh(observations @ weights)
        handle, states = step(handle, actions)
        return (handle, states.observations), (actions, states)

    return jax.jit(lambda handle, observations: jax.lax.scan(body, (handle, observations), length=count))


def check_same(envs, actions, states):
    """Check that `step` gives the same bits; return how many episodes ended."""
    ended = 0
    for t, each in enumerate(np.asarray(actions)):
        observations, rewards, terminated, truncated, infos = envs.step(each)
        np.testing.assert_array_equal(
            np.asarray(states.observations[t]).view(np.uint32), observations.view(np.uint32)
        )
        kind = states.rewards.dtype
        np.testing.assert_array_equal(np.asarray(states.rewards[t]), rewards.astype(kind))
        np.testing.assert_array_equal(states.terminated[t], terminated)
        np.testing.assert_array_equal(states.truncated[t], truncated)
        if "final_obs" in states.infos:
            last = np.asarray(states.infos["final_obs"][t])
            for env, done in enumerate(terminated | truncated):
                wanted = infos["final_obs"][env] if done else observations[env]
                np.testing.assert_array_equal(last[env], wanted)
        for name in set(states.infos) - {"final_obs"}:
            of_step = infos.get("final_info", infos)[name] if name in infos else infos[name]
            np.testing.assert_array_equal(states.infos[name][t], of_step.astype(np.float32))
        ended += int((terminated | truncated).sum())
    return ended


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
@pytest.mark.parametrize(
    ("id", "count", "settings"),
    [
        pytest.param("HorseLeg", 9, {"episode_seconds": 0.5}, marks=pytest.mark.smoke),
        ("HorseLegSpeed", 3, {"episode_seconds": 0.5, "target_seconds": 0.2}),
        ("HorseLeg", 3, {"push_seconds": 0.2, "push_impulse": 40.0, "episode_seconds": 0.5}),
        ("HorseLegTerrain", 3, {"episode_seconds": 0.4}),
        ("HorseLegBalance", 3, {"episode_seconds": 0.4}),
        ("HorseLegBalanceSpeed", 3, {"episode_seconds": 0.4, "target_seconds": 0.2}),
        ("HorseRough", 2, {"episode_seconds": 0.3}),
        ("HorseLegMO", 3, {"episode_seconds": 0.4}),
        ("HorseLeg", 16, {"episode_seconds": 0.4, "num_threads": 2}),
        ("HorseLegFixed", 2, {"episode_seconds": 0.2, "solver": "paper"}),
    ],
)  # fmt: skip
def test_steps_have_the_bits_of_step(id, count, settings, mode):
    envs, twin = (make(id, count, autoreset_mode=mode, **settings) for _ in range(2))
    first, _ = envs.reset(seed=4)
    twin.reset(seed=4)
    handle, recv, _, step = envs.xla()
    handle, states = recv(handle)
    np.testing.assert_array_equal(states.observations, first)
    _, (actions, states) = rolled(step, policy(envs, 0.5), 60)(handle, states.observations)
    assert check_same(twin, actions, states) > count


def test_numbers_below_the_normal_ones_stay():
    """XLA's threads take them for 0."""
    envs, twin = make(num_envs=16), make(num_envs=16)
    first, _ = envs.reset(seed=0)
    twin.reset(seed=0)
    handle, _, _, step = envs.xla()
    _, (actions, states) = rolled(step, policy(envs, 0.1), 300)(handle, first)
    seen = np.abs(np.asarray(states.observations))
    assert ((seen > 0.0) & (seen < SMALLEST)).any()
    check_same(twin, actions, states)


def test_the_thread_takes_them_for_zero_again_afterwards():
    """In one program: what XLA computes after a step is what it computes without one."""
    envs = make()
    envs.reset(seed=0)
    handle, _, _, step = envs.xla()
    tiny = jnp.full(3, 1e-39, jnp.float32)

    def product(x):
        return x * jnp.float32(2.0)

    def after(handle, x):
        handle, states = step(handle, jnp.zeros((3, envs.single_action_space.shape[0])))
        return product(x + states.rewards * 0.0)

    def alone(x):
        return product(x + jnp.zeros(3))

    np.testing.assert_array_equal(jax.jit(after)(handle, tiny), jax.jit(alone)(tiny))


def test_send_and_recv_are_a_step():
    envs, twin = make(), make()
    for each in (envs, twin):
        each.reset(seed=1)
    handle, recv, send, _ = envs.xla()
    handle_of_twin, _, _, step = twin.xla()
    actions = np.full((3, envs.single_action_space.shape[0]), 0.3)
    handle, states = recv(send(handle, actions))
    handle_of_twin, others = step(handle_of_twin, actions)
    jax.tree.map(np.testing.assert_array_equal, states, others)
    assert np.asarray(handle).view(np.int64)[1] == 2


def test_python_may_do_anything_in_between():
    """Resets, settings, pushes, states and steps of Python, with a handle from before."""
    envs, twin = make(), make()
    handle, recv, _, step = envs.xla()
    step = jax.jit(step)
    actions = np.full((3, envs.single_action_space.shape[0]), 0.2, np.float32)

    def same():
        nonlocal handle
        for _ in range(3):
            handle, states = step(handle, actions)
            observations, rewards, terminated, *_ = twin.step(actions)
            np.testing.assert_array_equal(states.observations, observations)
            np.testing.assert_array_equal(states.rewards, rewards.astype(np.float32))
            np.testing.assert_array_equal(states.terminated, terminated)

    for each in (envs, twin):
        each.reset(seed=2)
    same()
    for each in (envs, twin):
        each.push(30.0, 0.0)
    same()
    kept = twin.get_state()
    same()
    for each in (envs, twin):
        each.set_state(kept)
    same()
    for each in (envs, twin):
        each.change_settings(restitution=0.05, envs=[1])
        each.reset(options={"reset_mask": np.array([False, True, True])})
    same()
    for each in (envs, twin):
        each.record(0)
    same()
    for name, values in envs.record(0).items():
        np.testing.assert_array_equal(values, twin.record(0)[name])
    for each in (envs, twin):
        each.step(actions)
    same()
    np.testing.assert_array_equal(recv(handle)[1].observations, twin._observed())


def test_rewards_are_those_of_step_where_jax_has_doubles():
    envs, twin = make(), make()
    for each in (envs, twin):
        each.reset(seed=0)
    with doubles():
        handle, _, _, step = envs.xla()
        actions = np.zeros((3, envs.single_action_space.shape[0]))
        _, states = jax.jit(step)(handle, actions)
        assert states.rewards.dtype == np.float64
        np.testing.assert_array_equal(states.rewards, twin.step(actions.astype(np.float32))[1])


def test_costs_are_infos():
    arguments = {"cost": {"peak": 100.0, "excess": 50.0}, "episode_seconds": 0.3}
    envs, twin = make(**arguments), make(**arguments)
    first, _ = envs.reset(seed=0)
    twin.reset(seed=0)
    handle, _, _, step = envs.xla()
    _, (actions, states) = rolled(step, policy(envs, 0.5), 12)(handle, first)
    assert set(states.infos) == {"cost_peak", "cost_excess"}
    assert (np.asarray(states.infos["cost_peak"]) > 0.0).any()
    check_same(twin, actions, states)


def test_functions_stay_the_same_so_that_nothing_is_compiled_again():
    envs = make()
    one, other = envs.xla(), envs.xla()
    assert one[1:] == other[1:]


# Refusals


def fails(pattern, function, *arguments):
    """Check that a call fails inside XLA with words."""
    with pytest.raises(Exception, match=pattern) as caught:
        jax.block_until_ready(function(*arguments))
    assert "Error" in type(caught.value).__name__


def zeros(envs):
    return np.zeros((envs.num_envs, envs.single_action_space.shape[0]), np.float32)


def test_a_handle_is_used_once():
    envs = make()
    envs.reset(seed=0)
    old, _, _, step = envs.xla()
    step = jax.jit(step)
    step(old, zeros(envs))
    fails("expected the newest one.*xla\\(\\) gives the newest", step, old, zeros(envs))
    step(envs.xla()[0], zeros(envs))


def test_what_is_no_handle_is_refused_and_not_followed():
    """Zeros in its place, as templates of a learner's state have them; a part of one; another type."""
    envs = make()
    envs.reset(seed=0)
    handle, recv, send, step = envs.xla()
    words = r"expected the one that envs\.xla\(\) or the last call of these environments returned"
    actions = zeros(envs)
    for function in (recv, lambda x: send(x, actions), lambda x: step(x, actions)):
        fails(words + ".*such as zeros", jax.jit(function), jnp.zeros_like(handle))
        for wrong in (handle[:8], handle.astype(np.float32), None, 7):
            with pytest.raises(ParameterError, match=words):
                function(wrong)
    _, states = jax.jit(step)(handle, actions)
    assert np.isfinite(states.observations).all()


def test_a_handle_may_outlive_its_environments():
    """But the functions keep them alive."""
    envs, twin = make(), make()
    envs.reset(seed=0)
    handle, _, _, step = envs.xla()
    of_twin = twin.xla().step
    actions = zeros(envs)
    del envs
    gc.collect()
    handle, _ = step(handle, actions)
    del step
    gc.collect()
    fails("got another environment's", of_twin, handle, actions)


def test_actions_must_be_finite_and_nothing_is_advanced():
    envs = make()
    envs.reset(seed=0)
    handle, _, _, step = envs.xla()
    before = envs.get_state()["engine"]
    wrong = zeros(envs)
    wrong[1, 0] = np.nan
    fails(r"expected finite numbers in \[-1, 1\], got NaN or infinity in rows \[1\]", step, handle, wrong)
    for name, values in envs.get_state()["engine"].items():
        np.testing.assert_array_equal(values, before[name])
    step(envs.xla()[0], zeros(envs))


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((3, 1)),
        np.zeros((2, 4)),
        np.zeros((3, 4), bool),
        [[0.0] * 4] * 2,
        [[0.0] * 4, [0.0]],
        {},
        None,
    ],
)
def test_actions_of_another_shape_or_type_are_refused(wrong):
    envs = make()
    envs.reset(seed=0)
    handle, _, send, step = envs.xla()
    for function in (send, step):
        with pytest.raises(ParameterError, match=r"actions: expected .* shape \(3, 4\), got"):
            function(handle, wrong)
    with pytest.raises(ParameterError, match="env_id: expected None"):
        step(handle, zeros(envs), np.arange(3))
    _, states = step(handle, zeros(envs).tolist())
    assert np.isfinite(states.observations).all()


def test_steps_before_a_reset_or_after_the_end_or_close_are_refused():
    envs = make(autoreset_mode="DISABLED", episode_seconds=0.04)
    handle, _, _, step = envs.xla()
    fails("step\\(\\) was called before reset\\(\\)", step, handle, zeros(envs))
    envs.reset(seed=0)
    handle, _ = step(envs.xla()[0], zeros(envs))
    handle, states = step(handle, zeros(envs))
    assert states.truncated.all()
    fails("episodes \\[0, 1, 2\\] ended", step, handle, zeros(envs))
    envs.reset()
    step(envs.xla()[0], zeros(envs))
    handle, *_ = envs.xla()
    envs.close()
    fails("was called after close", step, handle, zeros(envs))
    with pytest.raises(ClosedEnvironmentError):
        envs.xla()


def test_a_step_that_was_interrupted_asks_for_a_reset(monkeypatch):
    envs = make(episode_seconds=0.02)
    envs.reset(seed=0)
    handle, _, _, step = envs.xla()

    def interrupt(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as during:
        during.setattr(envs.batch, "end_step", interrupt)
        fails("KeyboardInterrupt", step, handle, zeros(envs))
    fails("expected reset", step, envs.xla()[0], zeros(envs))
    envs.reset()
    step(envs.xla()[0], zeros(envs))


def test_vmap_and_several_devices_are_refused():
    envs = make()
    envs.reset(seed=0)
    handle, recv, _, step = envs.xla()
    with pytest.raises(ParameterError, match=r"vmap over 2: .* hoof_env.jax.make\(id\)"):
        jax.vmap(step, (None, 0))(handle, np.stack([zeros(envs)] * 2))
    with pytest.raises(ParameterError, match="vmap over 2"):
        jax.vmap(recv)(np.stack([handle] * 2))


TWO_DEVICES = """
import gymnasium as gym, jax, numpy as np, hoof_env
envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=3).unwrapped
envs.reset(seed=0)
handle, _, _, step = envs.xla()
actions = np.zeros((3, 4), np.float32)
try:
    jax.block_until_ready(jax.pmap(step)(np.stack([handle] * 2), np.stack([actions] * 2)))
except Exception as error:
    print(error)
"""


def test_on_two_devices_the_second_is_refused(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_force_host_platform_device_count=2")
    done = subprocess.run([sys.executable, "-c", TWO_DEVICES], capture_output=True, text=True, timeout=300)
    assert "run the step on one" in done.stdout, done.stderr


def test_a_gradient_is_refused():
    envs = make()
    envs.reset(seed=0)
    handle, _, _, step = envs.xla()
    with pytest.raises(ParameterError, match=r"no gradient.*hoof_env.jax.make\(id\)"):
        jax.grad(lambda actions: step(handle, actions)[1].rewards.sum())(zeros(envs))


def test_copies_and_pickles_have_steps_of_their_own():
    envs = make()
    envs.reset(seed=0)
    handle, _, _, step = envs.xla()
    for twin in (copy.deepcopy(envs), pickle.loads(pickle.dumps(envs))):
        _, states = twin.xla().step(twin.xla()[0], zeros(twin))
        assert states.observations.shape == (3, 22)
    _, others = step(handle, zeros(envs))
    np.testing.assert_array_equal(states.observations, others.observations)


@pytest.mark.parametrize("other", ["hoof_env/HorseLegRail-v0", "hoof_env/Horse-v0"])
def test_a_handle_of_other_environments_is_refused(other):
    """Its arrays have other sizes: followed, it would be read and written beyond their ends."""
    envs, others = make(), gym.make_vec(other, num_envs=3).unwrapped
    for each in (envs, others):
        each.reset(seed=0)
    handle, recv, _, step = envs.xla()
    foreign = others.xla()[0]
    actions = np.zeros((3, envs.single_action_space.shape[0]), np.float32)
    with pytest.raises(Exception, match=r"expected the one .*of these environments"):
        jax.block_until_ready(jax.jit(step)(foreign, actions))
    with pytest.raises(Exception, match=r"expected the one .*of these environments"):
        jax.block_until_ready(recv(foreign))
    _, states = step(handle, actions)  # nothing has happened to them
    assert np.isfinite(states.observations).all()

"""`hoof_env.jax.make`: the same numbers as the kernels, gradients, resets, and refusals. `make test-jax` runs
this; compiling takes most of the time."""

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env import ParameterError
from hoof_env.envs.xla import OLDEST
from hoof_env.tasks import registry

jax = pytest.importorskip("jax", reason="jax is no part of the environment of set-up: make test-jax")
jnp = jax.numpy

STEPS = 50
STARTS = 20
CLOSE = 1e-9


@pytest.fixture(autouse=True)
def doubles():
    """JAX with doubles, in these tests only."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


def make(id, **settings):
    import hoof_env.jax

    return hoof_env.jax.make(full(id), **{"starts": 4, **settings})


def full(id):
    """The whole of an id of the package, or one's own as it is."""
    return id if "/" in id else f"hoof_env/{id}-v0"


def stepped(env):
    """A compiled step of many episodes."""
    return jax.jit(jax.vmap(env.step_env))


def largest_differences(id, steps=STEPS, **settings):
    """Differences from the kernels over some steps from the same starts: of forces by the weight, of all
    other numbers in the memory by their size, of rewards and their terms, and of observations; the number of
    steps, of which the last is the first in which an episode ends; and the terms that were not 0."""
    env, _ = make(id, **settings)
    state = env.params_of(range(STARTS)).starts
    envs = gym.make_vec(full(id), num_envs=STARTS, autoreset_mode="DISABLED", **settings).unwrapped
    observations, _ = envs.reset(seed=0)
    np.testing.assert_array_equal(state.observation, observations)
    step, keys = stepped(env), jax.random.split(jax.random.key(0), STARTS)
    generator = np.random.default_rng(1)
    memory, shape = envs.engine.arrays[0], envs.action_space.shape
    names = [k for k, name in enumerate(env.engine_names) if name.endswith(("_normal", "_friction"))]
    assert names
    found, charged = np.zeros(4), set()
    ended = np.zeros(STARTS, bool)
    for k in range(steps):
        if k % 5 == 0:
            actions = generator.uniform(-1, 1, shape).astype(np.float32)
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        seen, state, reward, done, info = step(keys, state, actions)
        np.testing.assert_array_equal(info["terminated"], terminated)
        np.testing.assert_array_equal(info["truncated"], truncated)
        np.testing.assert_array_equal(done, terminated | truncated)
        now = memory[:, :STARTS].T
        ended = np.asarray(done)
        apart = np.abs(np.asarray(state.engine) - now)[~ended]
        terms = {name: infos[name] for name in env.terms}
        charged |= {name for name, values in terms.items() if values.any()}
        of_terms = [np.abs(info["terms"][name] - values).max() for name, values in terms.items()]
        here = (
            (apart[:, names] / envs.weight[~ended, None]).max(initial=0.0),
            (apart / (1.0 + np.abs(now[~ended]))).max(initial=0.0),
            max(np.abs(reward - rewards).max(), *of_terms),
            np.abs(seen - observations)[~ended].max(initial=0.0),
        )
        found = np.maximum(found, here)
        if ended.any():
            break
    return found, k + 1, charged


@pytest.mark.parametrize(
    "id",
    [
        "HorseLeg",
        "HorseLegRail",
        pytest.param("HorseLegFixed", marks=pytest.mark.smoke),
        "HorseLegSpeed",
        "HorseLegTerrain",
        "Horse",
    ],
)
def test_the_first_second_is_that_of_the_kernels(id):
    found, count, _ = largest_differences(id)
    print(id, count, found)
    assert count == STEPS
    assert (found[:3] < CLOSE).all(), found
    assert found[3] <= 2.0**-20  # single numbers


@pytest.mark.parametrize("id", ["HorseLegHop", "HorseLegBalance", "HorseLegBalanceSpeed"])
def test_the_first_second_of_a_hop_is_that_of_the_kernels_until_a_leg_falls(id):
    found, count, _ = largest_differences(id)
    print(id, count, found)
    assert 10 <= count < STEPS  # and falls in the same step
    assert (found[:3] < CLOSE).all(), found
    assert found[3] <= 2.0**-20


def test_delays_histories_noise_and_motors_are_those_of_the_kernels():
    found, count, _ = largest_differences(
        "HorseLeg", 30, action_delay=1.5, observation_delay=1, observation_history=2, last_actions=2,
        noise={"trunk": 0.1}, drive="motor", hoof_stiffness=2e5, randomize={"friction": (0.2, 0.5)},
        episode_seconds=0.5,
    )  # fmt: skip
    assert count == 25  # and truncated together
    assert (found[:3] < CLOSE).all(), found
    assert found[3] <= 2.0**-20


def test_booms_contexts_and_sensors_are_those_of_the_kernels():
    groups = gym.make("hoof_env/HorseLeg-v0").unwrapped.settings.observation
    found, count, _ = largest_differences(
        "HorseLeg", 30, trunk="boom", context_set="ground/train", context_visible=True,
        observation=(*groups, "pressure"), force_threshold=40.0,
    )  # fmt: skip
    print("boom", count, found)
    assert count >= 10
    assert (found[:3] < CLOSE).all(), found
    assert found[3] <= 2.0**-20


def slide(step, weight):
    """Return the speed of the loaded toe along the ground [m/s]."""
    toe = step.leg.report.toe
    return weight * np.where(toe.normal > 0.0, abs(toe.slide), 0.0)


@pytest.fixture
def own_id():
    """An id with terms, a state, a cost, constants, entries, a law of contact and actions of its own."""
    from examples import own_actions, own_task  # noqa: F401 - registers my_lab/Turf-v0

    known, own = dict(gym.registry), dict(registry._OWN)
    state = hoof_env.TermState("highest", 0.0, "N", "highest force of the episode")
    hoof_env.register(
        "tests/Own-v0",
        base="my_lab/Turf-v0",
        action_map=own_actions.STEPS,
        terms=[
            hoof_env.Term(
                "impact", 0.5, "1/kN", "rise of the highest force", own_actions.impact,
                constants=[own_actions.FREE], state=[state],
            ),
            hoof_env.Term("slide", 1.0, "s/m", "a toe that slides", slide, is_cost=True),
        ],
        entries=[
            hoof_env.Entry(
                "highest force so far", "own", "-", own_actions.highest_so_far,
                hoof_env.Scale("tanh(x)", saturates=True), constants=[own_actions.FREE],
            )
        ],
    )  # fmt: skip
    yield "tests/Own-v0"
    for kept, before in ((gym.registry, known), (registry._OWN, own)):
        kept.clear()
        kept.update(before)


def test_functions_of_a_user_are_those_of_the_kernels(own_id):
    found, count, charged = largest_differences(own_id, 30, constants={"free": 700.0})
    print(own_id, count, found)
    assert count == 30
    assert (found[:3] < CLOSE).all(), found
    assert found[3] <= 2.0**-20
    assert {"reward_friction", "reward_comfort", "reward_impact", "cost_slide"} <= charged


def test_a_gradient_through_ten_steps_equals_differences():
    """Central ones: below a step of 1e-4 their round-off grows, above it their own error."""
    env, params = make("HorseLeg")
    state = jax.tree.map(lambda array: array[0], params.starts)
    key = jax.random.key(0)

    @jax.jit
    def travel(action, state=state):
        def step(state, _):
            _, state, reward, _, _ = env.step_env(key, state, action)
            return state, reward

        return jax.lax.scan(step, state, length=10)[1].sum()

    action = jnp.array([0.3, -0.2, 0.1, 0.25])
    value, slope = jax.value_and_grad(travel)(action)
    assert np.isfinite(value)
    assert (slope != 0.0).all()
    small = 1e-4
    for k, unit in enumerate(np.eye(4)):
        by_differences = (travel(action + small * unit) - travel(action - small * unit)) / (2 * small)
        np.testing.assert_allclose(slope[k], by_differences, rtol=1e-6)


def test_derivatives_by_the_state_are_the_same_backward_and_forward():
    """In contact and above the ground: backward, a branch that is not chosen must not make them NaN."""
    env, params = make("HorseLeg", starts=STARTS)
    state, action = params.starts, jnp.zeros(env.num_actions)
    along = jax.random.normal(jax.random.key(2), state.engine.shape[1:])

    def reward(engine, state):
        return env.step_env(jax.random.key(0), state._replace(engine=engine), action)[2]

    @jax.jit
    @jax.vmap
    def both(state):
        slope = jax.grad(reward)(state.engine, state)
        return slope @ along, jax.jvp(lambda x: reward(x, state), (state.engine,), (along,))[1]

    backward, forward = both(state)
    assert np.isfinite(backward).all()
    assert (np.abs(backward) > 0.0).all()
    np.testing.assert_allclose(backward, forward, rtol=1e-9, atol=1e-9)


def test_an_episode_that_ends_starts_again():
    env, params = make("HorseLegSpeed", episode_seconds=0.1, target_seconds=0.04)
    weights = gym.make("hoof_env/HorseLegSpeed-v0").unwrapped.weights
    step = jax.jit(jax.vmap(env.step, (0, 0, 0, None)))
    keys = jax.random.split(jax.random.key(1), 6)
    observations, state = jax.vmap(env.reset, (0, None))(keys, params)
    starts = {tuple(row) for row in np.asarray(params.starts.observation)}
    assert {tuple(row) for row in np.asarray(observations)} <= starts
    targets = [np.asarray(state.episode[:, env.episode_rows["target"]])]
    for k in range(1, 11):
        keys = jax.vmap(lambda key: jax.random.split(key)[0])(keys)
        observations, state, rewards, done, info = step(keys, state, jnp.zeros((6, 4)), params)
        assert (np.asarray(done) == (k % 5 == 0)).all()
        assert observations.dtype == jnp.float32
        if k % 5 == 0:
            assert {tuple(row) for row in np.asarray(observations)} <= starts
            assert not np.array_equal(info["final_obs"], observations)
        np.testing.assert_allclose(sum(info["terms"].values()), rewards, rtol=1e-12)
        for name, weight in weights.items():
            np.testing.assert_allclose(
                info["terms"][f"reward_{name}"], weight * info["unweighted"][name], rtol=1e-12
            )
        targets.append(np.asarray(state.episode[:, env.episode_rows["target"]]))
    assert len(np.unique(np.concatenate(targets[:5]))) > 6  # other speeds are commanded within an episode
    low, high = 0.5, 5.0
    assert (np.concatenate(targets) > low).all() & (np.concatenate(targets) < high).all()


def test_single_precision_is_near():
    env, params = make("HorseLeg", dtype="float32")
    other, others = make("HorseLeg")
    key = jax.random.key(0)
    state, twin = (jax.tree.map(lambda array: array[0], each.starts) for each in (params, others))
    step, step_of_other = jax.jit(env.step_env), jax.jit(other.step_env)
    for _ in range(10):
        observation, state, reward, _, _ = step(key, state, jnp.full(4, 0.2, jnp.float32))
        wanted, twin, reward_of_other, _, _ = step_of_other(key, twin, jnp.full(4, 0.2))
    assert state.engine.dtype == reward.dtype == jnp.float32
    np.testing.assert_allclose(observation, wanted, atol=2e-3)
    np.testing.assert_allclose(reward, reward_of_other, atol=2e-3)


@pytest.mark.parametrize(
    ("id", "settings", "words"),
    [
        ("HorseRough", {}, "push_impulse.*give push_impulse=None"),
        ("HorseLeg", {"pushes": [(0.1, 5.0, 0.0)]}, "pushes: expected None"),
        ("HorseLegFixed", {"solver": "paper"}, "solver: expected .*paper"),
        ("HorseLeg", {"cost": {"peak": 1.0}}, "cost: expected None"),
        ("HorseLeg", {"action_delay": (0, 2)}, "action_delay: expected one number"),
        ("HorseLeg", {"schedule": {"friction": (0.1, 0.4, 100)}}, "schedule"),
        ("HorseLegMO", {}, "id: expected an id with one reward, got .*HorseLegMO-v0.*take .*HorseLeg-v0"),
        ("HorseSafe", {}, "cost: expected None"),
        ("Nothing", {}, "id: expected one of .*HorseLeg-v0"),
        ("my_lab/Nothing-v0", {}, "expected one of .*got 'my_lab/Nothing-v0'"),
        ("HorseLeg", {"dtype": "int32"}, "dtype: expected float32 or float64"),
        ("HorseLeg", {"starts": 0}, "starts"),
        ("HorseLeg", {"friction": -1.0}, "friction"),
    ],
)
def test_what_is_missing_is_refused_by_name(id, settings, words):
    with pytest.raises(ParameterError, match=words):
        make(id, **settings)


def test_doubles_are_refused_where_jax_has_none():
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(ParameterError, match=r"jax\.config\.update\('jax_enable_x64', True\)"):
        make("HorseLeg", dtype="float64")
    env, params = make("HorseLeg")
    assert params.starts.engine.dtype == jnp.float32
    assert env.dt == 0.02


@pytest.mark.parametrize(
    ("action", "got"),
    [
        (np.zeros((2, 4)), r"float64 of shape \(2, 4\)"),
        (np.zeros(3), r"float64 of shape \(3,\)"),
        (np.zeros(4, bool), r"bool of shape \(4,\)"),
        (np.zeros(4, complex), "complex"),
        ([0.0, [0.0, 0.0], 0.0, 0.0], r"\[0.0, \[0.0, 0.0\]"),
        (["a", "b", "c", "d"], "'a'"),
        ({"action": 0.0}, "'action'"),
        (None, "None"),
    ],
    ids=str,
)
def test_actions_of_another_kind_are_refused_in_words(action, got):
    env, params = make("HorseLeg")
    state = jax.tree.map(lambda array: array[0], params.starts)
    for step in (env.step_env, env.step):
        with pytest.raises(
            ParameterError, match=rf"action: expected .*shape \(4,\).*jax.vmap.*, got .*{got}"
        ):
            step(jax.random.key(0), state, action, params)


def test_a_list_of_traced_numbers_is_an_action():
    env, params = make("HorseLegFixed")
    state = jax.tree.map(lambda array: array[0], params.starts)
    key = jax.random.key(0)
    observation, *_ = jax.jit(lambda x: env.step_env(key, state, [x, 0.0, 0, -x]))(0.5)
    wanted, *_ = jax.jit(lambda action: env.step_env(key, state, action))(jnp.array([0.5, 0.0, 0.0, -0.5]))
    np.testing.assert_array_equal(observation, wanted)


def test_an_old_jax_is_refused(monkeypatch):
    from hoof_env.envs import xla

    monkeypatch.setattr(jax, "__version_info__", (0, 4, 38))
    monkeypatch.setattr(jax, "__version__", "0.4.38")
    with pytest.raises(hoof_env.errors.MissingExtraError, match=r"jax 0\.5\.0 or later, got 0\.4\.38"):
        xla.loaded_jax.__wrapped__()
    assert OLDEST == (0, 5, 0)

"""Policies by whatever names them: each plays as it should, and what does not fit says why."""

import sys
import warnings
import zipfile

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env.envs.policies import STANDS_FOR, make_policy
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError
from hoof_env.policies.find import find_policy, shipped_ids
from hoof_env.policies.plain import read_tensors

ENV_ID = "hoof_env/HorseLeg-v0"
PLAIN = ("policy.json", "policy.safetensors", "run.json")


@pytest.fixture(scope="module")
def env():
    with gym.make(ENV_ID) as env:
        yield env


def act(observations):
    return -0.1 * observations[:, :4]


def test_a_policy_ships_for_every_id():
    assert shipped_ids() == sorted(name for name in gym.registry if name.startswith("hoof_env/"))


@pytest.mark.parametrize("env_id", shipped_ids())
def test_numpy_plays_what_ships_as_onnx_does(env_id):
    pytest.importorskip("onnxruntime")
    from agents.cards import POLICIES

    policy = hoof_env.load_policy(env_id)
    exported = hoof_env.load_policy(POLICIES / env_id.removeprefix("hoof_env/") / "policy.onnx")
    space = policy.observation_space
    space.seed(0)
    seen = np.stack([space.sample() for _ in range(500)])
    actions, state = policy.predict(seen)
    assert state is None
    assert actions.dtype == np.float32
    np.testing.assert_allclose(actions, exported.predict(seen)[0], rtol=0, atol=1e-6)
    np.testing.assert_array_equal([policy.predict(row)[0] for row in seen], actions)
    assert np.ptp(actions, axis=0).min() > 0.1
    assert np.abs(policy.predict(100 * seen)[0]).max() == 1.0


def test_a_layer_is_what_its_name_says(tmp_path):
    """Against the library of the format, with more than one tensor and an odd shape."""
    save_file = pytest.importorskip("safetensors.numpy").save_file
    tensors = {"b": np.arange(6, dtype=np.float32).reshape(2, 3), "a": np.float32([[0.5]])}
    save_file(tensors, tmp_path / "w.safetensors", metadata={"made": "here"})
    found = read_tensors(tmp_path / "w.safetensors")
    assert found.keys() == tensors.keys()
    for name, numbers in tensors.items():
        np.testing.assert_array_equal(found[name], numbers)
    save_file({"a": np.float64([1.0])}, tmp_path / "w.safetensors")
    with pytest.raises(ValueError, match="F64, expected F32"):
        read_tensors(tmp_path / "w.safetensors")


def test_names_gaits_and_functions(env):
    observation, _ = env.reset(seed=0)
    gait = hoof_env.GaitParameters(6.28, 0.7, -0.2, -0.3)
    texts = {policy: hoof_env.load_policy(policy, env) for policy in ("run", "shipped", "6.28,0.7,-0.2,-0.3")}
    np.testing.assert_array_equal(
        texts["run"].predict(observation, episode_start=True)[0],
        make_policy("run", env).predict(observation, episode_start=True)[0],
    )
    wanted = texts["6.28,0.7,-0.2,-0.3"]
    for same in (gait, tuple(gait.to_array()), gait.to_array()):
        policy = hoof_env.load_policy(same, env)
        assert policy.start == wanted.start
        np.testing.assert_array_equal(policy.predict(observation)[0], wanted.predict(observation)[0])
    by_id = hoof_env.load_policy(ENV_ID, env)
    np.testing.assert_array_equal(by_id.predict(observation)[0], texts["shipped"].predict(observation)[0])
    for own in (act, f"{__name__}:act"):
        np.testing.assert_allclose(
            hoof_env.load_policy(own, env).predict(observation)[0], act(observation[None])[0]
        )
    assert not np.array_equal(
        *(hoof_env.load_policy("random", env, seed=seed).predict(observation)[0] for seed in (0, 1))
    )


def test_settings_that_differ_are_reported_and_the_default_ones_are_not():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with gym.make(ENV_ID) as env:
            hoof_env.load_policy("shipped", env)
    with gym.make(ENV_ID, friction=0.1) as env, pytest.warns(UserWarning, match=r"friction=0\.4, here 0\.1"):
        hoof_env.load_policy("shipped", env)


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        ("hoof_env/HorseLegRail-v0", "HorseLegRail-v0, expected hoof_env/HorseLeg-v0"),
        ("gallop", r"expected a name \(.*run.*open-loop, constant, shipped\).*got 'gallop'"),
        ((1.0, 2.0), r"expected four gait parameters, got \(1\.0, 2\.0\)"),
        ((1e3, 0.0, 0.0, 0.0), "crank_speed"),
        (["6.28", "0", "0", "x"], "crank_speed: expected a finite number .* got '6.28'"),
        ([[1], [2, 3], 4, 5], r"crank_speed: expected a finite number .* got \[1\]"),
        (np.array(3.0), "expected four gait parameters"),
        ([[1, 2, 3, 4]], "expected four gait parameters"),
        (3, "expected a name, a path, a gait or a function, got 3"),
        ("none.zip", r"none\.zip"),
        ("none.onnx", r"none\.onnx"),
        ("nothing:act", "expected MODULE:NAME, got 'nothing:act'"),
        ("", "expected a name .*, got ''"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(policy, words, env):
    with pytest.raises((ParameterError, DataFileError), match=words):
        hoof_env.load_policy(policy, env)


@pytest.mark.parametrize("seed", ["3", -1, 1.5, None])
def test_a_bad_seed_is_refused(seed, env):
    with pytest.raises(ParameterError, match=r"seed: expected .*0 .*got"):
        hoof_env.load_policy("random", env, seed=seed)


def test_arguments_other_than_a_single_environment_are_refused(env):
    """An id, arguments in the other order, and a vector environment."""
    envs = hoof_env.HorseLegVectorEnv(2)
    for policy, given in (("shipped", ENV_ID), (env, "shipped"), ("shipped", envs)):
        with pytest.raises(ParameterError, match=r"env: expected a single environment.*load_policy\("):
            hoof_env.load_policy(policy, given)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return 1 / 0", r"ZeroDivisionError in mine\.py, line 3: division by zero"),
        ("return rows.missing", r"AttributeError in mine\.py, line 3: .*'missing'"),
        ("return ['a'] * len(rows)", r"expected finite actions of shape \(1, 4\), got \['a'\]"),
        ("return rows[:, :4], None", r"expected finite actions of shape \(1, 4\), got \(array\(.*, None\)"),
        ("return {'action': rows[:, :4]}", r"expected finite actions .*, got \{'action': array"),
        ("return rows[:, :3]", r"expected finite actions of shape \(1, 4\) .* got shape \(1, 3\)"),
        ("return rows[:, :4] * np.nan", "4 that are not finite"),
    ],
)
def test_what_fails_in_a_function_of_the_user_is_reported_with_its_line(
    body, words, env, tmp_path, monkeypatch
):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mine.py").write_text(f"import numpy as np\ndef act(rows):\n    {body}\n")
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    policy = hoof_env.load_policy("mine:act", env)
    with pytest.raises(ParameterError, match=f"policy mine:act: .*{words}"):
        policy.predict(np.zeros(22))


def test_a_module_of_the_user_that_fails_is_reported_with_its_line(env, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "licensed.py").write_text("raise RuntimeError('no licence')\n")
    words = r"got 'licensed:act'; RuntimeError in licensed\.py, line 1: no licence"
    with pytest.raises(ParameterError, match=words):
        hoof_env.load_policy("licensed:act", env)


@pytest.mark.parametrize("observation", ["x", None, ["a"] * 22, [[1], [2, 3]]])
def test_observations_without_numbers_are_refused(observation):
    with pytest.raises(ParameterError, match=r"observation: expected (numbers|shape) .*HorseLeg-v0.*got"):
        hoof_env.load_policy("hoof_env/HorseLeg-v0").predict(observation)


def test_a_function_may_change_its_observations_and_not_ours(env):
    def greedy(observations):
        observations[:] = 9.0
        return observations[:, :4]

    seen = np.linspace(-1, 1, 22, dtype=np.float32)
    kept = seen.copy()
    np.testing.assert_array_equal(hoof_env.load_policy(greedy, env).predict(seen)[0], np.full(4, 9.0))
    np.testing.assert_array_equal(seen, kept)


@pytest.mark.filterwarnings("ignore:.*pickle")
@pytest.mark.parametrize("algo", ["PPO", "A2C", "SAC", "TD3", "TQC"])
def test_a_zip_of_any_algorithm_is_played_without_a_record(algo, env, tmp_path):
    """As `model.save` writes it, without a folder of agents.train around it."""
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    module = pytest.importorskip("sb3_contrib") if algo == "TQC" else stable_baselines3
    few = {} if algo in ("PPO", "A2C") else {"buffer_size": 10}
    small = {"net_arch": [8]}
    model = getattr(module, algo)("MlpPolicy", env, policy_kwargs=small, device="cpu", seed=0, **few)
    model.save(tmp_path / "mine.zip")
    seen = np.linspace(-1, 1, 22, dtype=np.float32)
    played = hoof_env.load_policy(tmp_path / "mine.zip", env).predict(seen)[0]
    np.testing.assert_array_equal(played, model.predict(seen, deterministic=True)[0])


@pytest.mark.filterwarnings("ignore:.*pickle")
def test_a_zip_without_a_model_gives_one_error(env, tmp_path):
    pytest.importorskip("stable_baselines3")
    path = tmp_path / "mine.zip"
    for name, content in (("a.txt", "x"), ("data", "["), ("data", "{}"), ("data", "3")):
        with zipfile.ZipFile(path, "w") as file:
            file.writestr(name, content)
        with pytest.raises(DataFileError, match=r"mine\.zip: expected a model saved by Stable-Baselines3"):
            hoof_env.load_policy(path, env)


def test_what_needs_an_environment_says_so():
    for policy in ("run", "shipped", act, (6.28, 0.7, -0.2, -0.3)):
        with pytest.raises(
            ParameterError, match=r"expected the environment, too, load_policy\(policy, env\)"
        ):
            hoof_env.load_policy(policy)


def test_an_observation_of_another_size_is_refused():
    with pytest.raises(ParameterError, match=r"expected shape \(\.\.\., 22\) .*got \(19,\)"):
        hoof_env.load_policy(ENV_ID).predict(np.zeros(19))


def test_damaged_weights_are_one_error(tmp_path, env):
    for name in PLAIN:
        (tmp_path / name).write_bytes((hoof_env.load_policy(ENV_ID).path / name).read_bytes())
    hoof_env.load_policy(tmp_path, env)
    whole = (tmp_path / "policy.safetensors").read_bytes()
    from hoof_env.policies.plain import NumpyPolicy

    for damaged in (b"", whole[:4], whole[:200], whole[:-8], whole[:-4] + np.float32(np.nan).tobytes()):
        (tmp_path / "policy.safetensors").write_bytes(damaged)
        with pytest.raises(DataFileError, match=r"policy\.json and policy\.safetensors"):
            NumpyPolicy(tmp_path)


def test_a_leg_made_without_gymnasium_takes_what_ships():
    with hoof_env.HorseLegEnv() as env:
        policy = hoof_env.load_policy(ENV_ID, env)
    assert policy.record["env_id"] == ENV_ID


def test_the_multi_objective_leg_has_the_policy_of_the_leg():
    (one, other) = next(iter(STANDS_FOR.items()))
    seen = np.linspace(-1, 1, 22)
    actions = [hoof_env.load_policy(env_id).predict(seen)[0] for env_id in (one, other)]
    np.testing.assert_array_equal(*actions)


def test_an_environment_of_another_package_has_no_scripted_policies():
    with (
        gym.make("Pendulum-v1") as env,
        pytest.raises(ParameterError, match="none is scripted for Pendulum-v1"),
    ):
        find_policy("run", env, "Pendulum-v1")


@pytest.mark.parametrize(
    "name", ["x" * 100_000, "x" * 300 + ".zip", "x" * 5000 + ".json", "x" * 5000 + ".onnx", "a\0b", "a\0.zip"]
)
def test_a_name_that_no_file_can_have_is_refused(env, name):
    for call in (lambda: hoof_env.load_policy(name, env), lambda: hoof_env.load_policy(name)):
        with pytest.raises(HoofEnvError):
            call()

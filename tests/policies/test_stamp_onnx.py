"""ONNX files of other exporters, written here by hand: what fits is marked, the rest left alone."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError
from hoof_env.evaluation.scores import evaluate

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

ENV_ID = "hoof_env/HorseLeg-v0"
SETTINGS = {"episode_seconds": 0.5, "friction": 0.3}


@pytest.fixture(scope="module")
def env():
    with gym.make(ENV_ID, **SETTINGS) as env:
        yield env


def write(path, inputs=22, outputs=4, batch="n", names=("obs", "mean"), scale=0.1, before=()):
    """A linear policy; `before` are other outputs in front of its actions, as an exporter may write them."""
    float32 = onnx.TensorProto.FLOAT
    matrix = scale * np.random.default_rng(0).normal(size=(inputs, outputs)).astype(np.float32)
    weights = onnx.numpy_helper.from_array(matrix, "weights")
    node = onnx.helper.make_node("MatMul", [names[0], "weights"], [names[1]])
    extra = [onnx.helper.make_node("Identity", [names[0]], [name]) for name in before]
    graph = onnx.helper.make_graph(
        [node, *extra],
        "policy",
        [onnx.helper.make_tensor_value_info(names[0], float32, [batch, inputs])],
        [
            *(onnx.helper.make_tensor_value_info(name, float32, [batch, inputs]) for name in before),
            onnx.helper.make_tensor_value_info(names[1], float32, [batch, outputs]),
        ],
        [weights],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)], ir_version=10)
    onnx.save(model, path)
    return matrix


@pytest.mark.parametrize("batch", ["n", 1])
def test_a_file_of_any_exporter(env, tmp_path, batch):
    path = tmp_path / "mine.onnx"
    matrix = write(path, batch=batch)
    with pytest.raises(DataFileError, match=r"no environment; hoof_env\.stamp_onnx"):
        hoof_env.load_policy(path, env)
    policy = hoof_env.stamp_onnx(path, env, algo="mine")
    assert (policy.record["env_id"], policy.record["algo"]) == (ENV_ID, "mine")
    assert policy.record["env_kwargs"] == SETTINGS
    assert policy.record["actions"] == "rates"
    assert policy.record["observation_scales"] == env.unwrapped.observation_scales
    seen = np.random.default_rng(1).uniform(-1, 1, (7, 22)).astype(np.float32)
    again = hoof_env.load_policy(path, env)
    np.testing.assert_allclose(again.predict(seen)[0], seen @ matrix, atol=1e-6)
    np.testing.assert_allclose(again.predict(seen[0])[0], seen[0] @ matrix, atol=1e-6)
    with gym.make("hoof_env/HorseLegSpeed-v0") as other, pytest.raises(DataFileError, match="env_id"):
        hoof_env.load_policy(path, other)
    with (
        gym.make(ENV_ID) as other,
        pytest.warns(UserWarning, match=r"friction=0\.3, here 0\.4"),
    ):
        hoof_env.load_policy(path, other)


def test_a_second_stamp_replaces_the_first_and_leaves_foreign_entries(env, tmp_path):
    path = tmp_path / "mine.onnx"
    write(path)
    model = onnx.load(path)
    onnx.helper.set_model_props(model, {"author": "me", "actions": "offsets"})
    onnx.save(model, path)
    for algo in ("a", "b"):
        record = hoof_env.stamp_onnx(path, env, algo=algo).record
    assert (record["author"], record["actions"], record["algo"]) == ("me", "rates", "b")


def test_the_output_of_the_name_action_is_taken(env, tmp_path):
    path = tmp_path / "mine.onnx"
    matrix = write(path, names=("obs", "action"), before=("value",))
    seen = np.ones((1, 22), np.float32)
    actions, _ = hoof_env.stamp_onnx(path, env).predict(seen)
    np.testing.assert_allclose(actions, seen @ matrix, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"inputs": 21}, "takes the 22 observations of hoof_env/HorseLeg-v0, got one that takes 21; make"),
        ({"outputs": 3}, r"expected actions of shape \(16, 4\) .* got shape \(16, 3\)"),
        ({"before": ("value",)}, r"got shape \(16, 22\)"),
        ({"scale": np.nan}, "got numbers that are not finite"),
        ({"batch": 5}, "expected a multiple of 5 rows, .* got 16; export it with a batch of any size"),
        ({"batch": 8}, "expected a multiple of 8 rows, .* got 1; export it with a batch of any size"),
    ],
)  # fmt: skip
def test_what_does_not_answer_is_left_alone(env, tmp_path, arguments, words):
    path = tmp_path / "mine.onnx"
    write(path, **arguments)
    before = path.read_bytes()
    with pytest.raises(DataFileError, match=words):
        hoof_env.stamp_onnx(path, env)
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


def test_a_broken_graph_and_an_environment_without_an_id_are_refused(env, tmp_path):
    path = tmp_path / "mine.onnx"
    for content in (None, b"", b"no graph"):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(DataFileError, match=r"mine\.onnx: expected an ONNX file"):
            hoof_env.stamp_onnx(path, env)
    write(path)
    with hoof_env.HorseLegEnv() as bare, pytest.raises(ParameterError, match=r"made by gymnasium\.make"):
        hoof_env.stamp_onnx(path, bare)


def test_a_stamp_says_nothing_else_than_the_environment(env, tmp_path):
    path = tmp_path / "mine.onnx"
    write(path)
    before = path.read_bytes()
    for entry in ("env_id", "actions", "settings", "hoof_env"):
        with pytest.raises(ParameterError, match=rf"no entry .*read off env, got \['{entry}'\]"):
            hoof_env.stamp_onnx(path, env, **{entry: "other"})
    for value in (3, None, ["ppo"]):
        with pytest.raises(ParameterError, match=r"algo: expected .*seed=\"3\", got"):
            hoof_env.stamp_onnx(path, env, algo=value)
    assert path.read_bytes() == before


def test_arguments_that_name_neither_a_file_nor_an_environment(env, tmp_path):
    path = tmp_path / "mine.onnx"
    write(path)
    other = tmp_path / "mine.bin"
    write(other)
    envs = hoof_env.HorseLegVectorEnv(2)
    for given in (ENV_ID, envs, None):
        with pytest.raises(ParameterError, match=r"env: expected a single environment made by"):
            hoof_env.stamp_onnx(path, given)
    for given in (other, 3, tmp_path):
        with pytest.raises(ParameterError, match=r"path: expected .*\.onnx, got"):
            hoof_env.stamp_onnx(given, env)


@pytest.mark.parametrize(
    ("entry", "text", "words"),
    [
        ("env_kwargs", "[1]", r"metadata env_kwargs: expected a JSON object, got '\[1\]'"),
        ("env_kwargs", "{", "metadata env_kwargs: expected a JSON object, got '{'"),
        ("settings", "3", "metadata settings: expected a JSON object, got '3'"),
        ("observation_names", '"abc"', "metadata observation_names: expected a JSON list, got '\"abc\"'"),
        ("observation_names", '["height", "wings"]', "observation_names with wings and without sin"),
        ("env_id", "", "no environment"),
        ("env_id", "hoof_env/HorseLegRail-v0", "env_id hoof_env/HorseLegRail-v0, expected [^;]*$"),
        ("action_space", "Box(3)", r"action_space Box\(3\), expected Box"),
    ],
)  # fmt: skip
def test_metadata_that_do_not_fit_are_named(env, tmp_path, entry, text, words):
    path = tmp_path / "mine.onnx"
    write(path)
    hoof_env.stamp_onnx(path, env)
    change(path, **{entry: text})
    with pytest.raises(DataFileError, match=words):
        hoof_env.load_policy(path, env)


def change(path, **metadata):
    """Metadata of a stamped file, as a text editor may leave them."""
    model = onnx.load(path)
    kept = {each.key: each.value for each in model.metadata_props}
    onnx.helper.set_model_props(model, kept | metadata)
    onnx.save(model, path)


@pytest.mark.parametrize(
    ("arguments", "metadata", "words"),
    [
        ({"scale": np.nan}, {}, r"policy .*mine\.onnx: action: expected finite numbers"),
        ({"outputs": 3}, {}, r"policy .*mine\.onnx: action: expected 4 finite numbers"),
        ({"inputs": 21}, {}, r"observation: expected shape \(\.\.\., 21\) as the policy mine\.onnx takes"),
        ({"batch": 8}, {}, r"mine\.onnx takes at once, got 1"),
        ({}, {"env_kwargs": '{"wings": 2}'}, r"mine\.onnx: its record has arguments .* argument 'wings'"),
        ({}, {"env_kwargs": '{"friction": "x"}'}, r"mine\.onnx: its record has arguments .* got 'x'"),
        ({}, {"env_id": "my/Leg-v0"}, "must not import a module.* --env-id MODULE:my/Leg-v0"),
    ],
)  # fmt: skip
def test_what_a_file_does_in_an_evaluation_is_told_with_its_name(env, tmp_path, arguments, metadata, words):
    """Metadata of a file that fits, on a graph that does not."""
    path = tmp_path / "mine.onnx"
    write(path)
    hoof_env.stamp_onnx(path, env)
    stamped = {each.key: each.value for each in onnx.load(path).metadata_props}
    write(path, **arguments)
    change(path, **stamped | metadata)
    with pytest.raises(HoofEnvError, match=words):
        evaluate([str(path)], episodes=1)


def test_a_folder_of_an_exported_policy_says_for_which_environment_it_is(env, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine").mkdir()
    write("mine/policy.onnx")
    hoof_env.stamp_onnx("mine/policy.onnx", env)
    assert evaluate(["mine"], episodes=1).env_kwargs == SETTINGS

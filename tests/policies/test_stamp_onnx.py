"""ONNX files of other exporters, written here by hand: what fits is marked, the rest left alone."""

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env.errors import DataFileError, ParameterError

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
    with pytest.raises(DataFileError, match=r"name no environment; hoof_env\.stamp_onnx"):
        hoof_env.load_policy(path, env)
    policy = hoof_env.stamp_onnx(path, env, algo="mine")
    assert (policy.record["env_id"], policy.record["algo"]) == (ENV_ID, "mine")
    assert policy.record["env_kwargs"] == SETTINGS
    assert policy.record["actions"] == "rates"
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


def test_a_second_stamp_replaces_the_first_and_keeps_what_is_not_ours(env, tmp_path):
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
        ({"inputs": 21}, r"of shape \(16, 22\), got observation: expected shape \(\.\.\., 21\)"),
        ({"outputs": 3}, r"expected actions of shape \(16, 4\) .* got shape \(16, 3\)"),
        ({"before": ("value",)}, r"got shape \(16, 22\)"),
        ({"scale": np.nan}, "got numbers that are not finite"),
        ({"batch": 5}, "with a batch of any size"),
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


def test_what_is_no_graph_or_no_made_environment(env, tmp_path):
    path = tmp_path / "mine.onnx"
    for content in (None, b"", b"no graph"):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(DataFileError, match=r"mine\.onnx: expected an ONNX file"):
            hoof_env.stamp_onnx(path, env)
    write(path)
    with hoof_env.HorseLegEnv() as bare, pytest.raises(ParameterError, match=r"made by gymnasium\.make"):
        hoof_env.stamp_onnx(path, bare)

"""Models on disk that do not fit or are damaged, by the words of each error: runs, plain or as a zip
(`RUNS`), ONNX files (`EXPORTS`), requests to `agents.export` (`REQUESTS`), policies that are not scored
(`SCORES`)."""

import json
import os
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from agents import export
from agents.runs import SavedModel, make_env
from hoof_env.envs.open_loop import GAITS
from hoof_env.errors import DataFileError, HoofEnvError, OutputError, ParameterError
from hoof_env.evaluation import scores
from hoof_env.policies.find import find_policy
from hoof_env.policies.onnx_file import OnnxPolicy
from hoof_env.policies.plain import DIGEST
from hoof_env.policies.saved import ABOUT, WEIGHTS
from tests.agents.conftest import ENV_ID, KWARGS, change, save_untrained

RAIL = "hoof_env/HorseLegRail-v0"


@pytest.fixture(scope="module")
def run(env, tmp_path_factory):
    """The folder of a model that was never trained."""
    folder = tmp_path_factory.mktemp("saved")
    save_untrained(folder, env)
    return folder


def record(**values):
    return lambda folder: change(folder / "run.json", **values)


def about(**values):
    """Entries of a policy.json whose digest does not tell of them."""

    def write(folder):
        change(folder / ABOUT, **values)
        forget_the_digest(folder)

    return write


def forget_the_digest(folder):
    content = json.loads((folder / ABOUT).read_text())
    del content[DIGEST]
    (folder / ABOUT).write_text(json.dumps(content))


def alone(content):
    """A zip, with a record of which only this is there."""

    def write(folder):
        for path in folder.iterdir():
            if path.name != "model.zip":
                path.unlink()
        (folder / "run.json").write_text(content)

    return write


def cut(part):
    """A zip of which a part is there, without a record."""

    def write(folder):
        content = (folder / "model.zip").read_bytes()
        alone("")(folder)
        (folder / "run.json").unlink()
        (folder / "model.zip").write_bytes(content[: int(part * len(content))])

    return write


def not_finite(folder):
    weights = load_file(folder / WEIGHTS)
    weights["log_std"][0] = torch.nan
    save_file(weights, folder / WEIGHTS)
    forget_the_digest(folder)


def half_the_weights(folder):
    (folder / WEIGHTS).write_bytes((folder / WEIGHTS).read_bytes()[:100])


def no_deviation(folder):
    """Variances below 0, of the right number."""
    normals = json.loads((folder / ABOUT).read_text())["normalize"]
    about(normalize={**normals, "var": [-1.0] * len(normals["var"])})(folder)


def other_weights(folder):
    """Of the same shapes."""
    weights = load_file(folder / WEIGHTS)
    weights["log_std"][0] += 1.0
    save_file(weights, folder / WEIGHTS)


RUNS = [
    *(
        (record(**values), r"run\.json: expected")
        for values in (
            {"env_id": 3}, {"env_kwargs": 3}, {"versions": None}, {"finished": {"steps": 5}},
            {"finished": {"steps": "x", "seconds": 1}},
        )
    ),
    *((alone(content), r"run\.json: expected") for content in ("", "[1]", "{}", '{"env_id": "x"}')),
    (
        record(env_id="hoof_env/HorseLeg-v7"),
        "HorseLeg-v7, expected hoof_env/HorseLeg-v0; another version",
    ),
    (record(env_id=RAIL), "HorseLegRail-v0, expected"),
    (record(actions="offsets"), "actions offsets, expected rates"),
    (
        record(observation_scales={"forward speed": "tanh(x / 9)", "toe load": "tanh(x / 3 weights)"}),
        r"observation_scales, forward speed: 'tanh\(x / 9\)', expected 'tanh\(x / 5\)'. Train it again, or",
    ),
    (record(observation_names=["pitch"]), "observation_names with pitch and without .*forward speed"),
    (record(observation_scales=["tanh(x / 5)"]), r"run\.json: expected"),
    (
        record(observation_space="Box(3)", action_space="Box(1)"),
        r"Box\(3\), expected .*; action_space Box\(1\)",
    ),
    *(
        (about(**values), r"policy\.json")
        for values in (
            {"format": 2},
            {"algo": "os.system"},
            {"policy": "CnnPolicyOfMine"},
            {"policy_kwargs": {"net_arch": [8], "activation_fn": {"torch.nn": "init"}}},
            {"policy_kwargs": {"net_arch": [9]}},
            {"action_space": None},
            {"normalize": {"mean": []}},
            {"normalize": {"mean": [0.0], "var": [1.0], "epsilon": 1e-8, "clip": 10.0}},
        )
    ),
    (no_deviation, r"policy\.json"),
    (not_finite, "not finite"),
    *(
        (damage, "not as it was written.*remove that entry")
        for damage in (other_weights, lambda folder: change(folder / ABOUT, policy_kwargs={}))
    ),
    (half_the_weights, r"policy\.json"),
    *((cut(part), r"model\.zip: expected a model saved by Stable-Baselines3") for part in (0.0, 0.5, 0.99)),
]  # fmt: skip
"""Change of a run's folder, and words."""


@pytest.mark.parametrize(("damage", "words"), RUNS)
def test_runs(damage, words, run, env, tmp_path):
    folder = shutil.copytree(run, tmp_path / "run")
    damage(folder)
    with pytest.raises(DataFileError, match=words):
        SavedModel.find(folder).load(env, ENV_ID)


def test_a_model_that_is_not_there(env, tmp_path):
    for path in (tmp_path / "none.zip", tmp_path):  # the folder holds no model.zip
        with pytest.raises(DataFileError, match=str(path)):
            find_policy(str(path), env, ENV_ID)


def test_a_policy_of_other_spaces(run, tmp_path):
    folder = shutil.copytree(run, tmp_path / "run")
    (folder / "run.json").unlink()
    with make_env("Pendulum-v1") as pendulum, pytest.raises(DataFileError, match="observation_space"):
        SavedModel.find(folder).load(pendulum, "Pendulum-v1")


def test_an_unknown_name_lists_the_known_names(env):
    with pytest.raises(ParameterError, match=r"walk.*idle.*airborne.*open-loop.*\.json.*'gallop'"):
        find_policy("gallop", env, ENV_ID)


# ONNX

needs_onnx = pytest.mark.skipif(
    not os.environ.get("CI") and not (find_spec("onnxruntime") and find_spec("onnxscript")),
    reason='needs pip install "hoof-env[onnx]"',
)


@pytest.fixture(scope="module")
def exported(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("exported") / "policy.onnx"
    export.main([str(run), "--out", str(path)])
    return path


def tagged(**entries):
    """A file with other entries, which may have the same shapes."""

    def write(path):
        import onnx

        graph = onnx.load(path)
        kept = {entry.key: entry.value for entry in graph.metadata_props}
        onnx.helper.set_model_props(graph, kept | entries)
        onnx.save(graph, path)

    return write


def bare(path):
    """A graph that says nothing about itself."""
    import onnx

    graph = onnx.load(path)
    del graph.metadata_props[:]
    onnx.save(graph, path)


def half(path):
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


NO_ONNX = r"x\.onnx: expected an ONNX .*agents\.export"
EXPORTS = [
    (tagged(actions="offsets"), ENV_ID, KWARGS, "actions offsets, expected rates"),
    (
        tagged(observation_scales='{"height": "tanh(x / 9)"}'),
        ENV_ID,
        KWARGS,
        r"observation_scales, height: 'tanh\(x / 9\)', expected 'tanh\(\(x - hip .*\. Train it again, or",
    ),
    (tagged(observation_scales="[1]"), ENV_ID, KWARGS, rf"{NO_ONNX}.*observation_scales: expected a JSON"),
    (None, RAIL, {}, "env_id hoof_env/HorseLeg-v0, expected hoof_env/HorseLegRail-v0"),
    (None, ENV_ID, {"trunk": "rail"}, "observation_space"),
    (None, ENV_ID, {"observation": ["gait", "crank", "trunk", "hoof"]}, "observation_names"),
    (half, ENV_ID, KWARGS, NO_ONNX),
    (bare, ENV_ID, KWARGS, NO_ONNX),
    (lambda path: path.write_text("no graph"), ENV_ID, KWARGS, NO_ONNX),
    (lambda path: path.write_bytes(b""), ENV_ID, KWARGS, NO_ONNX),
    (lambda path: path.unlink(), ENV_ID, KWARGS, NO_ONNX),
]
"""Change of a file, environment and its arguments, and words."""


@needs_onnx
@pytest.mark.parametrize(("damage", "env_id", "kwargs", "words"), EXPORTS)
def test_exports(damage, env_id, kwargs, words, exported, tmp_path):
    path = Path(shutil.copy(exported, tmp_path / "x.onnx"))
    if damage:
        damage(path)
    with make_env(env_id, **kwargs) as env, pytest.raises(DataFileError, match=words):
        find_policy(str(path), env, env_id)


REQUESTS = [
    *(
        (lambda run, _, name=name: export.export(run, Path(name)), ParameterError,
         rf"ends in \.onnx, got '{name}'")
        for name in ("policy.h5", "policy.pt")
    ),
    (lambda run, folder: export.export(run, folder), OutputError, "got a folder"),
    (lambda _, folder: export.export(Path("nowhere"), folder / "policy.onnx"), DataFileError, "nowhere"),
]  # fmt: skip
"""Call with a run and a folder that ends in .onnx, class and words of the error."""


@needs_onnx
@pytest.mark.parametrize(("call", "error", "words"), REQUESTS)
def test_requests(call, error, words, run, tmp_path):
    folder = tmp_path / "is.onnx"
    folder.mkdir()
    with pytest.raises(error, match=words):
        call(run, folder)
    assert list(tmp_path.rglob("*")) == [folder]


@needs_onnx
@pytest.mark.parametrize(
    ("package", "call"),
    [
        ("onnxruntime", lambda run, exported, _: OnnxPolicy(exported)),
        ("onnxscript", lambda run, exported, path: export.export(run, path)),
    ],
)
def test_missing_packages(package, call, run, exported, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(HoofEnvError, match=rf"{package}: pip install \"hoof-env\[.*onnx\]\""):
        call(run, exported, tmp_path / "policy.onnx")
    assert not list(tmp_path.iterdir())


# What `hoof-env evaluate --published` plays: nothing that was found or trained for something else

RUN_GAIT = GAITS / "HorseLegRail-v0-constant.json"


def refuses(observations):
    """A policy with actions that cannot be."""
    return np.full((len(observations), 3), np.nan)


def found_as(**values):
    """A file of a gait with other entries."""

    def write(folder, trained):
        path = folder / "gait.json"
        path.write_text(json.dumps({**json.loads(RUN_GAIT.read_text()), **values}))
        return path

    return write


def trained_as(part, **values):
    """A run whose record has other entries in a part."""

    def write(folder, trained):
        copied = Path(shutil.copytree(trained.folder, folder / "run"))
        kept = json.loads((copied / "run.json").read_text())[part]
        change(copied / "run.json", **{part: {**kept, **values}})
        return copied

    return write


def as_it_was(folder, trained):
    return trained.folder


SCORES = [
    (as_it_was, {"env_id": RAIL, "env_kwargs": KWARGS}, "trained for env_id hoof_env/HorseLeg-v0"),
    (as_it_was, {"env_kwargs": {"episode_seconds": 1}}, "episode_seconds=0.4, here .* another task"),
    (as_it_was, {"env_kwargs": {**KWARGS, "friction": 0.1}}, "trained with friction"),
    (trained_as("settings", preset="pony.json"), {}, "preset='pony.json', here 'identified'"),
    (trained_as("versions", **{"hoof-env": "0.0.1"}), {}, "hoof-env 0.0.1, here"),
    (found_as(), {"env_id": ENV_ID}, " found for hoof_env/HorseLegRail-v0"),
    (found_as(versions={"hoof-env": "9.9.9"}), {"env_id": RAIL}, " found for hoof-env 9.9.9, here"),
    (
        found_as(env_kwargs={"preset": "first_fit"}),
        {"env_id": RAIL, "env_kwargs": {"preset": "identified"}},
        "preset='first_fit', here",
    ),
    *(
        (lambda folder, trained, name=name: name, {}, words)
        for name, words in (
            ("nobody:act", "expected MODULE:NAME, got 'nobody:act'"),
            (f"{__name__}:walk", "expected MODULE:NAME"),
            (f"{__name__}:RUN_GAIT", "expected .*observations"),
            (f"{__name__}:refuses", r"expected finite actions of shape \(100, 4\)"),
            ("gallop", "policy: expected a name"),
        )
    ),
]
"""Function of a folder and a run that gives a policy, other arguments of the command, and words."""


@pytest.mark.parametrize(("policy", "kwargs", "words"), SCORES)
def test_scores(policy, kwargs, words, trained, tmp_path, monkeypatch):
    if "finite actions" not in words:
        monkeypatch.setattr(scores, "score_vector", lambda *_, **__: pytest.fail("was played"))
    with pytest.raises(HoofEnvError, match=words):
        scores.evaluate([str(policy(tmp_path, trained))], **kwargs, published=True)

"""Write a trained policy as one file that needs no Stable-Baselines3: ONNX, which onnxruntime reads.

    python -m agents.export runs/ppo-HorseLeg-v0-s0 --out policy.onnx

The file maps observations of the environment, shape (batch, k), to deterministic actions, (batch, n), float32
both: the normalisation of observations and the limits of actions are inside. It is kept only if it gives the
actions of its model. Its metadata describe the environment and the actions
(`hoof_env/policies/onnx_file.py`). A .zip is a pickle and can run any code when it is loaded: give only files
that you trust. ONNX is data.
"""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from tyro.conf import Positional

from agents import runs
from agents.command import parse, run
from hoof_env._output import check_new, new_file
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError
from hoof_env.policies.onnx_file import INPUT, LISTS, OUTPUT, OnnxPolicy
from hoof_env.policies.record import about, environment_of
from hoof_env.records import check_place

OPSET = 18  # version of ONNX's operators; onnxruntime reads it from 1.14 on
TRIED = 1000  # random observations on which file and model must agree
TOLERANCE = 1e-5  # largest difference of an action, in half ranges of the action space


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    model: Positional[Path]
    """run folder of agents.train, or a .zip of Stable-Baselines3"""
    out: Path
    """file to write: .onnx"""
    env_id: str | None = None
    """environment of a model without run.json"""
    overwrite: bool = False
    """replace an existing file"""


def export(model: Path, out: Path, env_id: str | None = None, overwrite: bool = False) -> float:
    """Write the policy of a run folder or .zip to an .onnx, for `env_id` or the id in run.json; `overwrite`
    replaces an existing file.

    Returns:
        The largest difference of an action, as in `TOLERANCE`.

    Raises:
        ParameterError: another suffix, or no environment known; also as `write_policy`.
        DataFileError: there is no such model; also as `write_policy`.
        OutputError: the file exists already, or cannot be written.
    """
    check_place(out, [".onnx"])
    check_new(out, overwrite)
    saved = runs.SavedModel.find(model)
    env_id, kwargs = environment_of(saved.path, saved.record, env_id)
    if env_id is None:
        raise ParameterError(f"env_id: expected one, for there is no run.json beside {saved.path}")
    with runs.make_env(env_id, **kwargs) as env:
        trained = saved.load(env, env_id)
        metadata = about(env, env_id, kwargs, saved.record)
    return write_policy(trained, out, metadata, overwrite)


def write_policy(
    trained: runs.TrainedPolicy, out: Path, metadata: dict[str, Any], overwrite: bool = False
) -> float:
    """Write a policy to `out` and return the largest difference of an action.

    Raises:
        OutputError: the file exists already and `overwrite` is False, or it cannot be written.
        ParameterError: its observations or actions are not vectors, or it has memory.
        DataFileError: the file does not act as the policy does; it is not kept.
        HoofEnvError: a package is missing.
    """
    observations = some_observations(trained.model.observation_space)
    module = module_of(trained)
    with new_file(out, overwrite) as file:
        write_onnx(module, observations[:2], file, metadata)
        off = difference(trained, OnnxPolicy(file).predict, observations)
        # Written so that NaN is refused as well
        if not off <= TOLERANCE:
            raise DataFileError(
                f"{out}: expected actions within {TOLERANCE:g} of the model's, got {off:.2g}; not kept"
            )
    return off


def statistics_of(normalize: Any) -> tuple[Any, Any, float] | None:
    """Return the normalisation in the `normalize` of a `TrainedPolicy`, None if there is none: mean and
    scale, shape (k,), float64, and the limit to which (observation - mean) / scale is clipped."""
    from stable_baselines3.common.vec_env import VecNormalize

    source = getattr(normalize, "__self__", normalize)  # it may be a method of `VecNormalize`
    if source is None or (isinstance(source, VecNormalize) and not source.norm_obs):
        return None
    # One array of statistics, for the observation is one array
    moments: Any = source.obs_rms if isinstance(source, VecNormalize) else source
    clip = source.clip_obs if isinstance(source, VecNormalize) else source.clip
    scale = np.sqrt(np.asarray(moments.var) + source.epsilon)
    return np.asarray(moments.mean), scale, float(clip)


class Deterministic(torch.nn.Module):
    """Module from observations to the deterministic actions of a `TrainedPolicy`, as its `predict` computes
    them."""

    low: Any
    high: Any
    mean: Any
    scale: Any

    def __init__(self, trained: runs.TrainedPolicy) -> None:
        super().__init__()
        self.policy = trained.model.policy
        space = trained.model.action_space
        self.register_buffer("low", torch.as_tensor(space.low))
        self.register_buffer("high", torch.as_tensor(space.high))
        statistics = statistics_of(trained.normalize)
        self.clip: float | None = None
        if statistics is not None:  # in float64, as VecNormalize computes
            mean, scale, self.clip = statistics
            self.register_buffer("mean", torch.as_tensor(mean))
            self.register_buffer("scale", torch.as_tensor(scale))

    def forward(self, observation: Any) -> Any:
        """Return actions, shape (batch, n), for observations, shape (batch, k)."""
        if self.clip is not None:
            scaled = (observation.double() - self.mean) / self.scale
            observation = scaled.clamp(-self.clip, self.clip).float()
        # From here on as `BasePolicy.predict`: squashed actions are scaled, all other ones clipped
        action = self.policy._predict(observation, deterministic=True)
        if self.policy.squash_output:  # in [-1, 1]: to the limits of the space
            return self.low + 0.5 * (action + 1.0) * (self.high - self.low)
        return torch.clamp(action, self.low, self.high)


def module_of(trained: runs.TrainedPolicy) -> Any:
    """Return the policy as a torch module that is ready to be traced; `ParameterError` for a recurrent one,
    or actions that are not vectors."""
    policy = trained.model.policy
    space = trained.model.action_space
    if not isinstance(space, gym.spaces.Box) or len(space.shape) != 1 or hasattr(policy, "lstm_actor"):
        raise ParameterError(f"model: expected a memoryless policy with vectors for actions, got {space}")
    policy.set_training_mode(False)
    return Deterministic(trained).eval()


def some_observations(space: gym.Space[Any]) -> Any:
    """Return `TRIED` random observations, shape (TRIED, k), float32, a tenth of them far outside the usual
    range; `ParameterError` for a space that is not of vectors."""
    if not isinstance(space, gym.spaces.Box) or len(space.shape) != 1:
        raise ParameterError(f"model: expected one that observes vectors, got {space}")
    space.seed(0)
    rows = np.stack([space.sample() for _ in range(TRIED)]).astype(np.float32)
    # Far outside, to test the limits of normalisation and actions
    rows[::10] *= 100
    return rows


@contextmanager
def _quietly() -> Iterator[None]:
    """Suppress the exporter's notes, and torch's checks of distributions, which cannot be traced."""
    from torch.distributions import Distribution

    logger = logging.getLogger("torch.onnx")
    level = logger.level
    # Torch has no getter; the setter changes this attribute of the class
    checked = Distribution._validate_args
    logger.setLevel(logging.ERROR)
    Distribution.set_default_validate_args(False)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
        Distribution.set_default_validate_args(checked)


def write_onnx(module: Any, example: Any, path: Path, metadata: dict[str, Any]) -> None:
    """Write a module as ONNX with any number of rows; `HoofEnvError` if a package is missing."""
    try:
        import onnx  # noqa: F401
        import onnxscript  # noqa: F401
    except ImportError as error:
        raise HoofEnvError(f'writing ONNX needs {error.name}: pip install "hoof-env[train,onnx]"') from None
    with _quietly():
        program: Any = torch.onnx.export(
            module,
            (torch.as_tensor(example),),
            dynamo=True,
            opset_version=OPSET,
            verbose=False,
            input_names=[INPUT],
            output_names=[OUTPUT],
            dynamic_shapes=({0: torch.export.Dim("batch")},),
        )
    graph = program.model.graph
    for part in (graph, *graph, *graph.inputs, *graph.outputs, *graph.initializers.values()):
        part.metadata_props.clear()  # stack traces, with the folders of this machine
    program.model.metadata_props.clear()
    for key, value in metadata.items():
        program.model.metadata_props[key] = json.dumps(value) if key in LISTS else str(value)
    program.save(path, external_data=False)


def difference(trained: Any, predict: Any, observations: Any) -> float:
    """Return the largest difference of an action in half ranges, many observations at once and one alone; NaN
    if an action is NaN."""
    space = trained.model.action_space
    half = (space.high - space.low) / 2
    wanted, _ = trained.predict(observations)
    # A policy must act on one observation as on many: batch sizes are dynamic
    alone = [predict(row)[0].reshape(-1) for row in observations[:20]]
    results = (predict(observations)[0], np.array(alone))
    return float(max(np.max(np.abs(actions - wanted[: len(actions)]) / half) for actions in results))


def main(argv: list[str] | None = None) -> None:
    """Export, and print the difference."""
    args = parse(Args, argv, "python -m agents.export", __doc__)
    off = export(args.model, args.out, args.env_id, args.overwrite)
    print(
        f"written: {args.out} ({args.out.stat().st_size / 1000:.0f} kB); on {TRIED} random observations its "
        f"actions differ from the model's by {off:.1g} of their half range at most"
    )


if __name__ == "__main__":
    run(main)

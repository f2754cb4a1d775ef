"""The examples of JAX run, for a few steps. `make test-jax` runs this; compiling takes a minute or two."""

import os
import re
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs.open_loop import open_loop

pytest.importorskip("jax", reason="jax is no part of the environment of set-up: make test-jax")

ROOT = Path(__file__).parents[2]
NUMBER = r"-?\d+\.\d+"

QUICKLY, KNOWS_QUICKLY = "--xla_cpu_use_fusion_emitters=false", (0, 5, 3)
"""Flag under which XLA compiles in half the time, and a version of jax that knows it; 0.5.0 does not."""


@pytest.mark.parametrize(
    ("name", "arguments", "last"),
    [
        pytest.param(
            "jax_ppo", ("--steps", "20480"), rf" 20,480 steps, .* return +{NUMBER}", marks=pytest.mark.smoke
        ),
        ("jax_shac", ("--steps", "800"), rf" 800 steps, .* reward +{NUMBER}"),
        ("jax_gait", ("--steps", "800"), rf"(\[+( *{NUMBER}\.?){{4}}\]+\s*)+"),
        ("jax_gradient", ("--starts", "2"), rf"\| 2 \| {NUMBER} \| .* \|"),
    ],
)
def test_an_example_runs(name, arguments, last):
    import jax

    # an XLA that does not know a flag aborts
    flags = {"XLA_FLAGS": QUICKLY} if jax.__version_info__ >= KNOWS_QUICKLY else {}
    done = subprocess.run(
        [sys.executable, "-m", f"examples.{name}", *arguments],
        cwd=ROOT, env=os.environ | flags, capture_output=True, text=True, timeout=1800,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "nan" not in done.stdout
    assert re.search(last + r"\s*$", done.stdout), done.stdout


def test_the_gait_inside_jax_is_the_policy_of_open_loop():
    import jax

    from examples.jax_gait import Gait, random_gait

    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    coefficients = env.body.half * random_gait(3)
    coefficients[0] += env.body.middle
    policy = open_loop({"coefficients": coefficients[None]}, env)
    act = jax.jit(Gait("hoof_env/HorseLeg-v0").act)
    observation, _ = env.reset(seed=3)
    for _ in range(50):
        action, _ = policy.predict(observation)
        np.testing.assert_allclose(act(random_gait(3), observation), action, atol=2e-3)
        observation, *_ = env.step(action)

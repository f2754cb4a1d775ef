"""What needs JAX says so where it is missing; nothing else imports it. Runs everywhere."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs import xla
from hoof_env.errors import MissingExtraError, ParameterError


def test_a_missing_jax_is_named_with_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=2).unwrapped
    monkeypatch.setattr(xla, "loaded_jax", xla.loaded_jax.__wrapped__)
    with pytest.raises(MissingExtraError, match=r'need jax: pip install "hoof-env\[jax\]"'):
        envs.xla()


@pytest.mark.parametrize(
    ("value", "got"),
    [
        (np.zeros(3), r"float64 of shape \(3,\)"),
        (np.zeros(4, bool), r"bool of shape \(4,\)"),
        ([1, [2, 3], 4, 5], r"\[1, \[2, 3\], 4, 5\], which is no array"),
        ([object()] * 4, "object of shape"),
        ("left", "<U4 of shape"),
        (None, "object of shape"),
    ],
)
def test_numbers_of_a_foreign_kind_are_refused_in_words(value, got):
    with pytest.raises(ParameterError, match=f"^actions: expected four, got {got}"):
        xla.numbers_of(np.asarray, value, (4,), "actions: expected four")
    for kind in (np.float32, np.int64, list):
        taken = [0, 1, -1, 0] if kind is list else np.array([0, 1, -1, 0], kind)
        assert xla.numbers_of(np.asarray, taken, (4,), "").tolist() == [0, 1, -1, 0]


def test_environments_do_not_import_jax():
    code = (
        "import sys, gymnasium as gym, hoof_env\n"
        "envs = gym.make_vec('hoof_env/HorseLeg-v0', num_envs=2)\n"
        "envs.reset(seed=0)\n"
        "envs.step(envs.action_space.sample())\n"
        "print([name for name in sys.modules if name.partition('.')[0] in ('jax', 'jaxlib')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout.strip() == "[]", done.stderr

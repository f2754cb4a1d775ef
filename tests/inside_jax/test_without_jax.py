"""What needs JAX says so where it is missing; nothing else imports it. Runs everywhere."""

import subprocess
import sys

import gymnasium as gym
import pytest

from hoof_env.envs import xla
from hoof_env.errors import MissingExtraError


def test_a_missing_jax_is_named_with_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=2).unwrapped
    monkeypatch.setattr(xla, "loaded_jax", xla.loaded_jax.__wrapped__)
    with pytest.raises(MissingExtraError, match=r'need jax: pip install "hoof-env\[jax\]"'):
        envs.xla()


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

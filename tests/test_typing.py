"""What a type checker knows of the package, in a project of somebody else."""

from __future__ import annotations

import ast
import inspect
import pydoc
import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

import hoof_env
from hoof_env import HorseLegEnv, HorseLegMOEnv, HorseLegVectorEnv, Sb3VecEnv
from hoof_env.envs.arguments import EnvArguments, Sb3Arguments, VectorArguments
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.settings import SETTINGS, to_json

ROOT = Path(__file__).parents[1]

SCRIPT = """\
from typing import assert_type
import numpy as np
import hoof_env
from hoof_env import Geometry, GaitParameters, HorseLegEnv, HorseLegMOEnv, HorseLegVectorEnv, Sb3VecEnv
from hoof_env import Terrain, TrunkEngine, Trunk, load_gait, load_geometry
env = HorseLegEnv(trunk_mass=60, render_mode="rgb_array")
HorseLegEnv(trunkmass=60)  # wrong
HorseLegEnv(trunk_mass="heavy")  # wrong
HorseLegEnv(target_speed=(1.0, 4.0), observation=["crank", "target"], preset={"gaits": {}})
HorseLegEnv(observation=[1])  # wrong
assert_type(env.geometry, Geometry)
assert_type(env.engine, TrunkEngine)
assert_type(env.terrain, Terrain)
assert_type(env.weight, float)
assert_type(env.gaits, dict[str, GaitParameters])
env.geometry.hip_hight  # wrong
observation, reward, terminated, truncated, info = env.step(env.action_for("run"))
assert_type(reward, float)
env.action_for(3)  # wrong
HorseLegMOEnv(trunkmass=60)  # wrong
many = HorseLegVectorEnv(4, trunk_mass=60, max_episode_steps=3)
HorseLegVectorEnv(4, trunkmass=60)  # wrong
Sb3VecEnv("hoof_env/HorseLeg-v0", 2, trunk_mass=60, max_episode_steps=3)
Sb3VecEnv("hoof_env/HorseLeg-v0", 2, trunkmass=60)  # wrong
assert_type(load_geometry("identified"), Geometry)
assert_type(load_gait("walk").crank_speed, float)
Trunk("free", mas=3)  # wrong
hoof_env.HorseLeg  # wrong
"""


@pytest.fixture(scope="module")
def cache():
    """Folder in which mypy keeps what it knows of the package and of NumPy, beside what `make lint` keeps of
    other options; it reads again what has changed."""
    return ROOT / ".mypy_cache" / "strict"


def complaints(folder: Path, script: str, cache: Path) -> dict[int, str]:
    """What `mypy --strict` says of a script, by line."""
    (folder / "mine.py").write_text(script, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(cache), "mine.py"]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    assert not said.stderr, said.stderr
    return {int(line): text for line, text in re.findall(r"^mine\.py:(\d+): error: (.*)$", said.stdout, re.M)}


def test_a_checker_finds_what_is_wrong_and_nothing_else(tmp_path, cache):
    wrong = {k for k, line in enumerate(SCRIPT.splitlines(), 1) if line.endswith("# wrong")}
    found = complaints(tmp_path, SCRIPT, cache)
    assert set(found) == wrong, found
    assert 'Unexpected keyword argument "trunkmass" for "HorseLegEnv"' in "".join(found.values())


def test_every_default_is_of_its_type(tmp_path, cache):
    lines = ["from hoof_env import HorseLegEnv"]
    for task in TASKS.values():
        given = ", ".join(f"{name}={value!r}" for name, value in to_json(task.settings({})).items())
        lines.append(f"HorseLegEnv({given})")
    assert complaints(tmp_path, "\n".join(lines) + "\n", cache) == {}


@pytest.mark.parametrize(
    ("env", "arguments"),
    [(HorseLegEnv, EnvArguments), (HorseLegVectorEnv, VectorArguments), (Sb3VecEnv, Sb3Arguments)],
)
def test_what_is_typed_is_what_a_constructor_takes(env, arguments):
    """A constructor names its own arguments a second time, behind the decorator that types them."""
    taken = own_arguments(env)
    typed = {item.name: item.default for item in fields(arguments)}
    assert taken.items() <= typed.items()
    passed_on = set(typed) - set(taken) - set(SETTINGS)
    assert passed_on <= (set(own_arguments(HorseLegVectorEnv)) if env is Sb3VecEnv else set())


def own_arguments(env):
    """The arguments that a constructor names itself, with their defaults."""
    build = env.__init__
    code = build.__code__
    positional = code.co_varnames[1 : code.co_argcount]
    return dict(zip(positional, build.__defaults__ or (), strict=True)) | (build.__kwdefaults__ or {})


@pytest.mark.parametrize("env", [HorseLegEnv, HorseLegMOEnv, HorseLegVectorEnv, Sb3VecEnv])
def test_help_names_every_setting_with_its_type(env):
    shown = inspect.signature(env).parameters
    assert set(SETTINGS) <= set(shown)
    assert all(parameter.kind is not inspect.Parameter.VAR_KEYWORD for parameter in shown.values())
    assert shown["trunk_mass"].annotation is float
    assert "friction: float = 0.4" in pydoc.render_doc(env)


def test_what_is_typed_is_what_is_public():
    """The imports for type checkers, and where the names are found when they are used."""
    tree = ast.parse(Path(hoof_env.__file__).read_text(encoding="utf-8"))
    (block,) = (
        node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    typed = {alias.asname: node.module for node in block.body for alias in node.names}
    assert typed == hoof_env._PUBLIC
    assert all(getattr(hoof_env, name).__name__ == name for name in typed)


PROGRAM = """\
import sys
sys.modules["stable_baselines3"] = None
import io, pydoc
import hoof_env
from hoof_env import *
assert hasattr(hoof_env, "Sb3VecEnv")
text = pydoc.plain(pydoc.render_doc(hoof_env))
assert "class HorseLegEnv" in text and 'hoof_env.Sb3VecEnv needs pip install "hoof-env[train]"' in text
for error in (ImportError, hoof_env.HoofEnvError):
    try:
        Sb3VecEnv("hoof_env/HorseLeg-v0", 2)
    except error as said:
        assert 'pip install "hoof-env[train]"' in str(said), said
    else:
        raise AssertionError
assert not isinstance(3, Sb3VecEnv)
"""


def test_without_an_extra_every_name_is_there_and_its_use_says_what_to_install():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr

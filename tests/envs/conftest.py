"""Lets the tests here import what they share, `family`, however pytest finds them; the module of a user."""

import importlib
import sys
from pathlib import Path

import gymnasium as gym
import pytest

from hoof_env.tasks import registry as tasks

sys.path.append(str(Path(__file__).parent))


@pytest.fixture
def registered():
    """Remove what a test registers after it."""
    known, own = dict(gym.registry), dict(tasks._OWN)
    yield
    for registry, before in ((gym.registry, known), (tasks._OWN, own)):
        registry.clear()
        registry.update(before)


@pytest.fixture(scope="module")
def own():
    """The module with an id of its own, imported, for the tests of one file."""
    known = sys.modules.get("own_functions")
    own_functions = importlib.reload(known) if known else importlib.import_module("own_functions")
    yield own_functions
    tasks._OWN.pop(own_functions.ID)
    gym.registry.pop(own_functions.ID)

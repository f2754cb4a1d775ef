"""A test with the argument `env_id` runs on every id of hoof-env in Gymnasium's registry but those with a
vector reward, which libraries for one objective cannot take; one with `mo_id` runs on these."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium as gym
import pytest

import hoof_env  # noqa: F401  (registers the environments)

collect_ignore = ["third_party"]  # somebody else's project

sys.path.insert(0, str(Path(__file__).parent))  # for `alone`

MULTI_OBJECTIVE = "hoof_env.envs.horse_leg:HorseLegMOEnv"

OURS = sorted(
    (spec for spec in gym.registry.values() if spec.namespace == "hoof_env"), key=lambda spec: spec.id
)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    for name, vector_reward in ("env_id", False), ("mo_id", True):
        if name in metafunc.fixturenames:
            chosen = [s.id for s in OURS if (s.entry_point == MULTI_OBJECTIVE) is vector_reward]
            metafunc.parametrize(name, chosen)

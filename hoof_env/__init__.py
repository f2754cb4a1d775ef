"""hoof-env: a Gymnasium environment for learned gait control of a horse's leg.

Importing the package registers its environments and nothing more: numba, pygame and the rest load when
needed.
"""

from __future__ import annotations

from typing import Any

import gymnasium as _gym

from hoof_env._version import __version__

_PUBLIC = {
    "Geometry": "hoof_env.leg.geometry",
    "load_geometry": "hoof_env.leg.geometry",
    "GaitParameters": "hoof_env.gait.parameters",
    "load_gait": "hoof_env.gait.parameters",
    "Ground": "hoof_env.ground.contact",
    "Terrain": "hoof_env.ground.terrain",
    "Trunk": "hoof_env.dynamics.trunk",
    "TrunkEngine": "hoof_env.dynamics.trunk_engine",
    "Limb": "hoof_env.dynamics.limb",
    "Motor": "hoof_env.dynamics.drive",
    "Prescribed": "hoof_env.dynamics.drive",
    "Result": "hoof_env.dynamics.result",
    "StepWarning": "hoof_env.dynamics.step_length",
    "LegEngine": "hoof_env.dynamics.engine",
    "ConstrainedLeg": "hoof_env.dynamics.constrained",
    "HorseLegEnv": "hoof_env.envs.horse_leg",
    "HorseLegMOEnv": "hoof_env.envs.multi_objective",
    "HorseLegVectorEnv": "hoof_env.envs.vector",
    "Sb3VecEnv": "hoof_env.envs.sb3",
    "RandomizeParameters": "hoof_env.envs.randomize",
    "make_policy": "hoof_env.envs.policies",
    "HoofEnvError": "hoof_env.errors",
    "ParameterError": "hoof_env.errors",
    "GeometryError": "hoof_env.errors",
    "DataFileError": "hoof_env.errors",
    "OutputError": "hoof_env.errors",
}

__all__ = ["__version__", *_PUBLIC]

_TASKS = {
    "HorseLeg": "leg",
    "HorseLegRail": "rail",
    "HorseLegSpeed": "speed",
    "HorseLegTerrain": "terrain",
    "HorseLegFixed": "fixed",
}


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        from importlib import import_module

        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


def _register(name: str, **spec: Any) -> None:
    if f"hoof_env/{name}" not in _gym.registry:
        _gym.register(id=f"hoof_env/{name}", **spec)


for _name, _task in _TASKS.items():
    _register(
        f"{_name}-v0",
        entry_point="hoof_env.envs.horse_leg:HorseLegEnv",
        vector_entry_point="hoof_env.envs.vector:HorseLegVectorEnv",
        kwargs={"task": _task},
    )
_register(
    "HorseLegMO-v0",
    entry_point="hoof_env.envs.multi_objective:HorseLegMOEnv",
    vector_entry_point="hoof_env.envs.multi_objective:refuse_many",
    disable_env_checker=True,  # it expects a number for a reward
)

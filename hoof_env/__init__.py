"""hoof-env: a Gymnasium environment for learned gait control of a horse's leg.

Importing the package registers its environments and nothing more: llvmlite, pygame and the rest load when
needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as _gym

from hoof_env._version import __version__

if TYPE_CHECKING:
    from hoof_env.dynamics.engine import TrunkEngine as TrunkEngine
    from hoof_env.dynamics.parts import HoofSpring as HoofSpring
    from hoof_env.dynamics.parts import Limb as Limb
    from hoof_env.dynamics.parts import Limits as Limits
    from hoof_env.dynamics.parts import Motor as Motor
    from hoof_env.dynamics.parts import Prescribed as Prescribed
    from hoof_env.dynamics.parts import Result as Result
    from hoof_env.dynamics.parts import Trunk as Trunk
    from hoof_env.dynamics.step_length import StepWarning as StepWarning
    from hoof_env.envs.horse_leg import HorseLegEnv as HorseLegEnv
    from hoof_env.envs.horse_leg import HorseLegMOEnv as HorseLegMOEnv
    from hoof_env.envs.horse_leg import RandomizeParameters as RandomizeParameters
    from hoof_env.envs.linear_reward import LinearReward as LinearReward
    from hoof_env.envs.linear_reward import VectorLinearReward as VectorLinearReward
    from hoof_env.envs.multi_objective import HorseLegMOVectorEnv as HorseLegMOVectorEnv
    from hoof_env.envs.policies import make_policy as make_policy
    from hoof_env.envs.sb3 import Sb3VecEnv as Sb3VecEnv
    from hoof_env.envs.separate_cost import SeparateCost as SeparateCost
    from hoof_env.envs.vector import HorseLegVectorEnv as HorseLegVectorEnv
    from hoof_env.errors import DataFileError as DataFileError
    from hoof_env.errors import GeometryError as GeometryError
    from hoof_env.errors import HoofEnvError as HoofEnvError
    from hoof_env.errors import MissingExtraError as MissingExtraError
    from hoof_env.errors import OutputError as OutputError
    from hoof_env.errors import ParameterError as ParameterError
    from hoof_env.gait import GaitParameters as GaitParameters
    from hoof_env.gait import HarmonicGait as HarmonicGait
    from hoof_env.gait import load_gait as load_gait
    from hoof_env.ground.contact import Ground as Ground
    from hoof_env.ground.terrain import Terrain as Terrain
    from hoof_env.leg.geometry import Geometry as Geometry
    from hoof_env.leg.geometry import load_geometry as load_geometry
    from hoof_env.leg.presets import read_preset as read_preset
    from hoof_env.paper_solver.solver import ConstrainedLeg as ConstrainedLeg
    from hoof_env.policies.find import load_policy as load_policy
    from hoof_env.policies.onnx_file import stamp_onnx as stamp_onnx
    from hoof_env.tasks.horse_gaits import HorseGait as HorseGait
    from hoof_env.tasks.observation import Entry as Entry
    from hoof_env.tasks.observation import Scale as Scale
    from hoof_env.tasks.registry import register as register
    from hoof_env.tasks.reward import Term as Term
    from hoof_env.tasks.user_parts import ActionMap as ActionMap
    from hoof_env.tasks.user_parts import Constant as Constant
    from hoof_env.tasks.user_parts import TermState as TermState

_MODULES = {
    "paper_solver.solver": "ConstrainedLeg",
    "dynamics.engine": "TrunkEngine",
    "dynamics.parts": "HoofSpring Limb Limits Motor Prescribed Result Trunk",
    "dynamics.step_length": "StepWarning",
    "envs.horse_leg": "HorseLegEnv HorseLegMOEnv RandomizeParameters",
    "tasks.observation": "Entry Scale",
    "envs.linear_reward": "LinearReward VectorLinearReward",
    "envs.multi_objective": "HorseLegMOVectorEnv",
    "envs.policies": "make_policy",
    "envs.separate_cost": "SeparateCost",
    "policies.find": "load_policy",
    "policies.onnx_file": "stamp_onnx",
    "tasks.horse_gaits": "HorseGait",
    "tasks.user_parts": "ActionMap Constant TermState",
    "tasks.reward": "Term",
    "envs.sb3": "Sb3VecEnv",
    "tasks.registry": "register",
    "envs.vector": "HorseLegVectorEnv",
    "errors": "DataFileError GeometryError HoofEnvError MissingExtraError OutputError ParameterError",
    "gait": "GaitParameters HarmonicGait load_gait",
    "ground.contact": "Ground",
    "ground.terrain": "Terrain",
    "leg.geometry": "Geometry load_geometry",
    "leg.presets": "read_preset",
}
_PUBLIC = {name: f"hoof_env.{module}" for module, names in _MODULES.items() for name in names.split()}

__all__ = ["__version__", *_PUBLIC]

_TASKS = {
    "HorseLeg": "leg",
    "HorseLegRail": "rail",
    "HorseLegSpeed": "speed",
    "HorseLegSafe": "safe",
    "HorseLegTerrain": "terrain",
    "HorseLegHop": "hop",
    "HorseLegBalance": "balance",
    "HorseLegBalanceSpeed": "balance_speed",
    "HorseLegFixed": "fixed",
    "Horse": "horse",
    "HorseRough": "rough",
    "HorseSafe": "horse_safe",
}


# a type checker that saw this function would accept any name
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in _PUBLIC:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        try:
            return getattr(import_module(_PUBLIC[name]), name)
        except ModuleNotFoundError as error:
            # Stable-Baselines3 comes with an extra; all names of `__all__` must exist without it, too
            if name != "Sb3VecEnv":
                raise
            globals()[name] = _stand_in(name, "train", error)
            return globals()[name]


def _stand_in(name: str, extra: str, error: ModuleNotFoundError) -> type:
    """Return a class in place of one that needs a missing library: it can be listed and looked up, and
    its use raises an error that says what to install."""
    from hoof_env.errors import MissingExtraError

    message = f'hoof_env.{name} needs pip install "hoof-env[{extra}]" ({error})'

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise MissingExtraError(message)

    return type(name, (), {"__init__": refuse, "__doc__": message, "__module__": __name__})


def __dir__() -> list[str]:
    return sorted(__all__)


def _register(name: str, **spec: Any) -> None:
    if f"hoof_env/{name}" not in _gym.registry:
        # the environments check what they are given; Gymnasium's passive checker takes a first reset that was
        # refused for one that has happened, and expects a number for the reward of HorseLegMO
        _gym.register(id=f"hoof_env/{name}", disable_env_checker=True, **spec)


for _name, _task in _TASKS.items():
    _register(
        f"{_name}-v0",
        entry_point="hoof_env.envs.horse_leg:HorseLegEnv",
        vector_entry_point="hoof_env.envs.vector:HorseLegVectorEnv",
        kwargs={"task": _task},
    )
_register(
    "HorseLegMO-v0",
    entry_point="hoof_env.envs.horse_leg:HorseLegMOEnv",
    vector_entry_point="hoof_env.envs.multi_objective:HorseLegMOVectorEnv",
)

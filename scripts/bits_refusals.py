"""Bad input for compare_bits.py: each case must be refused, and its words are compared."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

LEG, FIXED, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0", "hoof_env/Horse-v0"

BAD_SETTINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    (LEG, {"trunk_mas": 3}),
    (LEG, {"trunk_mass": -1}),
    (LEG, {"trunk_mass": "heavy"}),
    (LEG, {"trunk_mass": math.nan}),
    (LEG, {"trunk": "flying"}),
    (LEG, {"trunk": "rail", "trunk_share": 0.5}),
    (LEG, {"trunk": "rail", "trunk_stiffness": 5.0}),
    (LEG, {"trunk_share": 1.5}),
    (LEG, {"stiffness": 0}),
    (LEG, {"exponent": 1.51}),
    (LEG, {"normal_law": "hertz"}),
    (LEG, {"restitution": 1.1}),
    (LEG, {"normal_law": "flores-et-al", "restitution": 0.0}),
    (LEG, {"approach_floor": 0}),
    (LEG, {"friction_law": "glue"}),
    (LEG, {"friction": -0.1}),
    (LEG, {"friction_slow": 0.5, "friction_fast": 0.1}),
    (LEG, {"friction_law": "tanh", "friction_slow": 0.01}),
    (LEG, {"hoof_stiffness": 24000.0, "friction_law": "tanh"}),
    (LEG, {"hoof_damping": 100.0}),
    (LEG, {"hoof_stiffness": -5.0}),
    (LEG, {"terrain": "hilly"}),
    (LEG, {"terrain": {"kind": "stairs"}}),
    (LEG, {"terrain": {"kind": "hills", "depth": 3}}),
    (LEG, {"terrain": {"kind": "slope", "angle": 0.1}}),
    (LEG, {"terrain": {"height": [0, 1, "x"]}}),
    (LEG, {"crank_rate": 0.0}),
    (LEG, {"crank_rate": 1e9}),
    (LEG, {"swing_rate": math.inf}),
    (LEG, {"drive": "spring"}),
    (LEG, {"motor_gain": 3.0}),
    (LEG, {"drive": "motor", "motor_torque": -1.0}),
    (LEG, {"solver": "guess"}),
    (LEG, {"baumgarte_alpha": 3.0}),
    (LEG, {"solver": "paper"}),
    (FIXED, {"solver": "paper", "integrator": "rk3"}),
    (FIXED, {"gait": "fly"}),
    (FIXED, {"target_speed": [3.0, 1.0]}),
    (LEG, {"integrator": "rk7"}),
    (LEG, {"sim_dt": 0.5}),
    (LEG, {"dt": 0.0201}),
    (LEG, {"dt": "soon"}),
    (LEG, {"episode_seconds": 0.0}),
    (LEG, {"episode_seconds": 1e12}),
    (LEG, {"target_speed": [3.0, 1.0]}),
    (LEG, {"target_seconds": [2.0, 3.0]}),
    (LEG, {"size": 0.5}),
    (LEG, {"harmonics": 2}),
    (LEG, {"filters": "quick"}),
    (LEG, {"observation": ["crank", "moon"]}),
    (LEG, {"observation": []}),
    (LEG, {"observation": ["crank", "target"], "target_speed": None}),
    (LEG, {"observation": ["ground"]}),
    (FIXED, {"observation": ["trunk"]}),
    (LEG, {"reward_weights": {"happiness": 1}}),
    (LEG, {"reward_weights": {"peak": -1}}),
    (LEG, {"reward_weights": 3}),
    (LEG, {"randomize": {"gravity": [1, 2]}}),
    (LEG, {"randomize": {"friction": [0.9, 0.1]}}),
    (LEG, {"randomize": {"motor_gain": [1, 2]}}),
    (LEG, {"preset": "unicorn"}),
    (LEG, {"preset": {"lengths": 3}}),
    (LEG, {"render_mode": "ascii"}),
    (LEG, {"width": 0}),
    (LEG, {"task": "fly"}),
    (HORSE, {"trunk": "rail"}),
    (HORSE, {"hip_height": 1.0}),
    (HORSE, {"solver": "paper"}),
    (HORSE, {"size": -1}),
    (HORSE, {"harmonics": 5}),
    (HORSE, {"filters": "none"}),
    (HORSE, {"footfall": "none"}),
    (HORSE, {"crank_rate": 5.0}),
    (HORSE, {"gait": "tölt"}),
    (HORSE, {"trunk_share": 0.5}),
)

BAD_OPTIONS: tuple[tuple[str, Any], ...] = (
    (LEG, 3),
    (LEG, {"colour": 1}),
    (LEG, {"gait": "fly"}),
    (LEG, {"gait": {"crank_speed": 1}}),
    (LEG, {"gait": {"crank_speed": 1e6, "swing_offset": 0, "swing_sin": 0, "swing_cos": 0}}),
    (LEG, {"crank_angle": math.inf}),
    (LEG, {"height": 0.2}),
    (LEG, {"speed": 100}),
    (LEG, {"parameters": {"gravity": 3}}),
    (LEG, {"parameters": {"friction": -3}}),
    ("hoof_env/HorseLegRail-v0", {"height": 2.0}),
    (FIXED, {"speed": 1.0}),
    (FIXED, {"target_speed": 1.0}),
    (HORSE, {"height": 1.0}),
    (HORSE, {"phase": "a"}),
    (HORSE, {"target_speed": 100.0}),
    (HORSE, {"gait": [1, 2, 3]}),
)

Case = tuple[str, Callable[[], Any]]


def refusals() -> Iterator[Case]:
    """Names of cases with functions that must raise."""
    import gymnasium as gym

    from hoof_env import make_policy

    for env_id, arguments in BAD_SETTINGS:
        yield f"make {env_id} {arguments}", lambda e=env_id, a=arguments: gym.make(e, **a)
    for env_id, arguments in BAD_SETTINGS[:8]:
        yield f"make_vec {env_id} {arguments}", lambda e=env_id, a=arguments: gym.make_vec(e, 3, **a)
    envs: dict[str, Any] = {}
    for env_id, given in BAD_OPTIONS:
        env = envs.setdefault(env_id, gym.make(env_id))
        yield f"reset {env_id} {given}", lambda e=env, g=given: e.reset(options=g)
    leg, horse = envs[LEG].unwrapped, envs[HORSE].unwrapped
    yield "step before a reset", lambda: leg.step(np.zeros(4))
    yield "render before a reset", lambda: gym.make(LEG, render_mode="rgb_array").unwrapped.render()
    yield "seed", lambda: leg.reset(seed=-1)
    leg.reset(seed=0)
    horse.reset(seed=0)
    actions: tuple[Any, ...] = (
        np.zeros(3),
        [np.nan] * 4,
        "forward",
        np.zeros((1, 4)),
        [np.inf, 0, 0, 0],
        None,
    )
    for action in actions:
        yield f"action {action!r}", lambda a=action: leg.step(a)
    yield "a horse's action", lambda: horse.step(np.zeros(4))
    yield "action_for", lambda: leg.action_for("fly")
    yield "a horse's action_for", lambda: horse.action_for("walk")
    yield "policy", lambda: make_policy("fly", leg)
    yield "policy of a horse", lambda: make_policy("run", horse)
    state = leg.get_state()
    yield "state of another id", lambda: horse.set_state(state)
    yield "half a state", lambda: leg.set_state({"id": LEG})
    yield "set a setting", lambda: setattr(leg, "trunk_mass", 3)
    yield "change a fixed setting", lambda: leg.change_settings(dt=0.04)
    yield "change to nonsense", lambda: leg.change_settings(target_speed=(3, 1))
    yield from of_many()
    yield from of_engines()
    yield from of_parts()
    yield from of_registration()
    yield from of_commands()


def of_many() -> Iterator[Case]:
    """Bad input of vector environments."""

    from hoof_env import HorseLegVectorEnv, Sb3VecEnv

    yield "no environments", lambda: HorseLegVectorEnv(0)
    yield "half an environment", lambda: HorseLegVectorEnv(2.5)  # type: ignore[arg-type]
    yield "threads", lambda: HorseLegVectorEnv(2, num_threads=0)
    yield "autoreset", lambda: HorseLegVectorEnv(2, autoreset_mode="later")
    yield "rendered", lambda: HorseLegVectorEnv(2, render_mode="rgb_array", rendered=3)
    yield "Sb3VecEnv of another id", lambda: Sb3VecEnv("CartPole-v1", 2)
    yield "Sb3VecEnv's autoreset", lambda: Sb3VecEnv(LEG, 2, autoreset_mode="NEXT_STEP")
    envs = HorseLegVectorEnv(3, autoreset_mode="DISABLED", max_episode_steps=2)
    yield "many: step before a reset", lambda: envs.step(np.zeros((3, 4), np.float32))
    envs.reset(seed=0)
    yield "many: actions", lambda: envs.step(np.zeros((2, 4), np.float32))
    yield "many: not finite", lambda: envs.step(np.full((3, 4), np.nan, np.float32))
    yield "many: seeds", lambda: envs.reset(seed=[1, 2])
    yield "many: mask", lambda: envs.reset(options={"reset_mask": np.zeros(2, bool)})
    yield "many: mask of numbers", lambda: envs.reset(options={"reset_mask": np.zeros(3)})
    yield "many: set_attr", lambda: envs.set_attr("dt", 3)
    yield "many: call", lambda: envs.call("fly")
    yield "many: call step", lambda: envs.call("step")
    yield "many: record", lambda: envs.record(5)
    for _ in range(2):
        envs.step(np.zeros((3, 4), np.float32))
    yield "many: step after the end", lambda: envs.step(np.zeros((3, 4), np.float32))


def of_engines() -> Iterator[Case]:
    """Bad input of engines."""
    from hoof_env import (
        ConstrainedLeg,
        Ground,
        HoofSpring,
        Limb,
        Limits,
        Motor,
        Trunk,
        TrunkEngine,
        load_gait,
        load_geometry,
    )

    leg, walk = load_geometry("identified"), load_gait("walk", "identified")
    limb, trunk = Limb(leg), Trunk(height=leg.hip_height)
    yield "no limbs", lambda: TrunkEngine([], trunk)
    yield "a limb of another kind", lambda: TrunkEngine([leg], trunk)  # type: ignore[list-item]
    yield "33 limbs", lambda: TrunkEngine([limb] * 33, Trunk("free", height=1.7))
    yield "trunk", lambda: TrunkEngine(limb, "rail")  # type: ignore[arg-type]
    yield "engine's integrator", lambda: TrunkEngine(limb, trunk, integrator="euler")
    yield "engine's step", lambda: TrunkEngine(limb, trunk, sim_dt=1.0)
    yield "engine's substeps", lambda: TrunkEngine(limb, trunk, substeps=0)
    yield "engine's step_error", lambda: TrunkEngine(limb, trunk, step_error=0)
    yield "engine's harmonics", lambda: TrunkEngine(limb, trunk, harmonics=4)
    yield "mixed springs", lambda: TrunkEngine([Limb(leg, spring=HoofSpring(1e4, 1e2)), limb], trunk)
    yield (
        "law and springs",
        lambda: TrunkEngine(Limb(leg, spring=HoofSpring(1e4, 1e2)), trunk, contact_law=lambda a, b, c, d: a),
    )
    yield "law of three numbers", lambda: TrunkEngine(limb, trunk, contact_law=lambda a, b, c: a)
    engine = TrunkEngine(limb, trunk, num_envs=2)
    yield "move before a reset", lambda: engine.advance()
    yield "reset: theta", lambda: engine.reset(walk, [[1, 2, 3]])
    yield "reset: far", lambda: engine.reset(walk, x=1e10)
    yield "reset: not a gait", lambda: engine.reset([1, 2, 3])  # type: ignore[list-item]
    yield "reset: pitch", lambda: engine.reset(walk, pitch=0.1)
    yield "reset: envs", lambda: engine.reset(walk, envs=[5])
    engine.reset(walk)
    yield "command", lambda: engine.command([1, 2])
    yield "steps", lambda: engine.advance(steps=-1)
    yield "reactions", lambda: engine.reactions()
    yield "column", lambda: engine.set_column(0, np.zeros(3))
    yield "column of text", lambda: engine.set_column(0, "abc")  # type: ignore[arg-type]
    yield "vary's trunk", lambda: engine.vary(0, trunk=Trunk("rail"))
    yield "vary's ground", lambda: engine.vary(0, ground=Ground(exponent=2.0))
    yield "vary's env", lambda: engine.vary(7)
    yield "state of another", lambda: engine.set_state(TrunkEngine(limb, trunk).get_state())
    yield "limits", lambda: Limits(pitch=(1.0, -1.0))
    yield "clearance", lambda: Limits(clearance=math.nan)
    yield "hip", lambda: Limb(leg, hip=(1e5, 0.0))
    yield "drive", lambda: Limb(leg, drive="diesel")  # type: ignore[arg-type]
    yield "motor", lambda: Motor(speed_gain=-1.0)
    yield "spring", lambda: HoofSpring(1e4, 0.0)
    yield "paper's integrator", lambda: ConstrainedLeg(leg, Ground(), integrator="rk3")
    yield "paper's height", lambda: ConstrainedLeg(leg, Ground()).reset(walk, height=3.0)
    yield "paper's command", lambda: ConstrainedLeg(leg, Ground()).advance(np.zeros(3), np.zeros(1))


def of_parts() -> Iterator[Case]:
    """Bad input of grounds, terrains, gaits and legs."""
    from hoof_env import (
        GaitParameters,
        Geometry,
        Ground,
        HarmonicGait,
        HorseGait,
        Terrain,
        load_gait,
        load_geometry,
    )

    yield "ground", lambda: Ground(stiffness=-1)
    yield "ground's law", lambda: Ground(normal_law="x")
    yield "terrain rows", lambda: Terrain(height=(0.0, 1.0), stiffness=(1.0, 1.0, 1.0))
    yield "terrain slope", lambda: Terrain.slope(2.0)
    yield "terrain through", lambda: Terrain.through([0, 0], [1, 1])
    yield "terrain patches", lambda: Terrain.patches([(0, 2, 1, 1), (1, 3, 1, 1)])
    yield "terrain dict", lambda: Terrain.from_dict({"rocks": 3})
    yield "gait", lambda: GaitParameters(1e3, 0, 0, 0)
    yield "gait of nan", lambda: GaitParameters(math.nan, 0, 0, 0)
    yield "harmonic gait", lambda: HarmonicGait(5.0, 0, 0, 0, higher=(1,))
    yield "horse gait", lambda: HorseGait()  # type: ignore[call-arg]
    yield "load_gait", lambda: load_gait("fly")
    yield "load_geometry", lambda: load_geometry("fly")
    yield "geometry", lambda: Geometry.from_dict({"lengths": {}})
    yield "scaled", lambda: load_geometry().scaled(-1)


def of_registration() -> Iterator[Case]:
    """Bad input of `register`, `Term` and `Entry`."""
    from hoof_env import Entry, Scale, Term, register

    def term(step: Any, weight: Any) -> Any:
        return weight

    yield "register: id", lambda: register("mine")
    yield "register: our namespace", lambda: register("hoof_env/New-v0")
    yield "register: base", lambda: register("bits/A-v0", base="unicorn")
    yield "register: setting", lambda: register("bits/A-v0", trunk_mas=3)
    yield "register: terms", lambda: register("bits/A-v0", terms=[3])  # type: ignore[list-item]
    yield (
        "register: twice",
        lambda: register("bits/A-v0", terms=[Term("a", 1.0, "1", "a", term), Term("a", 1.0, "1", "a", term)]),
    )
    yield "register: law", lambda: register("bits/A-v0", contact_law=term)
    yield "term's weight", lambda: Term("a", math.nan, "1", "a", term)
    yield "term's function", lambda: Term("a", 1.0, "1", "a", 3)  # type: ignore[arg-type]
    yield "entry's scale", lambda: Entry("a", "b", "m", term, 3)  # type: ignore[arg-type]
    yield "scale", lambda: Scale("x", 3)  # type: ignore[arg-type]


def of_commands() -> Iterator[Case]:
    """Bad command lines: they raise `SystemExit` with what was said."""
    from bits_cases import cli

    def told(*arguments: str) -> Callable[[], Any]:
        def run() -> None:
            raise SystemExit(cli(*arguments))

        return run

    lines = (
        "export --out x.doc", "export --out x.c3d --reactions", "export --out x.csv --policy fly",
        "export --out x.csv --env-id nothing/Here-v0", "export --out x.csv --env-kwargs trunk_mass=-1",
        "export --out x.mot --units BW", "render --out x.avi", "render --out x.gif --seconds 0",
        "compare nothing.csv nothing.mot", "compare a.csv b.csv --align dance",
        "manual --env-id hoof_env/Nothing-v0",
        "average nothing.csv --out mean.txt", "fly", "export --out x.csv --env-kwargs trunk_mas=1",
    )  # fmt: skip
    for line in lines:
        yield f"hoof-env {line}", told(*line.split())

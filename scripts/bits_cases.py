"""Cases that compare_bits.py digests: environments, files, pictures, policies, training; engines are in
bits_engines.py.

Each part yields pairs of a case's name and its `Digests`. A part calls only what both commits have:
registered ids, public names, commands. Where a public name changed, renamed.toml says so.
"""

from __future__ import annotations

import contextlib
import io
import json
import pickle
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from bits_digest import Cases, Digests
from bits_engines import engines, solvers

PARTS_OF_STEP = ("observation", "reward", "terminated", "truncated", "info")
LEG, FIXED, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0", "hoof_env/Horse-v0"

OWN_TASK = """
import hoof_env
from hoof_env.simd import absolute, maximum, minimum, sqrt, where
from hoof_env.simd.math import root_power

def friction(step, weight):
    toe, heel = step.leg.report.toe, step.leg.report.heel
    return 0.001 * weight * (toe.friction * toe.slide + heel.friction * heel.slide)

def roughness(step, weight):
    return -weight * sqrt(absolute(step.trunk.report.acceleration.imag))

def sway(step, weight):
    speed = minimum(absolute(step.trunk.report.velocity.imag), 1.0)
    return where(step.failed > 0.0, 0.0, weight * speed)

def turf(penetration, rate, inverse_approach_speed, ground):
    spring = ground.stiffness * root_power(penetration, 12) * (1.0 + penetration / 0.05)
    damping = ground.chi * where(rate < 0.0, 2.0 * rate, rate) * inverse_approach_speed
    return spring * maximum(1.0 + damping, 0.0)

hoof_env.register(
    "bits/Own-v0",
    terms=[
        hoof_env.Term("friction", 0.5, "1/kJ", "power of friction", friction),
        hoof_env.Term("roughness", 0.01, "-", "vertical acceleration", roughness),
        hoof_env.Term("sway", 0.1, "-", "vertical speed", sway),
    ],
    entries=[
        hoof_env.Entry(
            "vertical acceleration", "feel", "m/s^2", lambda scene: scene.trunk.report.acceleration.imag,
            hoof_env.Scale("tanh(x / 9.81)", lambda x, scene: x / 9.81, saturates=True),
        ),
        hoof_env.Entry(
            "episode time", "watch", "s", lambda scene: scene.episode.time,
            hoof_env.Scale("/ 10", lambda x, scene: 0.1 * x),
        ),
    ],
    contact_law=turf,
    stiffness=5e4,
)
"""
"""A task with functions of its own, in the words of the work tree."""

SETTINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    (FIXED, {"gait": "run"}),
    (FIXED, {"solver": "paper", "dt": 0.02}),
    (FIXED, {"solver": "paper", "gait": "run", "restitution": 0.0, "integrator": "rk4"}),
    (FIXED, {"solver": "paper", "baumgarte_beta": 21.2, "baumgarte_alpha": 15.0, "restitution": 0.5}),
    (LEG, {"exponent": 1.375, "stiffness": 3e5, "preset": "identified"}),
    (LEG, {"normal_law": "hunt-crossley", "friction_law": "tanh"}),
    (LEG, {"normal_law": "flores-et-al", "restitution": 0.9, "approach_floor": 0.01}),
    (LEG, {"normal_law": "kelvin-voigt", "friction": 0.9}),
    (LEG, {"drive": "motor", "integrator": "rk4", "motor_torque": 300.0}),
    (LEG, {"drive": "motor", "integrator": "rk3", "motor_gain": 50.0, "motor_inertia": 1.0}),
    (LEG, {"integrator": "semi_implicit_euler", "sim_dt": 5e-4, "dt": 0.01}),
    (LEG, {"randomize": {"trunk_mass": [40, 120], "friction": [0.3, 0.9], "restitution": [0.2, 0.8]}}),
    (LEG, {"reward_weights": {"progress": 2, "peak": 0.5, "support": 4}, "target_speed": [2, 2]}),
    (LEG, {"target_speed": [1, 3], "target_seconds": [0.5, 1.0]}),
    (LEG, {"terrain": {"kind": "hills", "seed": 3, "rise": 0.1}, "trunk_mass": 60}),
    (LEG, {"terrain": {"height": [0.0, 0.04], "start": 2.0, "spacing": 4.0}}),
    ("hoof_env/HorseLegRail-v0", {"terrain": {"kind": "hills", "seed": 1, "rise": 0.02}}),
    (FIXED, {"terrain": {"kind": "slope", "angle": 0.05}}),
    (HORSE, {"terrain": {"kind": "slope", "angle": 0.05}}),
    (LEG, {"crank_rate": 9.0, "swing_rate": 2.0, "hip_height": 1.65, "trunk_share": 0.6}),
    (LEG, {"observation": ["trunk", "hoof", "crank", "gait"], "episode_seconds": 2.0}),
    (LEG, {"hoof_stiffness": 24000.0}),
    (LEG, {"hoof_stiffness": 50000.0, "hoof_damping": 300.0, "stiffness": 2e6, "exponent": 1.5}),
    ("bits/Own-v0", {}),
    ("bits/Own-v0", {"observation": ["watch", "feel", "crank"], "reward_weights": {"sway": 0.0}}),
    (HORSE, {"size": 0.5}),
    (HORSE, {"harmonics": 1, "filters": "slow"}),
    (HORSE, {"footfall": "free"}),
    (HORSE, {"gait": "walk", "target_speed": [1.5, 1.5]}),
    (HORSE, {"drive": "motor", "terrain": {"kind": "hills", "seed": 1, "rise": 0.02}}),
    (HORSE, {"randomize": {"trunk_mass": [300, 400], "friction": [0.4, 0.8]}}),
)
"""Ids with settings of all kinds. One that a commit refuses gives its message instead of digests."""


def spelled(text: str, names: Mapping[str, str]) -> str:
    """Python in the words of the commit that runs: `names` maps names of the work tree to it."""
    import re

    for new, old in names.items():
        text = re.sub(rf"\b{re.escape(new)}\b", old, text)
    return text


def add_own_task(names: Mapping[str, str]) -> None:
    """Register `OWN_TASK`, from a file, because kernels read the source of their functions."""
    folder = Path(tempfile.mkdtemp())
    (folder / "bits_own_task.py").write_text(spelled(OWN_TASK, names))
    sys.path.insert(0, str(folder))
    import bits_own_task  # type: ignore[import-not-found]  # noqa: F401


def ids() -> list[str]:
    """All ids of the package."""
    import gymnasium as gym

    import hoof_env  # noqa: F401

    return sorted(name for name in gym.registry if name.startswith("hoof_env/"))


def make_many(env_id: str, count: int, **arguments: Any) -> Any:
    """`gymnasium.make_vec`, or None for an id that has a vector for a reward."""
    import gymnasium as gym

    if "MO-" in env_id:
        return None
    return gym.make_vec(env_id, num_envs=count, **arguments)


def play_one(env: Any, digests: Digests, steps: int, seed: int = 0, options: Any = None) -> None:
    """Digest an episode and those that follow it, with random actions."""
    generator = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed, options=options)
    digests.add("reset.observation", observation)
    digests.add("reset.info", info)
    width = env.action_space.shape[0]
    for _ in range(steps):
        # between small actions, under which an episode goes on, are some that end it
        size = generator.choice([0.0, 0.3, 1.0, 3.0])
        step = env.step((size * generator.uniform(-1, 1, width)).astype(np.float32))
        for name, value in zip(PARTS_OF_STEP, step, strict=True):
            digests.add(name, value)
        if step[2] or step[3]:
            observation, info = env.reset()
            digests.add("reset.observation", observation)
            digests.add("reset.info", info)


def play_many(envs: Any, digests: Digests, steps: int, seed: int = 0, options: Any = None) -> None:
    """Digest steps of many environments, a partial reset in the middle where autoreset allows it."""
    generator = np.random.default_rng(seed)
    observation, info = envs.reset(seed=seed, options=options)
    digests.add("reset.observation", observation)
    digests.add("reset.info", info)
    for k in range(steps):
        step = envs.step(generator.uniform(-1, 1, envs.action_space.shape).astype(np.float32))
        for name, value in zip(PARTS_OF_STEP, step, strict=True):
            digests.add(name, value)
        if k == steps // 2:
            mask = np.arange(envs.num_envs) % 3 == 0
            observation, info = envs.reset(options={"reset_mask": mask})
            digests.add("reset.observation", observation)
            digests.add("reset.info", info)


# Environments


def environments() -> Cases:
    """Every id of the registry: alone and 1, 7 and 1,024 at once, threads, autoreset modes."""
    import gymnasium as gym

    for env_id in ids():
        digests = Digests()
        env = gym.make(env_id)
        for seed in range(3):
            play_one(env, digests, 300, seed)
        yield f"{env_id} alone", digests
        for count, steps in ((1, 120), (7, 300), (1024, 40)):
            envs = make_many(env_id, count)
            if envs is not None:
                digests = Digests()
                play_many(envs, digests, steps)
                yield f"{env_id} x {count}", digests
        for mode in ("SAME_STEP", "DISABLED"):
            envs = make_many(env_id, 7, autoreset_mode=mode, num_threads=2, max_episode_steps=30)
            if envs is not None:
                digests = Digests()
                play_many(envs, digests, 29 if mode == "DISABLED" else 80)
                yield f"{env_id} x 7, {mode}", digests
        envs = make_many(env_id, 1024, num_threads=2)
        if envs is not None:
            digests = Digests()
            play_many(envs, digests, 20)
            yield f"{env_id} x 1024, 2 threads", digests


def settings() -> Cases:
    """Settings of all kinds, alone and among seven; one that is refused gives its message."""
    import gymnasium as gym

    for env_id, arguments in SETTINGS:
        name = f"{env_id} {json.dumps(arguments)}"
        digests = Digests()
        try:
            env = gym.make(env_id, **arguments)
        except Exception as error:
            digests.add("refused", f"{type(error).__name__}: {error}")
            yield name, digests
            continue
        play_one(env, digests, 100)
        yield f"{name} alone", digests
        digests = Digests()
        play_many(make_many(env_id, 7, **arguments), digests, 60)
        yield f"{name} x 7", digests


def options() -> Cases:
    """Options of a reset, settings that change between episodes, draws of a wrapper."""
    import gymnasium as gym

    import hoof_env

    cases: list[tuple[str, dict[str, Any]]] = [
        (LEG, {"gait": "run"}),
        (LEG, {"gait": "carrying_walk", "crank_angle": 1.0, "speed": 2.0, "height": 1.75, "x": 3.0}),
        (LEG, {"target_speed": 1.5, "parameters": {"friction": 0.7, "trunk_mass": 70.0}}),
        (FIXED, {"gait": "run", "crank_angle": 0.5}),
        (HORSE, {"phase": 0.3, "speed": 1.4, "pitch": 0.01, "target_speed": 1.4}),
        (HORSE, {"gait": "trot", "target_speed": 2.5}),
        ("hoof_env/HorseLegSpeed-v0", {"target_speed": 2.0}),
    ]
    for env_id, given in cases:
        name = f"{env_id} {json.dumps(given)}"
        digests = Digests()
        try:
            play_one(gym.make(env_id), digests, 60, options=given)
            play_many(make_many(env_id, 7), digests, 30, options=given)
        except hoof_env.HoofEnvError as error:
            digests.add("refused", f"{type(error).__name__}: {error}")
        yield name, digests
    changes: dict[str, Any] = {
        "target_speed": (1.0, 2.0),
        "reward_weights": {"peak": 0.7},
        "randomize": {"friction": [0.4, 0.6]},
    }
    digests = Digests()
    env, envs = gym.make(LEG), make_many(LEG, 7, max_episode_steps=20)
    play_one(env, digests, 20)
    play_many(envs, digests, 30)
    env.unwrapped.change_settings(**changes)  # type: ignore[attr-defined]
    envs.unwrapped.change_settings(**changes)
    play_one(env, digests, 20, seed=1)
    for _ in range(30):
        digests.add("changed", envs.step(np.zeros((7, 4), np.float32)))
    yield "change_settings", digests
    digests = Digests()
    play_one(hoof_env.RandomizeParameters(gym.make(LEG), {"trunk_mass": (40, 90)}), digests, 30)
    yield "RandomizeParameters", digests


def states() -> Cases:
    """What follows a state that was put back, a copy, a pickle; records, raw observations, actions for gaits,
    policies."""
    import gymnasium as gym

    from hoof_env import make_policy

    for env_id in [*ids(), "bits/Own-v0"]:
        env: Any = gym.make(env_id).unwrapped
        generator = np.random.default_rng(0)
        env.reset(seed=0)
        width = env.action_space.shape[0]
        actions = generator.uniform(-1, 1, (27, width)).astype(np.float32)
        for action in actions[:7]:
            env.step(action)
        digests = Digests()
        digests.add("raw", env.raw_observation())
        digests.add("record", env.record())
        state = env.get_state()
        copies = [env, deepcopy(env), pickle.loads(pickle.dumps(env))]
        first = [env.step(action) for action in actions[7:]]
        for copy in copies:
            copy.set_state(state)
            again = [copy.step(action) for action in actions[7:]]
            if dict_of(again) != dict_of(first):
                raise AssertionError(f"{env_id}: set_state lost something")
        digests.add("after", first)
        digests.add("record", env.record())
        for name in ("observation_names", "observation_units", "action_names"):
            digests.add(name, list(getattr(env, name, ())))
        for name in ("low", "high"):
            digests.add(name, getattr(env.observation_space, name))
        yield f"{env_id} state", digests
        for policy in policies_of(env):
            digests = Digests()
            player = make_policy(policy, env, 3)
            observation, _ = env.reset(seed=5, options=getattr(player, "start", None))
            for _ in range(30):
                action, _ = player.predict(observation)
                digests.add("action", action)
                observation = env.step(action)[0]
            digests.add("observation", observation)
            yield f"{env_id} {policy}", digests


def policies_of(env: Any) -> list[str]:
    """Names of the scripted policies of an environment, from what it says when it refuses one."""
    from hoof_env import HoofEnvError, make_policy

    try:
        make_policy("no such policy", env)
    except HoofEnvError as error:
        text = str(error).partition("one of ")[2].partition(",  got")[0].rpartition(", got")[0]
        return sorted(name.strip() for name in text.split(","))
    raise AssertionError("a policy of that name exists")


def dict_of(value: Any) -> dict[str, str]:
    """The digests of one value."""
    digests = Digests()
    digests.add("", value)
    return digests.results()


def sb3() -> Cases:
    """The environments of Stable-Baselines3."""
    from hoof_env import Sb3VecEnv

    for env_id in (LEG, HORSE):
        envs = Sb3VecEnv(env_id, 9, max_episode_steps=25, num_threads=2)
        envs.seed(3)
        digests = Digests()
        digests.add("observation", envs.reset())
        generator = np.random.default_rng(0)
        for _ in range(60):
            step = envs.step(generator.uniform(-1, 1, (9, *envs.action_space.shape)).astype(np.float32))
            for name, value in zip(("observation", "reward", "done", "info"), step, strict=True):
                digests.add(name, value)
        digests.add("terms", envs.terms)
        digests.add("measured", envs.measured)
        digests.add("reset_infos", envs.reset_infos)
        yield f"{env_id} Sb3VecEnv", digests


# Files, pictures, commands


def files() -> Cases:
    """Exported files, their comparison and mean, the manual, frames of every id."""
    import gymnasium as gym

    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        runs: list[tuple[str, str, list[str]]] = [
            ("leg.csv", LEG, ["--policy", "run", "--reactions"]),
            ("leg.mot", LEG, ["--policy", "run"]),
            ("leg.sto", LEG, ["--policy", "carrying_walk", "--reactions"]),
            ("leg.c3d", LEG, ["--policy", "run"]),
            ("leg.parquet", LEG, ["--policy", "run", "--units", "BW"]),
            ("rough.csv", "hoof_env/HorseLegTerrain-v0", ["--policy", "open-loop"]),
            ("horse.csv", HORSE, ["--reactions"]),
            ("horse.mot", HORSE, []),
            ("paper.csv", FIXED, ["--policy", "walk", "--env-kwargs", "solver=paper"]),
        ]
        for name, env_id, more in runs:
            digests = Digests()
            said = cli(
                "export",
                "--out",
                str(here / name),
                "--env-id",
                env_id,
                "--seed",
                "4",
                "--seconds",
                "2",
                *more,
            )
            digests.add("said", said.replace(folder, ""))
            for path in sorted(here.glob(Path(name).stem + "*" + Path(name).suffix)):
                digests.add(path.name, path.read_bytes().replace(folder.encode(), b""))
            yield f"export {name}", digests
        for given in (
            ["compare", str(here / "leg.csv"), str(here / "rough.csv")],
            ["compare", str(here / "leg.mot"), str(here / "leg.sto"), "--align", "shift"],
            ["compare", str(here / "horse.csv"), str(here / "horse.mot"), "--units", "BW"],
        ):
            digests = Digests()
            digests.add(
                "said", cli(*given, "--out", str(here / "compared.png"), "--overwrite").replace(folder, "")
            )
            yield " ".join(given).replace(folder, ""), digests
        digests = Digests()
        table = here / "mean.csv"
        digests.add("said", cli("average", str(here / "leg.csv"), "--out", str(table)).replace(folder, ""))
        digests.add("table", table.read_bytes() if table.exists() else b"")
        yield "average", digests
    for env_id in ids():
        digests = Digests()
        digests.add("page", cli("manual", "--env-id", env_id))
        yield f"manual {env_id}", digests
        digests = Digests()
        env = gym.make(env_id, render_mode="rgb_array", width=480, height=270)
        env.reset(seed=1)
        for _ in range(3):
            digests.add("frame", env.render())
            env.step(np.zeros(env.action_space.shape, np.float32))
        yield f"frames {env_id}", digests


def options_of(*arguments: str) -> tuple[str, ...]:
    """Arguments of a command line by the names that the commit has for its options."""
    try:
        from hoof_env.commands.episode_args import Episode
    except ModuleNotFoundError:
        from hoof_env.commands.played import Episode  # the name before November 2026

    if hasattr(Episode, "env_id"):
        return arguments
    names = {"--env-id": "--id", "--env-kwargs": "--args"}
    return tuple(names.get(word, word) for word in arguments)


def cli(*arguments: str) -> str:
    """What the command line says, on stdout and stderr, and its exit code."""
    from hoof_env.cli import main

    arguments = options_of(*arguments)
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            code: Any = main(list(arguments))
        except SystemExit as left:
            code = left.code
    # what is said while kernels compile, and how far a long export is, depends on the clock
    passing = ("hoof-env: compiling", "hoof-env: waiting", " compiled in ", " of at most ")
    lines = [line for line in said.getvalue().splitlines() if not any(text in line for text in passing)]
    return "\n".join([*lines, f"exit {code}"])


def reproduction() -> Cases:
    """Rows of reproduction.json for all solvers."""
    with tempfile.TemporaryDirectory() as folder:
        command("hoof_env.cli", "reproduce", "--no-figures", "--out", folder)
        for number, row in enumerate(json.loads((Path(folder) / "reproduction.json").read_text())):
            row.pop("answers", None)
            digests = Digests()
            digests.add("row", row)
            yield f"row {number}, {row.get('solver', '')} {row.get('id', '')}", digests


def policies() -> Cases:
    """Episodes of the shipped policies."""
    for env_id in ids():
        name = env_id.partition("/")[2]
        with tempfile.TemporaryDirectory() as folder:
            scores = Path(folder) / "scores.json"
            policy = f"agents/policies/{name}"
            # Older bases have another command.
            if find_spec("agents.evaluate"):
                options = ("--policy", policy, "--env-id", env_id, "--json", str(scores))
                command("agents.evaluate", *options, "--episodes", "3")
            else:
                options = (policy, "--env-id", env_id, "--out", str(scores))
                command("hoof_env.cli", "evaluate", *options_of(*options), "--episodes", "3")
            found = json.loads(scores.read_text())
            digests = Digests()
            digests.add("episodes", [score["episodes"] for score in found["policies"].values()])
            yield name, digests


def training() -> Cases:
    """Weights of seeded trainings: PPO of Stable-Baselines3, and `ppo_flat`."""
    for algo in ("ppo", "ppo_flat"):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / algo
            command("agents.train", "--algo", algo, "--seed", "0", "--steps", "20000", "--out", str(out))
            digests = Digests()
            for path in sorted(out.rglob("*.safetensors")):
                digests.add(path.name, path.read_bytes())
            yield algo, digests


def command(module: str, *arguments: str) -> None:
    """Run a command of the commit; what it prints goes to stderr."""
    subprocess.run([sys.executable, "-m", module, *arguments], check=True, stdout=sys.stderr)


def named(parts: Iterable[Callable[[], Cases]]) -> dict[str, Callable[[], Cases]]:
    """Parts by their functions' names."""
    return {part.__name__: part for part in parts}


PARTS = named(
    (environments, settings, options, states, sb3, engines, solvers, files, reproduction, policies, training)
)
"""What is digested, by the name of the part."""

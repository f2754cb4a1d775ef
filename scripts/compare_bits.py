"""Compare what two commits compute, bit by bit, on this machine.

    python scripts/compare_bits.py --base COMMIT                   everything, some ten minutes
    python scripts/compare_bits.py --base COMMIT --parts env engine

Both commits run under the same Python, one after the other, each from a checkout of its own: bits differ
between machines, so digests that were written elsewhere say nothing. Digests of the base are kept in
runs/bits and are taken again only when the machine, the Python packages or this file have changed.
Exits with 1 where any digest differs, and names it.

The parts call only what both commits have: registered ids, public names, commands.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "runs" / "bits"
IDS = ("HorseLeg", "HorseLegRail", "HorseLegSpeed", "HorseLegTerrain", "HorseLegFixed", "HorseLegMO")
SEEDS, STEPS = range(3), 500

Digests = dict[str, str]


class Digest:
    """SHA-256 of numbers, texts and their containers, keys of mappings in order."""

    def __init__(self) -> None:
        self.sha = hashlib.sha256()

    def add(self, value: Any) -> Digest:
        if isinstance(value, dict):
            for key in sorted(value, key=str):
                self.sha.update(f"{key}:".encode())
                self.add(value[key])
        elif isinstance(value, (list, tuple)):
            self.sha.update(f"[{len(value)}]".encode())
            for item in value:
                self.add(item)
        elif isinstance(value, (np.ndarray, np.generic, int, float)) and not isinstance(value, bool):
            array = np.asarray(value)
            if array.dtype == object:  # NumPy's or Python's own: texts, None, whole numbers beyond 64 bits
                return self.add(repr(array.tolist()))
            self.sha.update(array.dtype.kind.encode() + str(array.shape).encode() + array.tobytes())
        else:
            self.sha.update(repr(value).encode())
        return self

    def __str__(self) -> str:
        return self.sha.hexdigest()[:16]


# The parts: what is digested, by name


def environments() -> Iterator[tuple[str, Digest]]:
    """Observations, rewards, ends and infos of every id, alone and 1, 7 and 1024 at once."""
    import gymnasium as gym

    import hoof_env  # noqa: F401

    names = ("observation", "reward", "terminated", "truncated", "info")
    for env_id in (f"hoof_env/{name}-v0" for name in IDS):
        digests = {name: Digest() for name in names}
        env = gym.make(env_id, disable_env_checker=True)
        for seed in SEEDS:
            generator = np.random.default_rng(seed)
            observation, info = env.reset(seed=seed)
            digests["observation"].add(observation), digests["info"].add(info)
            for _ in range(STEPS):
                step = env.step(generator.uniform(-1, 1, 4).astype(np.float32))
                for name, value in zip(names, step, strict=True):
                    digests[name].add(value)
                if step[2] or step[3]:
                    observation, info = env.reset()
                    digests["observation"].add(observation), digests["info"].add(info)
        yield from ((f"{env_id} alone, {name}", digest) for name, digest in digests.items())
        if env_id.endswith("MO-v0"):
            continue
        for count in (1, 7, 1024):
            digests = {name: Digest() for name in names}
            envs = gym.make_vec(env_id, num_envs=count)
            for seed in SEEDS if count < 1024 else SEEDS[:1]:
                generator = np.random.default_rng(seed)
                observation, info = envs.reset(seed=seed)
                digests["observation"].add(observation), digests["info"].add(info)
                for _ in range(STEPS if count < 1024 else STEPS // 4):
                    step = envs.step(generator.uniform(-1, 1, (count, 4)).astype(np.float32))
                    for name, value in zip(names, step, strict=True):
                        digests[name].add(value)
            yield from ((f"{env_id} x {count}, {name}", digest) for name, digest in digests.items())


def settings() -> Iterator[tuple[str, Digest]]:
    """Environments of other settings: solvers, laws, drives, terrain, drawn parameters, rewards."""
    import gymnasium as gym

    import hoof_env  # noqa: F401

    leg, fixed = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"
    cases: list[tuple[str, dict[str, Any]]] = [
        (fixed, {"gait": "run"}),
        (fixed, {"solver": "paper", "dt": 0.02}),
        (fixed, {"solver": "paper", "gait": "run", "restitution": 0.0, "integrator": "rk4"}),
        (leg, {"preset": "identified", "exponent": 1.375}),
        (leg, {"normal_law": "hunt-crossley", "friction_law": "tanh"}),
        (leg, {"drive": "motor", "integrator": "rk4"}),
        (leg, {"randomize": {"trunk_mass": [40, 120], "friction": [0.3, 0.9]}}),
        (leg, {"reward_weights": {"progress": 2, "peak": 0.5, "support": 4}, "target_speed": [2, 2]}),
        (leg, {"terrain": {"kind": "hills", "seed": 3, "rise": 0.1}, "trunk_mass": 60}),
    ]
    for env_id, arguments in cases:
        digest = Digest()
        env = gym.make(env_id, disable_env_checker=True, **arguments)
        generator = np.random.default_rng(0)
        digest.add(env.reset(seed=0))
        for _ in range(STEPS // 5):
            step = env.step(generator.uniform(-1, 1, 4).astype(np.float32))
            digest.add(step)
            if step[2] or step[3]:
                digest.add(env.reset())
        yield f"{env_id} {json.dumps(arguments)}", digest


def states() -> Iterator[tuple[str, Digest]]:
    """`get_state`, and the same steps again after `set_state`."""
    import gymnasium as gym

    import hoof_env  # noqa: F401

    for env_id in (f"hoof_env/{name}-v0" for name in IDS):
        env = gym.make(env_id, disable_env_checker=True).unwrapped
        generator = np.random.default_rng(0)
        env.reset(seed=0)
        for _ in range(7):
            env.step(generator.uniform(-1, 1, 4).astype(np.float32))
        state = env.get_state()
        actions = generator.uniform(-1, 1, (20, 4)).astype(np.float32)
        first = [env.step(action) for action in actions]
        env.set_state(state)
        again = [env.step(action) for action in actions]
        assert str(Digest().add(first)) == str(Digest().add(again)), f"{env_id}: set_state lost something"
        yield f"{env_id} state and what follows", Digest().add({**state, "settings": None}).add(first)


def engines() -> Iterator[tuple[str, Digest]]:
    """States, reports, accounts, strides and reactions: four trunks, four schemes, one leg and four."""
    from hoof_env import Ground, Limb, Motor, Prescribed, Trunk, TrunkEngine, load_gait, load_geometry

    leg = load_geometry("identified")
    for kind in ("fixed", "rail", "suspended", "free"):
        for scheme in ("semi_implicit_euler", "midpoint", "rk3", "rk4"):
            for hips in ((0.0,), (0.6, 0.6, -0.6, -0.6)):
                for drive in (Prescribed(), Motor()):
                    digest = Digest()
                    for count in (1, 9):
                        mass = 60.0 * len(hips)
                        engine = TrunkEngine(
                            [Limb(leg, hip=(x, 0.0), drive=drive) for x in hips],
                            Trunk(kind, mass=mass, pitch_inertia=40.0 * len(hips), height=leg.hip_height),
                            Ground(exponent=1.375),
                            integrator=scheme,
                            num_envs=count,
                            reactions=True,
                            strides=True,
                        )  # fmt: skip
                        theta = np.add.outer(np.arange(len(hips)) * 1.7, 0.1 * np.arange(count))
                        engine.reset(load_gait("walk", "identified"), theta=theta)
                        for _ in range(5):
                            digest.add(engine.advance(steps=40))
                            digest.add([engine.state, engine.report, engine.account, engine.strides])
                            digest.add(list(engine.reactions()))
                    yield f"{kind}, {scheme}, {len(hips)} legs, {type(drive).__name__}", digest


def reproduction() -> Iterator[tuple[str, Digest]]:
    """Rows of reproduction.json for all solvers, without what the study of the paper added to them."""
    with tempfile.TemporaryDirectory() as folder:
        command("hoof_env.cli", "reproduce", "--no-figures", "--out", folder)
        for number, row in enumerate(json.loads((Path(folder) / "reproduction.json").read_text())):
            row.pop("answers", None)
            yield f"row {number}, {row.get('solver', '')} {row.get('id', '')}", Digest().add(row)


def policies() -> Iterator[tuple[str, Digest]]:
    """Episodes of the shipped policies."""
    for name in IDS:
        with tempfile.TemporaryDirectory() as folder:
            scores = Path(folder) / "scores.json"
            command(
                "agents.evaluate", "--policy", f"agents/policies/{name}-v0", "run", "--episodes", "3",
                "--env-id", f"hoof_env/{name}-v0", "--json", str(scores),
            )  # fmt: skip
            found = json.loads(scores.read_text())
            yield name, Digest().add([score["episodes"] for score in found["policies"].values()])


def training() -> Iterator[tuple[str, Digest]]:
    """Weights of a seeded PPO of 20,000 steps."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "ppo"
        command("agents.train", "--algo", "ppo", "--seed", "0", "--steps", "20000", "--out", str(out))
        for path in sorted(out.glob("*.safetensors")):
            yield path.name, Digest().add(path.read_bytes())


PARTS: dict[str, Callable[[], Iterator[tuple[str, Digest]]]] = {
    "env": environments,
    "settings": settings,
    "state": states,
    "engine": engines,
    "reproduction": reproduction,
    "policies": policies,
    "training": training,
}


def command(module: str, *arguments: str) -> None:
    """Run a command of the commit; what it prints goes to stderr."""
    subprocess.run([sys.executable, "-m", module, *arguments], check=True, stdout=sys.stderr)


# Running both commits


def digests_of(tree: Path, parts: list[str]) -> Digests:
    """Digests of the commit that is checked out in `tree`, from a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    run = [sys.executable, __file__, "--print", "--parts", *parts]
    done = subprocess.run(run, cwd=tree, env=environment, check=True, stdout=subprocess.PIPE)
    found: Digests = json.loads(done.stdout)
    return found


@contextmanager
def checkout(commit: str) -> Iterator[Path]:
    """A temporary work tree of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "base"
        subprocess.run(["git", "worktree", "add", "-q", "--detach", tree, commit], cwd=ROOT, check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)


def base_digests(commit: str, parts: list[str]) -> Digests:
    """Digests of the base, part by part, kept for the next comparison on this machine."""
    packages = sorted(f"{d.metadata['Name']} {d.version}" for d in metadata.distributions())
    conditions = [platform.processor(), platform.node(), *packages, Path(__file__).read_text(), commit]
    kept = KEPT / f"{Digest().add(conditions)}.json"
    known: dict[str, Digests] = json.loads(kept.read_text()) if kept.exists() else {}
    missing = [part for part in parts if part not in known]
    if missing:
        with checkout(commit) as tree:
            for part in missing:
                print(f"{commit[:10]}: {part}", flush=True)
                known[part] = digests_of(tree, [part])
                KEPT.mkdir(parents=True, exist_ok=True)
                kept.write_text(json.dumps(known, indent=1))
    return {name: digest for part in parts for name, digest in known[part].items()}


def compare(base: Digests, now: Digests) -> int:
    """Print what differs; returns how many digests do."""
    differing = [name for name in base if now.get(name) != base[name]] + [n for n in now if n not in base]
    for name in differing:
        print(f"differs: {name}: {base.get(name, 'missing')} before, {now.get(name, 'missing')} now")
    print(f"{len(base)} digests, {len(differing)} differ")
    return len(differing)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--base", help="commit to compare with")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--print", action="store_true", help="print the digests of the current folder")
    arguments = parser.parse_args()
    if arguments.print:
        found = {f"{part}: {name}": str(d) for part in arguments.parts for name, d in PARTS[part]()}
        print(json.dumps(found, indent=1))
        return 0
    if not arguments.base:
        parser.error("--base: expected a commit")
    rev = ["git", "rev-parse", "--verify", f"{arguments.base}^{{commit}}"]
    commit = subprocess.run(rev, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    base = base_digests(commit, arguments.parts)
    print("work tree", flush=True)
    return 1 if compare(base, digests_of(ROOT, arguments.parts)) else 0


if __name__ == "__main__":
    sys.exit(main())

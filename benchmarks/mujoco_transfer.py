"""The agent of HorseLeg-v0 drives the same leg in MuJoCo, through the model that `Geometry.to_mjcf` exports.

    python -m benchmarks.mujoco_transfer --out runs/transfer             needs the extra "peers"
    python -m benchmarks.mujoco_transfer --no-fit --film                 with the contact found before

Three numbers of MuJoCo's contact are fitted: stiffness, damping, and impedance at the surface. What they are
fitted to is the run alone, a scripted gait: its speed, its stance peaks and its return. The agent then acts
on what it would observe, 50 times a second; `benchmarks.mujoco_episode` says what MuJoCo simulates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.command import run
from benchmarks.mujoco_episode import Floats, MujocoEpisode
from hoof_env._output import check_folder, markdown_table
from hoof_env.errors import count
from hoof_env.evaluation.episodes import play
from hoof_env.policies.actor import Actor
from hoof_env.policies.find import find_policy

ENV_ID = "hoof_env/HorseLeg-v0"
POLICY = "agents/policies/HorseLeg-v0"
FIT_SEEDS = range(4_000_000, 4_000_002)
SEEDS = range(4_100_000, 4_100_020)
"""Episodes of the fit and of the comparison, on which nothing else is played."""

CONTACT = (4.36e4, 13.7, 0.146)
"""Stiffness [1/s^2], damping [1/s] and impedance at the surface [-] of MuJoCo's contact as `--no-fit` takes
them: the fit's result with MuJoCo 4.0."""

FILMED = 200  # control steps of the film


@dataclass(frozen=True)
class Figures:
    """Figures of an episode: mean speed [m/s], mean stance peak [N], return, and whether it failed."""

    speed: float
    peak: float
    value: float
    failed: float


def play_there(
    env: Any, policy: Any, seed: int, contact: Sequence[float], frames: list[Floats] | None = None
) -> Figures:
    """Play an episode in MuJoCo.

    Args:
        env: environment whose start and settings are taken.
        policy: policy for its observations.
        seed: seed of the start.
        contact: see `MujocoEpisode`.
        frames: list that gets the bars of each control step; None for none.
    """
    actor = Actor(policy, env)
    env.reset(seed=seed, options=actor.start)
    there = MujocoEpisode(env, contact)
    begin = float(there.data.qpos[there.x])
    value = 0.0
    failed = False
    steps = round(there.env.episode_seconds / there.env.dt)
    for _ in range(steps):
        reward, failed = there.step(np.asarray(actor.act(there.observe()), float))
        value += reward
        if frames is not None:
            frames.append(there.bars())
        if failed:
            break
    peaks = there.peaks / max(there.stance.count, 1)
    return Figures((float(there.data.qpos[there.x]) - begin) / there.time, peaks, value, float(failed))


def play_here(env: Any, policy: Any, seed: int) -> Figures:
    """Play the episode of the same start in the environment itself."""
    (episode,) = play(env, policy, [seed])
    names = ("speed_m_s", "stance_peak_n", "return", "failed")
    return Figures(*(float(episode[name]) for name in names))


def mean(found: Sequence[Figures]) -> Figures:
    """Return the mean figures of episodes."""
    return Figures(*np.mean([[one.speed, one.peak, one.value, one.failed] for one in found], axis=0))


def misses(there: Figures, here: Figures) -> Floats:
    """Return the relative differences of speed, stance peak and return."""
    pairs = ((there.speed, here.speed), (there.peak, here.peak), (there.value, here.value))
    return np.array([one / other - 1 for one, other in pairs])


def told(contact: Sequence[float]) -> str:
    """Return the numbers of a contact in words."""
    return f"{contact[0]:.4g} 1/s^2, {contact[1]:.4g} 1/s, impedance {contact[2]:.4g} at the surface"


def fit(env: Any, policy: Any, seeds: Sequence[int], evaluations: int) -> tuple[float, float, float]:
    """Find the contact with which the policy's episodes in MuJoCo come nearest to the environment's: the
    smallest sum of squares of `misses`, by a simplex over the logarithms."""
    from scipy.optimize import minimize

    here = mean([play_here(env, policy, seed) for seed in seeds])

    def error(logs: Floats) -> float:
        contact = np.exp(logs).tolist()
        there = mean([play_there(env, policy, seed, contact) for seed in seeds])
        found = float(np.sum(misses(there, here) ** 2))
        print(f"{told(contact)}: error {found:.5f}", flush=True)
        return found

    options = {"maxfev": evaluations, "initial_simplex": np.log(CONTACT) + 0.3 * np.eye(4, 3, -1)}
    best = minimize(error, np.log(CONTACT), method="Nelder-Mead", options=options)
    stiffness, damping, impedance = np.exp(best.x).tolist()
    return stiffness, damping, impedance


def film(here: Sequence[Floats], there: Sequence[Floats], path: Path) -> None:
    """Write a film of both: the environment's leg above, MuJoCo's below."""
    from PIL import Image, ImageDraw

    width = 480
    height = 200
    scale = 85.0  # pixels per metre
    pictures = []
    for lines in zip(here, there, strict=False):
        picture = Image.new("RGB", (width, 2 * height), "white")
        pen = ImageDraw.Draw(picture)
        for row, (bars, title) in enumerate(zip(lines, ("hoof_env", "MuJoCo"), strict=True)):
            left = bars[:, :, 0].mean() - width / scale / 2
            ground = (row + 1) * height - 16
            pen.rectangle((0, ground, width, ground + 16), fill="#EFE6D8")
            for mark in range(int(left), int(left + width / scale) + 2):
                at = (mark - left) * scale
                pen.line((at, ground, at, ground + 6), fill="#666666")
            for (x1, y1), (x2, y2) in bars:
                ends = ((x1 - left) * scale, ground - y1 * scale, (x2 - left) * scale, ground - y2 * scale)
                pen.line(ends, fill="#0072B2" if row == 0 else "#D55E00", width=3)
            pen.text((6, row * height + 4), title, fill="black")
        pictures.append(picture.quantize(16))
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=40, loop=0, optimize=True)


def bars_here(env: Any, policy: Any, seed: int, like: MujocoEpisode) -> list[Floats]:
    """Play an episode in the environment; return the bars of each control step, in the links of `like`."""
    actor = Actor(policy, env)
    observation, _ = env.reset(seed=seed, options=actor.start)
    engine = env.unwrapped.engine
    frames: list[Floats] = []
    done = False
    while not done:
        observation, _, terminated, truncated, _ = env.step(actor.act(observation))
        done = terminated or truncated
        for name, joint in (("x", like.x), ("y", like.z), ("swing_angle", like.swing)):
            like.data.qpos[joint] = engine.report[name].item()
        frames.append(like.pose_at(engine.state["crank_angle"].item()))
    return frames


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policy: str = POLICY
    """path of the agent"""
    episodes: int = 20
    """of the run and of the agent, there and here"""
    fit: bool = True
    """fit the contact to the run first; otherwise take the one found before"""
    evaluations: int = 60
    """contacts that the fit tries"""
    film: bool = False
    """write transfer.gif, too"""
    out: Path = Path("runs/transfer")
    """folder of table.md and transfer.gif"""


def main(argv: list[str] | None = None) -> None:
    """Fit, play, print."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m benchmarks.mujoco_transfer", description=__doc__)
    count("--episodes", args.episodes, most=len(SEEDS))
    check_folder(args.out)
    args.out.mkdir(parents=True, exist_ok=True)
    env = runs.make_env(ENV_ID)
    policies = {name: find_policy(name, env, ENV_ID) for name in ("run", args.policy)}
    contact = fit(env, policies["run"], FIT_SEEDS, args.evaluations) if args.fit else CONTACT
    rows = []
    head = ["gait", "", "speed [m/s]", "stance peak [N]", "return", "fell"]
    for name, policy in policies.items():
        here = mean([play_here(env, policy, seed) for seed in SEEDS[: args.episodes]])
        there = mean([play_there(env, policy, seed, contact) for seed in SEEDS[: args.episodes]])
        for where, figures in (("hoof_env", here), ("MuJoCo", there)):
            numbers = (figures.speed, figures.peak, figures.value, figures.failed)
            rows.append([Path(name).name, where, *(f"{number:.3g}" for number in numbers)])
        rows.append([Path(name).name, "difference", *(f"{100 * x:+.0f} %" for x in misses(there, here)), ""])
    text = f"Contact: {told(contact)}.\n\n{markdown_table(head, rows)}\n"
    runs.write_text(args.out / "table.md", text)
    print(text)
    if args.film:
        frames: list[Floats] = []
        play_there(env, policies[args.policy], SEEDS[0], contact, frames)
        env.reset(seed=SEEDS[0])
        shown = MujocoEpisode(env, contact)
        here_frames = bars_here(env, policies[args.policy], SEEDS[0], shown)
        film(here_frames[:FILMED:2], frames[:FILMED:2], args.out / "transfer.gif")
    env.close()


if __name__ == "__main__":
    run(main)

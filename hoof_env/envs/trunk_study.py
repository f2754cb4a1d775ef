"""How the scripted gaits move a trunk: the measurements from which the default trunk was chosen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from hoof_env.envs.policies import make_policy

DEFAULT = {"trunk_mass": 80.0, "trunk_share": 0.8, "trunk_stiffness": 4000.0, "trunk_damping": 1130.0}

TRUNKS: tuple[dict[str, Any], ...] = (
    {"trunk": "rail"},
    DEFAULT,
    {**DEFAULT, "trunk_mass": 50.0},
    {**DEFAULT, "trunk_mass": 120.0},
    {**DEFAULT, "trunk_share": 0.5},
    {**DEFAULT, "trunk_stiffness": 2000.0, "trunk_damping": 800.0},
    {**DEFAULT, "trunk_stiffness": 8000.0, "trunk_damping": 1600.0},
    {**DEFAULT, "trunk_damping": 565.0},
    {**DEFAULT, "trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0},
)
"""The default, one change at a time, and no suspension at all; the damping ratio is near 1 (0.5 in the
last but one)."""

SETTLE, WINDOW = 10.0, 10.0
"""Seconds left out and seconds measured."""

FIGURES = (
    "mean_force_n", "peak_force_n", "weight_share", "speed_m_s", "sinkage_m", "bounce_m", "duty_factor",
)  # fmt: skip


def measure(gait: str, trunk: dict[str, Any]) -> dict[str, float]:
    """Steady motion of a trunk under a scripted gait.

    Returns:
        `FIGURES`: mean_force_n (normal force), peak_force_n (resultant), weight_share (mean force over
        weight), speed_m_s, sinkage_m (nominal less mean height), bounce_m (highest less lowest), duty_factor
        (normal force above 0); NaN if the episode fails (the trunk leaves its range of heights).
    """
    env = gym.make("hoof_env/HorseLeg-v0", episode_seconds=SETTLE + WINDOW, **trunk)
    leg: Any = env.unwrapped
    observation, _ = env.reset(seed=0, options={"gait": gait, "crank_angle": 0.0, "speed": 0.0})
    policy, ended = make_policy(gait, env), False
    records = [leg.record()]
    while not ended:
        observation, _, failed, truncated, _ = env.step(policy.predict(observation)[0])
        records.append(leg.record())
        ended = failed or truncated
    if failed:
        return dict.fromkeys(FIGURES, float("nan"))

    def steady(name: str) -> Any:
        return np.concatenate([record[name].ravel() for record in records])[1 + round(SETTLE / leg.sim_dt) :]

    x, y = steady("x"), steady("y")
    normal = steady("toe_normal") + steady("heel_normal")
    friction = steady("toe_friction") + steady("heel_friction")
    values = (
        normal.mean(),
        np.hypot(normal, friction).max(),
        normal.mean() / leg.weight,
        (x[-1] - x[0]) / WINDOW,
        leg.engine.trunk.height - y.mean(),
        np.ptp(y),
        (normal > 0).mean(),
    )
    return dict(zip(FIGURES, map(float, values), strict=True))


def study(progress: Callable[[str], None] | None = None) -> str:
    """The table of all trunks under walk and run, in Markdown."""
    lines = [
        "| gait | trunk | mean N | peak N | weight share | speed m/s | sinkage m | bounce m | duty |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    if progress:
        progress("\n".join(lines))
    for gait in ("walk", "run"):
        for trunk in TRUNKS:
            measured = measure(gait, trunk)
            cells = [
                "fails" if np.isnan(value) else f"{value:.0f}" if name.endswith("_n") else f"{value:.2f}"
                for name, value in measured.items()
            ]
            lines.append(f"| {gait} | {_name(trunk)} | {' | '.join(cells)} |")
            if progress:
                progress(lines[-1])
    return "\n".join(lines) + "\n"


def _name(trunk: dict[str, Any]) -> str:
    if trunk.get("trunk") == "rail":
        return "rail"
    mass, share, stiffness, damping = trunk.values()
    name = f"{mass:g} kg, share {share:g}, {stiffness:g} N/m, {damping:g} N s/m"
    return f"**{name}**" if trunk is DEFAULT else name

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


def measure(gait: str, trunk: dict[str, Any]) -> dict[str, float]:
    """Steady motion of a trunk under a scripted gait.

    Returns:
        mean_force_n (normal force), peak_force_n (resultant), weight_share (mean force over weight),
        speed_m_s, sinkage_m (nominal less mean height), bounce_m (highest less lowest), duty_factor; NaN if
        the episode fails (the trunk leaves its range of heights).
    """
    env = gym.make("hoof_env/HorseLeg-v0", episode_seconds=SETTLE + WINDOW, **trunk)
    leg: Any = env.unwrapped
    observation, _ = env.reset(seed=0, options={"gait": gait, "crank_angle": 0.0, "speed": 0.0})
    policy, traces, ended = make_policy(gait, env), [], False
    while not ended:
        observation, _, failed, truncated, _ = env.step(policy.predict(observation)[0])
        traces.append(leg.trace)
        ended = failed or truncated
    trace = np.concatenate(traces)[round(SETTLE / leg.sim_dt) :]
    if failed:
        trace = np.full(1, np.nan, trace.dtype)
    return {
        "mean_force_n": float(trace["normal"].mean()),
        "peak_force_n": float(trace["grf"].max()),
        "weight_share": float(trace["normal"].mean() / leg.weight),
        "speed_m_s": float((trace["trunk_x"][-1] - trace["trunk_x"][0]) / WINDOW),
        "sinkage_m": float(leg.engine.trunk.height - trace["trunk_y"].mean()),
        "bounce_m": float(np.ptp(trace["trunk_y"])),
        "duty_factor": float((trace["normal"] > 0).mean()) if not failed else float("nan"),
    }


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
            m = measure(gait, trunk)
            cells = ["fails"] * 7
            if np.isfinite(m["mean_force_n"]):
                cells = [
                    *(f"{m[name]:.0f}" for name in ("mean_force_n", "peak_force_n")),
                    *(
                        f"{m[name]:.2f}"
                        for name in ("weight_share", "speed_m_s", "sinkage_m", "bounce_m", "duty_factor")
                    ),
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

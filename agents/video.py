"""An episode as a small MP4 that every browser plays."""

from __future__ import annotations

import math
from itertools import count
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from hoof_env._output import staged
from hoof_env.film import check_whole, send


def film(
    env: gym.Env[Any, Any],
    policy: Any,
    path: Path,
    *,
    seed: int,
    seconds: float = math.inf,
    width: int | None = None,
    crf: int = 24,
    speed: float = 1.0,
) -> Path:
    """Write one episode, or its first `seconds`, to `path` in H.264; an older file is replaced at the end.

    Args:
        env: made with render_mode="rgb_array".
        policy: anything with Stable-Baselines3's `predict`.
        width: of the picture [pixels]; None keeps that of the environment.
        crf: x264's quality, lower is better and larger.
        speed: of the film over that of life.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    import imageio_ffmpeg

    fps = env.metadata["render_fps"]
    scale = ["-vf", f"scale={width}:-2:flags=lanczos"] if width else []
    with staged(path.parent) as stage:
        observation, _ = env.reset(seed=seed)
        frame: Any = env.render()
        writer = imageio_ffmpeg.write_frames(
            str(stage / path.name),
            frame.shape[1::-1],
            fps=fps * speed,
            codec="libx264",
            pix_fmt_out="yuv420p",
            macro_block_size=2,
            ffmpeg_log_level="quiet",
            output_params=["-crf", str(crf), "-preset", "slow", "-movflags", "+faststart", *scale],
        )
        writer.send(None)
        try:
            start = np.ones(1, bool)
            for shown in count(1):
                send(writer, frame)
                action, _ = policy.predict(observation, episode_start=start, deterministic=True)
                observation, _, terminated, truncated, _ = env.step(action)
                start = np.zeros(1, bool)
                frame = env.render()
                if terminated or truncated or shown >= seconds * fps:
                    break
        finally:
            writer.close()
        check_whole(stage / path.name, shown)
    return path

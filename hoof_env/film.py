"""Films of episodes: MP4 (H.264, which every browser plays) or GIF."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env import records
from hoof_env._input import as_path
from hoof_env._output import staged
from hoof_env.errors import HoofEnvError, MissingExtraError, ParameterError, check_number, parse_pairs
from hoof_env.record.columns import Columns
from hoof_env.record.instant import instants

if TYPE_CHECKING:
    from hoof_env.render.renderer import Renderer

FFMPEG: dict[str, dict[str, Any]] = {
    ".mp4": {
        "codec": "libx264",
        "pix_fmt_out": "yuv420p",
        "output_params": [
            "-vf",
            "crop=trunc(iw/2)*2:trunc(ih/2)*2",  # H.264 with yuv420p needs even widths and heights
            "-crf",
            "22",
            "-preset",
            "medium",
            "-movflags",
            "+faststart",
        ],
    },
    ".gif": {
        "codec": "gif",
        "pix_fmt_out": "pal8",
        "output_params": [
            "-vf",
            # One palette for the whole film, so that colours do not flicker. It needs all frames in memory.
            "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=none:diff_mode=rectangle",
            "-loop",
            "0",
        ],
    },
}
"""Arguments of ffmpeg by the suffix of a film."""

NOT_WHOLE = "ffmpeg could not write the whole film; is the disk full?"
"""Message of an incomplete film."""

TELL_SECONDS = 5.0
"""Time between two lines about the progress of a film, on output without a bar [s]."""


def check_film(path: Path | str, fps: float) -> None:
    """Check that a film can be written.

    Args:
        path: the film; its suffix decides the format.
        fps: frames a second [Hz].

    Raises:
        ParameterError: the rate is out of range, or not one of a GIF, which counts hundredths of a second.
        HoofEnvError: pygame, imageio-ffmpeg or ffmpeg is missing.
    """
    path = as_path("path", path)
    check_number("fps", fps, low=0, high=1000, exclusive_low=True)
    needed = {"pygame": ("pygame-ce", "render"), "imageio_ffmpeg": ("imageio-ffmpeg", "video")}
    missing = [names for module, names in needed.items() if find_spec(module) is None]
    if missing:
        packages, extras = zip(*missing, strict=True)
        raise MissingExtraError(
            f'films need {" and ".join(packages)}: pip install "hoof-env[{",".join(extras)}]"'
        )
    import imageio_ffmpeg

    try:
        program = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise no_ffmpeg() from None
    if shutil.which(program) is None:
        raise no_ffmpeg()
    # A GIF counts its frames' durations in hundredths of a second, and browsers slow down less than two.
    hundredths = 100 / fps
    if path.suffix.lower() == ".gif" and (hundredths < 2 or abs(hundredths - round(hundredths)) > 1e-6):
        raise ParameterError(f"fps: expected 50, 25, 20, 10 ... for a GIF, got {fps:g}")


def no_ffmpeg() -> HoofEnvError:
    """Return the error for a program ffmpeg that is missing or does not start."""
    program = os.environ.get("IMAGEIO_FFMPEG_EXE")
    reason = f"IMAGEIO_FFMPEG_EXE={program!r} leads to none" if program else "imageio-ffmpeg has brought none"
    return HoofEnvError(
        f"films need the program ffmpeg, and {reason}: install it, perhaps by pip install --force-reinstall"
        " imageio-ffmpeg, and let IMAGEIO_FFMPEG_EXE be its path, or unset"
    )


def frames(
    renderer: Renderer,
    episode: Iterable[Columns],
    fps: float,
    slow: float = 1.0,
) -> Iterator[NDArray[np.uint8]]:
    """Draw pictures of an episode, 1 / (fps slow) of its seconds apart.

    Args:
        renderer: renderer in mode "rgb_array"; it is reset.
        episode: columns as `records.episode` yields them.
        fps: frames a second [Hz].
        slow: factor by which the film is slower than the episode.

    Yields:
        Pictures of shape (height, width, 3), each at the first substep at or after its time.
    """
    renderer.reset()
    step = 1 / (fps * slow)
    shown = 0
    news: list[Any] = []
    for columns in episode:
        for instant in instants(columns, renderer.here.hips):
            news.append(instant)
            # Times are sums of substeps, and rounding must not delay a frame by one.
            if instant.time >= shown * step - 1e-9:
                renderer.add(news)
                news = []
                frame = renderer.frame()
                assert frame is not None
                # A substep longer than a frame repeats it.
                while instant.time >= shown * step - 1e-9:
                    shown += 1
                    yield frame


def write_film(pictures: Iterable[NDArray[np.uint8]], path: Path | str, fps: float) -> int:
    """Write pictures to a film; an older file is replaced when the new one is complete.

    Args:
        pictures: pictures of the same shape (height, width, 3).
        path: the film, an .mp4 or a .gif.
        fps: frames a second [Hz].

    Returns:
        The number of frames.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
        ParameterError, HoofEnvError: as in `check_film`.
    """
    path = as_path("path", path)
    check_film(path, fps)
    with staged(path.parent) as stage:
        writer: Any = None
        count = 0
        try:
            for picture in pictures:
                if writer is None:
                    writer = _writer(stage / path.name, picture.shape, fps)
                try:
                    writer.send(np.ascontiguousarray(picture))
                except OSError:
                    # The message of imageio-ffmpeg has many lines.
                    raise OSError(NOT_WHOLE) from None
                count += 1
        finally:
            if writer is not None:
                writer.close()
        # ffmpeg may fail after it has taken the last picture.
        if count and _count_frames(stage / path.name) < count:
            raise OSError(NOT_WHOLE)
    return count


def _count_frames(path: Path) -> int:
    """Return the number of frames of a film, 0 if it cannot be read."""
    import imageio_ffmpeg

    try:
        return int(imageio_ffmpeg.count_frames_and_secs(str(path))[0])
    except RuntimeError:
        return 0


def _writer(path: Path, shape: tuple[int, ...], fps: float) -> Any:
    """Start ffmpeg for pictures of shape (height, width, 3); return the generator that takes them."""
    import imageio_ffmpeg

    options: dict[str, Any] = FFMPEG[path.suffix.lower()]
    writer = imageio_ffmpeg.write_frames(
        str(path), shape[1::-1], fps=fps, macro_block_size=1, ffmpeg_log_level="error", **options
    )
    try:
        # The first `send` of the generator looks for ffmpeg and starts it.
        writer.send(None)
    except (RuntimeError, OSError):
        raise no_ffmpeg() from None
    return writer


def render_episode(
    path: Path | str,
    policy: str | None,
    env_id: str,
    arguments: Sequence[str] = (),
    seed: int = 0,
    seconds: float = 8.0,
    slow: float = 1.0,
    fps: float = 50.0,
    size: tuple[int, int] = (960, 540),
) -> int:
    """Film an episode, as `hoof-env render` does.

    Args:
        path: the film, an .mp4 or a .gif.
        policy: policy as `records.find_policy` takes it.
        env_id: id of the environment.
        arguments: arguments of the environment, key=value or JSON objects.
        seed: seed of the episode and of the policy "random".
        seconds: time after which the episode is stopped [s].
        slow: factor by which the film is slower than the episode.
        fps: frames a second [Hz].
        size: width and height [pixels].

    Returns:
        The number of frames.

    Raises:
        HoofEnvError: a subclass as in `records.make_env`, `records.find_policy` and `write_film`.
    """
    path = as_path("path", path)
    from hoof_env.render.renderer import Renderer

    records.check_place(path, FFMPEG)
    check_film(path, fps)
    check_number("slow", slow, low=1e-3, high=1e3)
    check_number("seed", seed, low=0)
    check_number("seconds", seconds, low=0, exclusive_low=True)
    with records.make_env(env_id, parse_pairs("--env-kwargs", arguments)) as env:
        player = records.find_policy(policy, env, env_id, seed)
        renderer = Renderer(records.surroundings(env), size=size)
        played = records.episode(env, player, seed, seconds)
        pictures = frames(renderer, played, fps, slow)
        most = round(records.longest_of(env, seconds) * slow * fps) + 1
        count = write_film(_with_progress(pictures, most), path, fps)
    return count


def _with_progress(pictures: Iterable[NDArray[np.uint8]], most: int) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures and show the progress on stderr, by a bar on a terminal with tqdm, else by lines.

    Args:
        pictures: the pictures.
        most: largest number of them.
    """
    if sys.stderr.isatty() and find_spec("tqdm"):
        from tqdm import tqdm

        yield from tqdm(pictures, total=most, unit=" frames", leave=False)
        # For a GIF, ffmpeg's work begins only now, and takes a while.
        print("all frames are drawn; ffmpeg ends the file ...", file=sys.stderr)
        return
    printed = time.monotonic()
    for count, picture in enumerate(pictures, 1):
        yield picture
        if time.monotonic() - printed >= TELL_SECONDS:
            printed = time.monotonic()
            print(f"{count} of {most} frames", file=sys.stderr, flush=True)

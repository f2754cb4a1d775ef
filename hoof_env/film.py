"""An episode as a film: MP4 (H.264, which every browser plays) or GIF."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env import records
from hoof_env._output import staged
from hoof_env.errors import HoofEnvError, ParameterError, check_number, parse_pairs
from hoof_env.render.instant import Columns, instants

if TYPE_CHECKING:
    from hoof_env.render.renderer import Renderer

FFMPEG: dict[str, dict[str, Any]] = {
    ".mp4": {
        "codec": "libx264",
        "pix_fmt_out": "yuv420p",
        "output_params": [
            "-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2",  # what H.264 can have
            "-crf", "22", "-preset", "medium", "-movflags", "+faststart",
        ],
    },
    ".gif": {  # one palette for the whole film, so that colours do not flicker; it takes all frames at once
        "codec": "gif",
        "pix_fmt_out": "pal8",
        "output_params": [
            "-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=none:diff_mode=rectangle",
            "-loop", "0",
        ],
    },
}  # fmt: skip
"""How ffmpeg writes each kind of film."""

NOT_WHOLE = "ffmpeg could not write the whole film; is the disk full?"
TELL_SECONDS = 5.0  # time between two lines about how far a film is, where there is no bar [s]


def check_film(path: Path, fps: float) -> None:
    """Raise unless a film of this kind and pace can be written here: a GIF counts hundredths of a second."""
    check_number("fps", fps, low=0, high=1000, exclusive_low=True)
    for name, package, extra in (
        ("pygame", "pygame-ce", "render"),
        ("imageio_ffmpeg", "imageio-ffmpeg", "video"),
    ):
        if find_spec(name) is None:
            raise HoofEnvError(f'films need {package}: pip install "hoof-env[{extra}]"')
    import imageio_ffmpeg

    try:
        program = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise no_ffmpeg() from None
    if shutil.which(program) is None:
        raise no_ffmpeg()
    hundredths = 100 / fps  # in which a GIF counts; browsers slow down what has less than two
    if path.suffix.lower() == ".gif" and (hundredths < 2 or abs(hundredths - round(hundredths)) > 1e-6):
        raise ParameterError(f"fps: expected 50, 25, 20, 10 ... of a GIF, got {fps:g}")


def no_ffmpeg() -> HoofEnvError:
    """The error where there is no program ffmpeg, or it does not start."""
    given = os.environ.get("IMAGEIO_FFMPEG_EXE")
    found = f"IMAGEIO_FFMPEG_EXE={given!r} leads to none" if given else "imageio-ffmpeg has brought none"
    return HoofEnvError(
        f"films need the program ffmpeg, and {found}: install it, perhaps by pip install --force-reinstall"
        " imageio-ffmpeg, and let IMAGEIO_FFMPEG_EXE be its path, or unset"
    )


def frames(
    renderer: Renderer,
    episode: Iterable[Columns],
    fps: float,
    slow: float = 1.0,
    read: Callable[[Columns], list[Any]] = instants,
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of an episode, 1 / (fps slow) of its seconds apart, each at the last substep before its time;
    `renderer` is in mode "rgb_array" and is reset, `episode` as `records.episode` yields it; `read` makes
    instants of its columns."""
    renderer.reset()
    step = 1 / (fps * slow)
    shown = 0
    news: list[Any] = []
    for columns in episode:
        for now in read(columns):
            news.append(now)
            if now.time >= shown * step - 1e-9:
                renderer.add(news)
                news = []
                frame = renderer.frame()
                assert frame is not None
                while now.time >= shown * step - 1e-9:  # substeps longer than a frame repeat it
                    shown += 1
                    yield frame


def write_film(pictures: Iterable[NDArray[np.uint8]], path: Path, fps: float) -> int:
    """Write pictures of one shape (height, width, 3) to an .mp4 or a .gif and return how many; an older file
    is replaced when this is whole. `OutputError` where the folder cannot be written, or the disk is full, and
    `HoofEnvError` where there is no ffmpeg."""
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
                except OSError:  # in many lines
                    raise OSError(NOT_WHOLE) from None
                count += 1
        finally:
            if writer is not None:
                writer.close()
        if count and _count_frames(stage / path.name) < count:  # ffmpeg may fail after it took the last one
            raise OSError(NOT_WHOLE)
    return count


def _count_frames(path: Path) -> int:
    import imageio_ffmpeg

    try:
        return int(imageio_ffmpeg.count_frames_and_secs(str(path))[0])
    except RuntimeError:
        return 0


def _writer(path: Path, shape: tuple[int, ...], fps: float) -> Any:
    import imageio_ffmpeg

    options: dict[str, Any] = FFMPEG[path.suffix.lower()]
    writer = imageio_ffmpeg.write_frames(
        str(path), shape[1::-1], fps=fps, macro_block_size=1, ffmpeg_log_level="error", **options
    )
    try:
        writer.send(None)  # looks for it, and starts it
    except (RuntimeError, OSError):
        raise no_ffmpeg() from None
    return writer


def render_episode(
    path: Path,
    policy: str | None,
    env_id: str,
    arguments: Sequence[str] = (),
    seed: int = 0,
    seconds: float = 8.0,
    slow: float = 1.0,
    fps: float = 50.0,
    size: tuple[int, int] = (960, 540),
) -> int:
    """Film an episode; returns the number of frames. What `hoof-env render` does; errors are those of
    `records.make_env`, `records.find_policy` and `write_film`."""
    from hoof_env.render.renderer import new_renderer

    records.check_place(path, FFMPEG)
    check_film(path, fps)
    check_number("slow", slow, low=1e-3, high=1e3)
    check_number("seed", seed, low=0)
    check_number("seconds", seconds, low=0, exclusive_low=True)
    with records.make_env(env_id, parse_pairs("--args", arguments)) as env:
        player = records.find_policy(policy, env, env_id, seed)
        renderer = new_renderer(records.surroundings(env), fps, size)
        played = records.episode(env, player, seed, seconds)
        pictures = frames(renderer, played, fps, slow, partial(records.instants_of, env))
        count = write_film(_with_progress(pictures, round(seconds * slow * fps) + 1), path, fps)
    return count


def _with_progress(pictures: Iterable[NDArray[np.uint8]], most: int) -> Iterator[NDArray[np.uint8]]:
    """The same, and how far it is, on stderr: a bar on a terminal that has tqdm, else a line now and then."""
    if sys.stderr.isatty() and find_spec("tqdm"):
        from tqdm import tqdm

        yield from tqdm(pictures, total=most, unit=" frames", leave=False)
        print("all frames are drawn; ffmpeg ends the file ...", file=sys.stderr)  # of a GIF it begins now
        return
    told = time.monotonic()
    for count, picture in enumerate(pictures, 1):
        yield picture
        if time.monotonic() - told >= TELL_SECONDS:
            told = time.monotonic()
            print(f"{count} of {most} frames", file=sys.stderr, flush=True)

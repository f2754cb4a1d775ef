"""Command line `hoof-env`: a function is a sub-command, its parameters the options, its docstring the help.

Exit codes: 0 done, 2 a wrong argument or an error that is explained in one line, 130 interrupted, 141 the
reader of the output has gone.
"""

from __future__ import annotations

import os
import shlex
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from hoof_env._output import bear_any_output, check_arguments, flush_or_drop
from hoof_env._version import __version__
from hoof_env.commands.console import say as _say
from hoof_env.commands.console import size as _size
from hoof_env.commands.episode_args import USUAL, Played
from hoof_env.commands.lab import average, compare
from hoof_env.commands.leg import lengths
from hoof_env.commands.manual import manual
from hoof_env.commands.options import parse
from hoof_env.commands.policies import demo, evaluate, list_ids
from hoof_env.errors import HoofEnvError, bounded, printable


def reproduce(out: Path, figures: bool = True, preset: str | None = None) -> None:
    """Run the paper's four conditions with every solver and compare them with every published number.

    Args:
        out: folder for reproduction.json, reproduction.md and the figures; made if it is missing.
        figures: draw figures 1 and 3 to 6, too (needs the extra 'plot').
        preset: geometry and gaits, a name or a JSON file; the package's default if left out.
    """
    from hoof_env._output import check_folder
    from hoof_env._plotting import check_matplotlib

    options = ([] if figures else ["--no-figures"]) + (["--preset", preset] if preset else [])
    command = shlex.join(["hoof-env", "reproduce", "--out", str(out), *options])
    # Before the simulation, which takes a while.
    check_folder(out)
    if figures:
        check_matplotlib(", or leave them out with --no-figures")
    from hoof_env.paper.reproduce import reproduce, write_reproduction

    paths = write_reproduction(reproduce(_say, preset=preset), out, figures=figures, command=command)
    _say(f"{len(paths)} files written; read {out / 'reproduction.md'} first")


def render(
    out: Path,
    episode: Played = USUAL,
    seconds: float = 8.0,
    slow: float = 1.0,
    fps: float = 50.0,
    size: tuple[int, int] = (960, 540),
    overwrite: bool = False,
) -> None:
    """Film an episode of a policy (needs 'render' and 'video').

    Args:
        out: the film; ends in .mp4 or .gif. Its folder is made if it is missing.
        episode: policy, environment and seed.
        seconds: longest duration of the episode.
        slow: factor by which the film plays slower than life.
        fps: frames a second.
        size: width and height [pixels].
        overwrite: replace an existing file.
    """
    from hoof_env._output import check_new, new_file
    from hoof_env.film import FFMPEG, render_episode
    from hoof_env.records import check_place

    made = check_new(out, overwrite)
    check_place(out, FFMPEG)
    with new_file(out, overwrite) as file:
        count = render_episode(
            file, episode.policy, episode.env_id, episode.env_kwargs, episode.seed, seconds, slow, fps, size
        )
    _say(f"{out}: {count} frames, {count / fps:.1f} s, {_size(out)}{made}")


def view(
    episode: Played = USUAL,
    port: int = 5006,
    address: str = "127.0.0.1",
    host: tuple[str, ...] = (),
    open: bool = True,
    out: Path = Path(),
) -> None:
    """See and touch a leg or a horse in the browser: scene, forces, settings, recordings (needs 'view').

    Args:
        episode: policy, environment and seed.
        port: port of the page; 0 takes any that is free.
        address: address on which the page is served; any other than this machine's own lets others use it.
        host: names of this machine by which browsers may come, such as the one of a proxy. Without them the
            page is served by loopback names, and with another address by local names and numbers.
        open: open the page in the browser, where there is a display.
        out: folder of recordings; made if it is missing.
    """
    from hoof_env.view.server import view

    view(episode.env_id, episode.env_kwargs, episode.policy, episode.seed, address, port, open, out, host)


def export(
    out: Path,
    episode: Played = USUAL,
    seconds: float | None = None,
    threshold: float = 20.0,
    units: str = "N",
    reactions: bool = False,
    bodies: tuple[str, ...] = (),
    overwrite: bool = False,
) -> None:
    """Write the ground reaction force of each limb at every substep, with its centre of pressure.

    Args:
        out: the file; ends in .csv, .parquet (needs 'export'), .c3d (needs 'lab'), or OpenSim's .mot or .sto,
            which come with ExternalLoads in the same folder, as run_loads.xml (run_sto_loads.xml). The folder
            is made if it is missing.
        episode: policy, environment and seed.
        seconds: longest duration of the episode; without it, the episode is played to its end.
        threshold: force along the ground's normal below which a limb counts as unloaded, as on a force
            plate [N].
        units: unit of forces: N, or BW for body weights (.csv and .parquet).
        reactions: add the forces in the joints of each leg (not in .c3d).
        bodies: bodies of your OpenSim model that carry the forces: leg=BODY, or left_fore=BODY ...
        overwrite: replace existing files.
    """
    from hoof_env._output import check_new, new_file
    from hoof_env.records import check_export, export_episode, files_of

    # All files of the format are checked; the message names the first of them.
    made, *_ = [check_new(file, overwrite) for file in files_of(out)]
    check_export(out)
    with new_file(out, overwrite, files_of(out)) as file:
        rows, weight = export_episode(
            file,
            episode.policy,
            episode.env_id,
            episode.env_kwargs,
            episode.seed,
            seconds,
            threshold,
            units,
            reactions,
            bodies,
        )
    others = "".join(f", with {file.name}" for file in files_of(out)[1:])
    _say(f"{out}: {rows} rows, 1 BW = {weight:.1f} N, {_size(out)}{others}{made}")


def mjcf(
    out: Path,
    preset: str | None = None,
    trunk: str = "fixed",
    motor: bool = True,
    ground: bool = True,
    theta: float = 0.0,
    swing: float = 0.0,
    overwrite: bool = False,
) -> None:
    """Write a leg as a model of MuJoCo, with closed loops, a motor, a trunk and a floor.

    Args:
        out: the model; ends in .xml. Its folder is made if it is missing.
        preset: the leg, a name or a JSON file; the package's default if left out.
        trunk: what carries it: fixed, rail, suspended or free, with the package's default masses, as high as
            the hip of the preset.
        motor: drive the crank by the package's default motor; otherwise it turns freely.
        ground: add a floor with the friction of the preset's ground, on which MuJoCo's own contact acts.
        theta, swing: crank angle and swing of the pose in which the model begins [rad], which the commands of
            the keyframe "pose" hold.
        overwrite: replace an existing file.
    """
    from hoof_env._output import check_new, new_file
    from hoof_env.dynamics.parts import Motor, Trunk
    from hoof_env.ground.contact import load_ground
    from hoof_env.leg.checks import checked_path
    from hoof_env.leg.geometry import load_geometry
    from hoof_env.leg.presets import DEFAULT_PRESET

    made = check_new(out, overwrite)
    checked_path(out, ".xml")
    chosen = preset or DEFAULT_PRESET
    leg = load_geometry(chosen)
    with new_file(out, overwrite) as file:
        leg.to_mjcf(
            file,
            theta=theta,
            swing=swing,
            trunk=Trunk(kind=trunk, height=leg.hip_height),
            motor=Motor() if motor else None,
            ground=load_ground(chosen) if ground else None,
        )
    _say(f"{out}: {_size(out)}{made}")


COMMANDS: dict[str, Callable[..., None]] = {
    command.__name__: command
    for command in (reproduce, render, view, export, compare, average, manual, lengths, mjcf)
} | {"evaluate": evaluate, "list": list_ids, "demo": demo}
"""Functions by sub-command, in the order of the help."""


AXIS_OPTIONS = frozenset(f"--{name}{which}" for name in ("up", "forward") for which in ("", "-a", "-b"))
"""Options with an axis, such as -x, as their value."""


def _with_axes(arguments: list[str]) -> list[str]:
    """Join an axis such as -x to the option before it, as the parser would take it for another option."""
    joined: list[str] = []
    for item in arguments:
        if joined and joined[-1] in AXIS_OPTIONS and item in ("-x", "-y", "-z"):
            joined[-1] += f"={item}"
        else:
            joined.append(item)
    return joined


@contextmanager
def _warnings_of_one_line() -> Iterator[None]:
    """Make warnings print their words alone, without the place in the code."""
    usual = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: f"hoof-env: warning: {bounded(str(message))}\n"
    try:
        yield
    finally:
        warnings.formatwarning = usual


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command, by default the one of the command line; return the exit code."""
    options = _with_axes(sys.argv[1:] if arguments is None else list(arguments))
    bear_any_output()
    if options == ["--version"]:
        _say(f"hoof-env {__version__}")
        return 0
    # For --env-id module:..., as `python -m hoof_env` has it; last, so that no file there hides a module.
    if not {"", os.getcwd()} & set(sys.path):
        sys.path.append(os.getcwd())
    try:
        check_arguments(options)
        about = "A horse's leg, or a horse, on the ground. --version prints the version."
        with _warnings_of_one_line():
            parse(COMMANDS, options, "hoof-env", about)
        sys.stdout.flush()
    except HoofEnvError as error:
        print(f"hoof-env: error: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader of the output, such as `head`, has gone. The rest of the buffer goes nowhere, as flushing
        # it at the end would raise the error again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        # The disk that takes our output is full.
        flush_or_drop()
        print(
            f"hoof-env: error: cannot write the output: {printable(error.strerror or str(error))}",
            file=sys.stderr,
        )
        return 2
    except RecursionError:
        print("hoof-env: error: a file or an argument is nested too deep", file=sys.stderr)
        return 2
    except MemoryError as error:
        print(f"hoof-env: error: there is not enough memory; {error}".rstrip("; "), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())

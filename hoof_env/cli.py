"""The command line `hoof-env`: one function a sub-command, its signature the options, its docstring the help.

Exit codes: 0 done, 2 a wrong argument or an error that is explained in one line, 130 interrupted.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hoof_env.errors import HoofEnvError


def reproduce(out: Path, figures: bool = True, preset: str | None = None) -> None:
    """Run the paper's four conditions with both solvers and compare every published number with them.

    Args:
        out: folder for reproduction.json, reproduction.md and the figures; made if need be.
        figures: draw figures 1 and 3 to 6 too (needs the extra 'plot').
        preset: geometry and gaits, a name or a JSON file; the package's default if left out.
    """
    from hoof_env._output import check_folder
    from hoof_env.paper.figures import check_matplotlib
    from hoof_env.paper.reproduce import reproduce, write_reproduction

    check_folder(out)
    if figures:
        check_matplotlib()
    options = [
        "--out",
        str(out),
        *([] if figures else ["--no-figures"]),
        *(["--preset", preset] if preset else []),
    ]
    result = reproduce(_say, preset=preset)
    paths = write_reproduction(
        result, out, figures=figures, command=shlex.join(["hoof-env", "reproduce", *options])
    )
    _say(f"{len(paths)} files written; read {out / 'reproduction.md'} first")


def trunks() -> None:
    """Measure how the scripted walk and run move a rail and differently suspended trunks; prints a table."""
    from hoof_env.envs.trunk_study import study

    study(_say)


COMMANDS: dict[str, Callable[..., None]] = {"reproduce": reproduce, "trunks": trunks}


def _say(line: str) -> None:
    print(line, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command, by default the one on the command line; returns the exit code."""
    try:
        import tyro

        tyro.extras.subcommand_cli_from_dict(
            COMMANDS, prog="hoof-env", description="A horse's leg on the ground.", args=arguments
        )
    except HoofEnvError as error:
        print(f"hoof-env: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())

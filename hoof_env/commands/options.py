"""Options of commands, read by tyro."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from typing import Any


def parse(
    command: Callable[..., Any] | Mapping[str, Callable[..., Any]],
    arguments: Sequence[str] | None,
    program: str,
    description: str | None = None,
) -> Any:
    """Call a command with the arguments of a command line, and return its result.

    A wrong argument ends the process with exit code 2, and shows the options of that very command.

    Args:
        command: function or dataclass, or several by the name of their sub-command.
        arguments: words after the program's name; this process's by default.
        program: name of the program in messages.
        description: help above the options; otherwise the docstring of the command.
    """
    import tyro

    words = sys.argv[1:] if arguments is None else list(arguments)
    if isinstance(command, Mapping):
        if words and words[0] in command:
            return parse(command[words[0]], words[1:], f"{program} {words[0]}")
        return tyro.extras.subcommand_cli_from_dict(
            dict(command), prog=program, description=description, args=words
        )
    try:
        return tyro.cli(command, prog=program, description=description, args=words)
    except SystemExit as end:
        if end.code == 2:
            print(f"options of {program}: {', '.join(names_of(command))}", file=sys.stderr)
        raise


def names_of(command: Callable[..., Any]) -> list[str]:
    """Return the names of a command's options, in the order of its help."""
    import tyro

    with redirect_stdout(io.StringIO()) as text, suppress(SystemExit):
        tyro.cli(command, args=["--help"])
    # Names stand at the left, texts of help are indented
    return re.findall(r"^\W{0,2}(--[a-z][\w-]*)", text.getvalue(), re.MULTILINE)

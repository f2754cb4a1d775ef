"""What both commands share: options from a function's signature, checks, one line for an error."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hoof_env.errors import HoofEnvError, MissingExtraError, check_number
from research.identify.leg import Choice, encode


def run_command(command: Callable[..., None], name: str, arguments: Sequence[str] | None = None) -> int:
    """Call `command` with the options of the command line; returns 0, 2 after an error, 130 interrupted."""
    import tyro

    try:
        tyro.cli(command, prog=f"python -m {name}", args=arguments)
    except HoofEnvError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; the same command goes on with --resume", file=sys.stderr)
        return 130
    return 0


def check_extras() -> None:
    for name in ("cma", "scipy", "tqdm"):
        try:
            importlib.import_module(name)
        except ImportError:
            raise MissingExtraError(f'identify needs {name}: pip install "hoof-env[identify]"') from None


def check_counts(**counts: Any) -> list[int]:
    """Whole numbers: seed and attempts 0 or more, all others 1 or more."""
    return [
        int(check_number(n, v, low=n not in ("seed", "attempts"), high=1024 if n == "workers" else 2**53))
        for n, v in counts.items()
    ]


def provenance(how: str, about: Mapping[str, Any]) -> str:
    settings = {**about, **about["versions"]}
    words = (f"{name} {value}" for name, value in settings.items() if name not in ("versions", "schedule"))
    return (
        "Identified, not published: found from the results printed in Batbaatar & Wagatsuma 2021 (doi "
        f"10.2991/jrnal.k.210713.002), which prints neither lengths nor swing parameters, by {how}. "
        f"Settings: {', '.join(words)}."
    )


def load_start(start: str, exponent: float) -> tuple[Choice, tuple[float, ...]]:
    """Choice and x of a preset, by name or file, on ground with this exponent; errors name the preset."""
    try:
        choice, x = encode(start, exponent)
    except HoofEnvError as error:
        raise type(error)(f"start {start}: {error}") from None
    return choice, tuple(x.tolist())

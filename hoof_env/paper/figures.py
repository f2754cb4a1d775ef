"""Figures 1 and 3 to 6 of the paper, redrawn from a reproduction (needs matplotlib, extra `plot`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hoof_env._output import staged
from hoof_env.errors import HoofEnvError
from hoof_env.paper.figure_angles import draw_angles
from hoof_env.paper.figure_forces import draw_forces
from hoof_env.paper.figure_mechanism import draw_mechanism
from hoof_env.paper.figure_paths import draw_paths
from hoof_env.paper.figure_style import PRINT
from hoof_env.paper.figure_vectors import draw_vectors

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction


def check_matplotlib() -> None:
    """Raise `HoofEnvError` with the way out unless matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise HoofEnvError(
            'figures need matplotlib: pip install "hoof-env[plot]", or leave them out with --no-figures'
        ) from None


def draw_all(reproduction: Reproduction, folder: Path | str) -> list[Path]:
    """Draw figures 1 and 3 to 6 as PNG and SVG, the same bytes for the same reproduction.

    Args:
        reproduction: what to draw.
        folder: made if need be.

    Returns:
        The paths of the files.

    Raises:
        HoofEnvError: matplotlib is missing. OutputError: the folder cannot be written.
    """
    check_matplotlib()
    from matplotlib import style
    from matplotlib.figure import Figure

    folder = Path(folder)
    drawings: dict[str, Callable[[Any, Reproduction], None]] = {
        "figure1": draw_mechanism,
        "figure3": draw_paths,
        "figure4": draw_angles,
        "figure5": draw_forces,
        "figure6": draw_vectors,
    }
    paths = []
    with staged(folder) as stage, style.context(["default", PRINT]):
        for name, draw in drawings.items():
            figure = Figure()
            draw(figure, reproduction)
            paths += [folder / file.name for file in save(figure, stage / name)]
    return paths


def save(figure: Any, path: Path) -> list[Path]:
    """Save a figure as `path` with suffixes .png and .svg, without the date; returns the two paths."""
    files = [path.with_suffix(suffix) for suffix in (".png", ".svg")]
    for file, metadata in zip(files, ({}, {"Date": None}), strict=True):
        figure.savefig(file, metadata=metadata)
    return files

"""Figures 1 and 3 to 6 of the paper, redrawn from a reproduction (needs matplotlib, extra `plot`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hoof_env._output import staged
from hoof_env.errors import HoofEnvError
from hoof_env.paper.figure_force import draw_forces, draw_vectors
from hoof_env.paper.figure_mechanism import draw_mechanism
from hoof_env.paper.figure_motion import draw_angles, draw_paths
from hoof_env.paper.figure_style import STYLE

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


def draw_all(reproduction: Reproduction, out_dir: Path | str) -> list[Path]:
    """Draw figures 1 and 3 to 6 as PNG and SVG; returns the paths of the files.

    Raises:
        HoofEnvError: matplotlib is missing. OutputError: the folder cannot be written.
    """
    check_matplotlib()
    import matplotlib
    from matplotlib.figure import Figure

    out_dir = Path(out_dir)
    drawings: dict[str, Callable[[Any, Reproduction], None]] = {
        "figure1": draw_mechanism,
        "figure3": draw_paths,
        "figure4": draw_angles,
        "figure5": draw_forces,
        "figure6": draw_vectors,
    }
    paths = []
    with staged(out_dir) as stage, matplotlib.rc_context(STYLE):
        for name, draw in drawings.items():
            figure = Figure(layout="constrained")
            draw(figure, reproduction)
            for suffix, metadata in (("png", {}), ("svg", {"Date": None})):
                figure.savefig(stage / f"{name}.{suffix}", metadata=metadata)
                paths.append(out_dir / f"{name}.{suffix}")
    return paths

"""The paper re-examined: all parts of the study on one page, with their numbers and figures beside it."""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

from hoof_env import __version__
from hoof_env._output import staged
from hoof_env.errors import OutputError
from hoof_env.paper.figure_style import STYLE
from hoof_env.paper.reproduce import Reproduction, reproduce, write_reproduction
from hoof_env.paper.solvers_text import ground_text, solvers_text
from hoof_env.paper.study.claims import examine_claims
from hoof_env.paper.study.findings import findings
from hoof_env.paper.study.laws import examine_laws
from hoof_env.paper.study.numerics import examine_numerics
from hoof_env.paper.study.section import Section, for_json
from hoof_env.paper.study.sensitivity import examine_sensitivity
from hoof_env.paper.study.slips import examine_slips

PAGE, FOLDER = "paper.md", "paper"
"""The page, and the folder beside it that holds everything else."""

FIGURES = {
    "figure1": "Figure 1: the mechanism and the hoof on the ground",
    "figure3": "Figure 3: paths of the hoof",
    "figure4": "Figure 4: hoof angle",
    "figure5": "Figure 5: ground reaction force",
    "figure6": "Figure 6: direction of the ground reaction force, elastic",
}
"""The paper's figures as `reproduce` redraws them."""

_PACKAGES = ("gymnasium", "numpy", "numba")
_IMAGE = re.compile(r"!?\[[^\]]*\]\(([\w-]+)\.png\)")


@dataclass(frozen=True)
class Study:
    """The four conditions and the parts of the study by short name, in the order of the page."""

    reproduction: Reproduction
    sections: dict[str, Section]


def study(progress: Callable[[str], None] | None = None, *, preset: str | None = None) -> Study:
    """Run the four conditions and every part of the study.

    Args:
        progress: called with a line now and then.
        preset: geometry and gaits, a name or a file; the environment's default if None.

    Raises:
        HoofEnvError: a preset that is unknown or does not walk and run.
    """
    tell = progress or (lambda line: None)
    reproduction = reproduce(tell, preset=preset)
    parts: dict[str, Callable[..., Section]] = {
        "numerics": examine_numerics,
        "laws": examine_laws,
        "sensitivity": examine_sensitivity,
        "slips": partial(examine_slips, reproduction=reproduction),
        "claims": partial(examine_claims, reproduction=reproduction),
    }
    return Study(reproduction, {name: part(preset, tell) for name, part in parts.items()})


def check_place(out_dir: Path) -> None:
    """Raise `OutputError` if the study's folder cannot be made in `out_dir`."""
    folder = out_dir / FOLDER
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"cannot write to {str(folder)!r} (it is a file); expected a folder or nothing")


def write_study(
    result: Study,
    out_dir: Path | str,
    *,
    figures: bool = True,
    command: str = "hoof-env reproduce --study --out DIR",
) -> list[Path]:
    """Write `paper.md`, and into the folder `paper` beside it `study.json`, figures and all of `reproduce`.

    Nothing replaces an older result unless everything could be written.

    Args:
        result: what to write.
        out_dir: folder, made if need be.
        figures: draw the figures too.
        command: what the page names as the command that wrote it.

    Returns:
        The paths of the files.

    Raises:
        OutputError: the folder cannot be written. HoofEnvError: figures without matplotlib.
    """
    out_dir = Path(out_dir)
    check_place(out_dir)
    with staged(out_dir) as stage:
        folder, target = stage / FOLDER, out_dir / FOLDER
        write_reproduction(result.reproduction, folder, figures=figures, command=command)
        data = {name: {"title": s.title, **s.data} for name, s in result.sections.items()}
        text = json.dumps(for_json(data), indent=1, ensure_ascii=False, allow_nan=False)
        (folder / "study.json").write_text(text + "\n", encoding="utf-8")
        if figures:
            _draw(result, folder)
        (stage / PAGE).write_text(markdown(result, command=command, figures=figures), encoding="utf-8")
        files = sorted(file.name for file in folder.iterdir())
        target.mkdir(exist_ok=True)
        for name in files:
            os.replace(folder / name, target / name)
        folder.rmdir()
    return [out_dir / PAGE, *(target / name for name in files)]


def _draw(result: Study, folder: Path) -> None:
    import matplotlib

    from hoof_env.paper.figures import save

    with matplotlib.rc_context(STYLE):
        for section in result.sections.values():
            for name, draw in section.figures.items():
                save(draw(), folder / name)


def markdown(result: Study, *, command: str, figures: bool) -> str:
    """The whole page; `figures` says whether there are pictures to show."""
    reproduction = result.reproduction
    versions = ", ".join(
        [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in _PACKAGES)]
    )
    geometry = reproduction.geometry
    data = {name: section.data for name, section in result.sections.items()}
    parts = [
        "# The paper re-examined",
        f"{reproduction.published.source}.",
        f"The paper prints results but no leg: **everything below is measured on an identified leg** (preset "
        f"`{geometry.name}`), found from those results. {geometry.provenance}",
        f"Written by `{command}` with hoof-env {__version__}, {versions}. Every number comes from that run; "
        f"[study.json]({FOLDER}/study.json) has them all, [reproduction.md]({FOLDER}/reproduction.md) the "
        "printed numbers row by row.",
        f"{ground_text(reproduction)} {solvers_text(reproduction.published)}",
        "## Findings",
        "\n".join(f"- {line}" for line in findings(reproduction, data)),
        *(
            part
            for number, section in enumerate(result.sections.values(), 1)
            for part in (f"## {number}. {section.title}", _body(section, figures))
        ),
    ]
    if figures:
        parts += [
            "## The paper's figures, redrawn",
            *(_image(title, name) for name, title in FIGURES.items()),
        ]
    return "\n\n".join(parts) + "\n"


def _image(title: str, name: str) -> str:
    return f"![{title}]({FOLDER}/{name}.png)\n\n*{title}.* [SVG]({FOLDER}/{name}.svg)"


def _body(section: Section, figures: bool) -> str:
    """A section's text with its figures in place, or without them."""

    def place(match: re.Match[str]) -> str:
        name, text = match[1], match[0]
        if text.startswith("!"):
            return _image(text[2 : text.index("]")], name) if figures else ""
        return f"[{name}]({FOLDER}/{name}.png)" if figures else name

    return re.sub(r"\n{3,}", "\n\n", _IMAGE.sub(place, section.markdown)).strip()

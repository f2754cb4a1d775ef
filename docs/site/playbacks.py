"""Pages of the site that play: for each id, for the paper and for the horse, made when the site is built."""

from __future__ import annotations

import re
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
from sphinx.application import Sphinx

from hoof_env.view.controls import CONDITIONS, PAPER_ID
from hoof_env.view.playback import Playback

FOLDER = Path("_static") / "view"
LIBRARY = "bokeh.min.js"
SECONDS = {"hoof_env/Horse-v0": 2.0, "hoof_env/HorseRough-v0": 2.0, "hoof_env/HorseLegFixed-v0": 1.0}
USUAL = 3.0  # [s]
SKIP = 2.0  # an agent needs a second or two to find its gait [s]


def ids() -> list[str]:
    """Return the ids of the package that have a page."""
    return sorted(id for id in gymnasium.registry if id.startswith("hoof_env/"))


def name_of(env_id: str) -> str:
    """Return the name of an id's page."""
    return env_id.removeprefix("hoof_env/").rpartition("-")[0]


def playback_of(env_id: str) -> Playback:
    """Return the page of the policy that ships for an id."""
    run: dict[str, Any] = {"env_id": env_id, "policy": "shipped"}
    skip = 0.0 if env_id == PAPER_ID else SKIP
    title = f"{name_of(env_id)}, the agent that ships"
    return Playback.play(run, seconds=SECONDS.get(env_id, USUAL), skip=skip, title=title)


def of_paper() -> Playback:
    """Return the page of the paper's four conditions."""
    runs = [
        {"label": label, "env_id": PAPER_ID, "policy": arguments["gait"], "arguments": arguments}
        for label, arguments in CONDITIONS.items()
    ]
    return Playback.play(*runs, seconds=1.0, title="The paper's four conditions, side by side")


def made() -> Iterator[tuple[str, list[str], Playback]]:
    """Yield the name of each page that plays, the documents that show it, and the page."""
    for env_id in ids():
        name = name_of(env_id)
        card = f"agents/policies/{name}-v0/card"
        documents = [f"docs/environments/{name}", card, *(["docs/horse"] if name == "Horse" else [])]
        yield name, documents, playback_of(env_id)
    yield "paper", ["docs/paper"], of_paper()


def write(app: Sphinx) -> None:
    """Write the pages that play, and the library that they share."""
    app.playbacks = {}  # type: ignore[attr-defined]
    if app.builder.format != "html":
        return
    import bokeh

    folder = Path(app.outdir) / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(Path(bokeh.__file__).parent / "server" / "static" / "js" / LIBRARY, folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of policies that were trained with another version
        for name, documents, playback in made():
            playback.write(folder / f"{name}.html", LIBRARY)
            for document in documents:
                app.playbacks[document] = (f"{name}.html", playback.title)  # type: ignore[attr-defined]


def show(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object) -> None:
    """Put the frame of a page that plays in the place of the film, or below the title and what follows it."""
    if page not in app.playbacks:  # type: ignore[attr-defined]
        return
    file, title = app.playbacks[page]  # type: ignore[attr-defined]
    address = "../" * page.count("/") + (FOLDER / file).as_posix()
    frame = f'<iframe class="playback" src="{address}" title="{title}" loading="lazy"></iframe>'
    film = re.compile(r"<p><img [^>]*film\d*\.gif[^>]*></p>|<img [^>]*film\d*\.gif[^>]*>")
    if film.search(context["body"]):
        context["body"] = film.sub(frame, context["body"], count=1)
    else:
        head = re.compile(r"</h1>\s*(?:<p>.*?</p>)?", re.DOTALL)
        context["body"] = head.sub(lambda found: found[0] + frame, context["body"], count=1)

"""The demonstration of `hoof-env demo`: the paper, the agent that ships compared with scripted gaits, films.

`agents.demo` in the repository does the same with an agent that it trains.
"""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from hoof_env._input import as_path
from hoof_env._output import check_folder, staged
from hoof_env.demo.report import OPEN_LOOP, Report, data_uri
from hoof_env.errors import MissingExtraError
from hoof_env.evaluation.scores import DEFAULT_ENV, Evaluation, Score, evaluate, text_table, write_json
from hoof_env.evaluation.versions import versions
from hoof_env.film import check_film, render_episode
from hoof_env.paper.reproduce import GAITS, SOLVERS, reproduce, write_reproduction
from hoof_env.paper.rows import Reproduction, counted

ENV_ID = DEFAULT_ENV
FIXED_ID = "hoof_env/HorseLegFixed-v0"
AGENT = "shipped agent"
SCRIPTED = ("zero", "walk", "run", "constant", OPEN_LOOP, "idle", "random", "bang-bang")
FIRST_SEED = 1000  # first of the scored episodes; no training uses it
PAGE = "report.html"
SLOW = 4  # factor of the slow motion in which the films of the fixed trunk play
SIZE = (640, 360)  # of the films [pixels]

EPISODES = 20
FILM_SECONDS = 8.0
QUICK_EPISODES = 2
QUICK_FILM_SECONDS = 0.4

Say = Callable[[str], None]

EXTRAS = {"plot": ("matplotlib", "jinja2"), "render": ("pygame",), "video": ("imageio_ffmpeg",)}
"""Modules of the extras that the demonstration needs."""


def demo(out: Path | str, quick: bool = False, say: Say = print, overwrite: bool = True) -> Path:
    """Make the report, and return its path.

    Args:
        out: folder of the report; an older one there is replaced when the new one is complete.
        quick: tiny numbers, as a test of all parts.
        say: function that prints a line.
        overwrite: if False, a report that exists at the end is not replaced; the new one is stored next to
            it.

    Raises:
        OutputError: the folder cannot be written, or there is another report.
        HoofEnvError: an extra is missing.
    """
    out = as_path("out", out)
    check_folder(out)
    check_extras()
    check_film(out / "film.mp4", 50.0)
    steps = Steps(3, say)
    command = shlex.join(["hoof-env", "demo", "--out", str(out), *(["--quick"] if quick else [])])
    with staged(out, () if overwrite else (PAGE,)) as stage:
        reproduction = reproduce_paper(stage, command, steps)
        with steps.announced(f"the agent that ships and scripted policies in {ENV_ID}"):
            count = QUICK_EPISODES if quick else EPISODES
            found = evaluate((*SCRIPTED, "shipped"), ENV_ID, None, count, FIRST_SEED)
            found = named(found, AGENT)
            steps.say_all(text_table(found.scores))
            write_json(found, stage / "scores.json")
        with steps.announced("films and report"):
            seconds = QUICK_FILM_SECONDS if quick else FILM_SECONDS
            clips = film_all(found.scores, "shipped", seconds, stage, steps)
            report = Report(
                reproduction, found.scores, clips, stage, FIRST_SEED, command, versions(), quick=quick
            )
            (stage / PAGE).write_text(report.html(), encoding="utf-8")
    return out / PAGE


def check_extras() -> None:
    """Raise `MissingExtraError` with all extras that are missing at once."""
    missing = [extra for extra, modules in EXTRAS.items() if not all(map(find_spec, modules))]
    if missing:
        names = ",".join(missing)
        raise MissingExtraError(f'the demonstration needs more: pip install "hoof-env[{names}]"')


class Steps:
    """Steps of a demonstration, printed at their start and end.

    Args:
        count: number of steps.
        say: function that prints a line.
    """

    def __init__(self, count: int, say: Say) -> None:
        self._count = count
        self._begun = 0
        self._say = say

    def say(self, line: str) -> None:
        """Print a line of a step's output."""
        self._say(f"      {line}")

    def say_all(self, text: str) -> None:
        """Print lines of a step's output."""
        for line in text.splitlines():
            self.say(line)

    @contextmanager
    def announced(self, title: str) -> Iterator[None]:
        """Print the title of a step, and its time at the end."""
        self._begun += 1
        self._say(f"[{self._begun}/{self._count}] {title}")
        started = time.monotonic()
        yield
        self.say(f"done in {time.monotonic() - started:.0f} s")


def named(found: Evaluation, name: str) -> Evaluation:
    """Return an evaluation with another name of the last policy, the agent."""
    *others, agent = found.scores
    return replace(found, scores=[*others, replace(agent, policy=name)])


def reproduce_paper(stage: Path, command: str, steps: Steps) -> Reproduction:
    """Reproduce the paper, write the results and the figures into `stage`, and print how many published
    numbers each solver reproduces."""
    with steps.announced("the paper's four conditions, walking and running, elastic and inelastic"):
        reproduction = reproduce(steps.say)
        write_reproduction(reproduction, stage, command=command)
        for solver in SOLVERS:
            steps.say(f"{solver} solver: {counted(reproduction.rows, reproduction.shapes, solver)}")
    return reproduction


def film_all(
    scores: Sequence[Score], agent: str, seconds: float, stage: Path, steps: Steps
) -> list[dict[str, str]]:
    """Film the agent and the paper's gaits on their own trunk, and the gaits, slowly, on a fixed one.

    Args:
        scores: scores of all policies, the agent's as the last one.
        agent: the agent as commands name it.
        seconds: length of each film [s].
        stage: folder of the films.
        steps: steps that print the progress.

    Returns:
        Title, caption and film of each.
    """
    clips = []
    first_episodes = {score.policy: score.episodes[0] for score in scores}
    shown = scores[-1].policy
    for name in (shown, *GAITS):
        policy = agent if name == shown else name
        path = stage / f"{name.replace(' ', '-')}.mp4"
        render_episode(path, policy, ENV_ID, seed=FIRST_SEED, seconds=seconds, size=SIZE)
        # The film shows the first scored episode: its caption has the figures of that.
        first = first_episodes[name]
        way = "forward" if first["distance_m"] >= 0 else "backward"
        caption = (
            f"{abs(first['distance_m']):.1f} m {way} in an episode of {first['seconds']:.0f} s, "
            f"return {first['return']:.1f}"
        )
        title = f"{name.capitalize()}, moving trunk"
        clips.append({"title": title, "caption": caption, "film": data_uri(path)})
        steps.say(f"filmed {name}")
    for gait in GAITS:
        path = stage / f"{gait}-fixed.mp4"
        render_episode(
            path, gait, FIXED_ID, (f"gait={gait}",), seconds=min(1.0, seconds), slow=SLOW, size=SIZE
        )
        caption = f"one cycle of 1 s as in the paper, in slow motion, {SLOW} x"
        title = f"{gait.capitalize()}, fixed trunk"
        clips.append({"title": title, "caption": caption, "film": data_uri(path)})
        steps.say(f"filmed {gait} on a fixed trunk")
    return clips

"""Recording of a page: substeps from one press of a button to the next, in the files of `hoof-env export` and
`hoof-env render`, or as a page that stands alone."""

from __future__ import annotations

import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from hoof_env import film, records
from hoof_env.errors import check_choice
from hoof_env.lab.forces import THRESHOLD
from hoof_env.record.columns import Columns, joined
from hoof_env.view.messages import error_text
from hoof_env.view.simulation import Chunk, Simulation

FORMATS = (".html", ".mp4", ".gif", ".csv", ".mot")
"""Formats by suffix."""

MAX_SECONDS = 120.0
"""Longest recording [s]."""

FPS = 25.0  # of films [1/s]


class Recording:
    """Recording of a simulation.

    Args:
        simulation: simulation.
        out: folder of the file; made if it is missing.
        suffix: one of `FORMATS`.
        tell: function of a text and its kind, "note" or "error", that is called when the file is written, in
            the thread that writes it.

    Attributes:
        path: the file.
        is_over: True after the end of the episode: what follows is not recorded.

    Raises:
        ParameterError: another format.
        HoofEnvError: a library for the format is missing, or the folder cannot be written.
    """

    def __init__(
        self, simulation: Simulation, out: Path, suffix: str, tell: Callable[[str, str], None]
    ) -> None:
        check_choice("format", suffix, FORMATS)
        name = simulation.env_id.rpartition("/")[2].lower()
        self.path = out / f"{name}-{datetime.now():%Y%m%d-%H%M%S-%f}{suffix}"
        if suffix in film.FFMPEG:
            records.check_place(self.path, film.FFMPEG)
            film.check_film(self.path, FPS)
        elif suffix != ".html":
            records.check_export(self.path)
        else:
            records.check_place(self.path, FORMATS)
        self._simulation = simulation
        # Of the recorded episode: the next one may have begun when the file is written.
        self._played: dict[str, Any] = {"policy": simulation.policy_name, "seed": simulation.seed}
        self._parameters = simulation.parameters
        self._tell = tell
        self._chunks: list[Chunk] = []
        self._seconds = 0.0
        self.is_over = False

    def add(self, chunk: Chunk) -> None:
        """Take the substeps of a control step."""
        if not self.is_over and not self.is_full:
            self._chunks.append(chunk)
            self._parameters = self._simulation.parameters
            self._seconds += self._simulation.dt

    @property
    def is_full(self) -> bool:
        """True if the recording takes no more substeps."""
        return self._seconds > MAX_SECONDS

    def write(self) -> threading.Thread:
        """Write the file in a thread of its own, and report the end; return the thread."""
        thread = threading.Thread(target=self._write_and_tell)
        thread.start()
        return thread

    def _write_and_tell(self) -> None:
        """Write the file and report the end; report errors, too, which nothing else would in this thread."""
        if not self._chunks:
            self._tell("Nothing was recorded: the page was paused.", "error")
            return
        try:
            self._write()
        except Exception as error:
            self._tell(f"{self.path}: {error_text(error)}", "error")
            return
        seconds = self._chunks[-1].columns["time"][-1] - self._chunks[0].columns["time"][0]
        self._tell(f"Wrote {self.path}: {seconds:.2f} s.", "note")

    def _write(self) -> None:
        simulation = self._simulation
        suffix = self.path.suffix
        if suffix == ".html":
            from hoof_env.view.playback import Playback, Played

            played = Played(**self._played, parameters=self._parameters)
            Playback.of_chunks(simulation, self._chunks, played).write(self.path)
        elif suffix in film.FFMPEG:
            from hoof_env.render.renderer import Renderer

            renderer = Renderer(simulation.setting)
            moved = [_from_zero(chunk.columns, self._chunks[0].columns["time"][0]) for chunk in self._chunks]
            film.write_film(film.frames(renderer, moved, FPS), self.path, FPS)
        else:
            about = records.describe(
                simulation.env,
                environment=simulation.env_id,
                arguments=simulation.arguments,
                **self._played,
                threshold_n=THRESHOLD,
                bodies={},
                reactions=[],
                parameters=self._parameters,
            )
            record = joined([c.columns for c in self._chunks], records.units_of(simulation.env))
            records.write(record, about, self.path)


def _from_zero(columns: Columns, begin: Any) -> Columns:
    """Return columns whose times count from the first one of a film."""
    return columns | {"time": columns["time"] - begin}

"""Player of a page: its clock, which runs at any speed, and what is new since the last state."""

from __future__ import annotations

import math
import time
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hoof_env.record.columns import Columns
from hoof_env.record.instant import instants
from hoof_env.render.picture import picture_of
from hoof_env.view.history import STANCE, History, StanceNumbers, curves_of, path_columns, thinned
from hoof_env.view.simulation import Chunk, Simulation

FIRST_NUMBERS = {"time": 2, "speed": 2, "target": 2, "return": 2}
"""Digits of the numbers of a page that belong to the whole body."""
LEG_NUMBERS = {"grf": 0, **dict(zip(STANCE, (0, 0, 1, 2, 1), strict=True))}
"""Digits of the numbers of each leg."""
MAX_WORK_SECONDS = 0.1
"""Longest work before the page gets a state [s]."""
TERM_DIGITS = 2
"""Digits of the terms of the reward."""


class Recorder(Protocol):
    """Interface of recordings that take the chunks of a player, see `recording.Recording`.

    Attributes:
        is_over: True after the end of the recorded episode.
        is_full: True if the recording takes no more chunks.
    """

    is_over: bool

    @property
    def is_full(self) -> bool: ...

    def add(self, chunk: Chunk) -> None:
        """Take the substeps of a control step."""

    def write(self) -> Any:
        """Write the file in a thread of its own; return the thread."""


class Player:
    """Simulation with the clock of a page.

    The page's time goes on from one episode to the next: an episode that follows another begins where the
    last one ended. It is 0 at the start of an episode that was asked for.

    Args:
        simulation: simulation; `reset` or `take` begins to show it.

    Attributes:
        history: what was shown.
        numbers: names and digits of the numbers in a row: of the body, of each leg with its index
            behind them, and the terms of the reward, summed over the episode.
        drawing: drawing data.
        clock, shown: time up to which the page may show and shows substeps [s].
        recording: recording that runs, or None.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.history = History()
        self.legs = simulation.legs
        of_legs = [(f"{name} {k}", n) for k in range(len(self.legs)) for name, n in LEG_NUMBERS.items()]
        terms = [(name, TERM_DIGITS) for name in simulation.terms]
        self.numbers = [*FIRST_NUMBERS.items(), *of_legs, *terms]
        self.drawing = picture_of(simulation.setting).drawing(simulation.setting, len(self.numbers))
        self.recording: Recorder | None = None
        self.clock = 0.0
        self.shown = 0.0

    def take(self, chunk: Chunk, is_first: bool = False) -> None:
        """Show all substeps of a chunk that was simulated before; the first one begins anew."""
        if is_first:
            self.reset(chunk)
        else:
            self._take(chunk)
        self._reveal(math.inf)

    def reset(self, chunk: Chunk) -> None:
        """Show the start of an episode that was asked for: the page begins anew."""
        self.history.clear()
        self.clock = 0.0
        self.shown = 0.0
        self._fresh: list[Columns] = []
        self._steps: list[dict[str, float]] = []
        self._begin(chunk)

    def _begin(self, chunk: Chunk) -> None:
        """Show the start of an episode."""
        self._base = self.shown
        lift_off = self.simulation.setting.lift_off_n
        self._stances = [StanceNumbers(lift_off) for _ in self.legs]
        self._totals = dict.fromkeys(self.simulation.terms, 0.0)
        self._waiting: list[tuple[Columns, Columns]] = []
        if self.recording is not None:
            self.recording.is_over = True
        self._take(chunk)
        self._reveal(self.shown)

    def go(self, seconds: float) -> str:
        """Let the clock go on, and simulate and show what happens.

        Args:
            seconds: time of the page [s].

        Returns:
            How an episode ended meanwhile, "" if none did; the next one has begun then. Where a step takes
            long, as with a slow policy, the clock advances by less than `seconds`, to the end of the step.

        Raises:
            HoofEnvError: the policy or the environment cannot go on; the clock has not moved.
        """
        until = self.clock + seconds
        late = time.monotonic() + MAX_WORK_SECONDS
        simulation = self.simulation
        while self._simulated < until - 1e-9 and not simulation.ended:
            chunk = simulation.step()
            if chunk is not None:
                self._take(chunk)
            if time.monotonic() > late:
                until = min(until, self._simulated)
        self._reveal(until)
        ended = "" if self._waiting else simulation.ended
        if ended:
            self._begin(simulation.reset(simulation.seed + 1))
        self.clock = until
        return ended

    def step(self) -> str:
        """Go on by one control step; see `go`."""
        self.clock = self.shown
        return self.go(self.simulation.dt)

    @property
    def _simulated(self) -> float:
        """Time of the page up to which there are substeps [s]."""
        return float(self._waiting[-1][1]["time"][-1]) if self._waiting else self.shown

    def _take(self, chunk: Chunk) -> None:
        """Queue a chunk until the clock reaches it."""
        lift_off = self.simulation.setting.lift_off_n
        curves = curves_of(chunk, self.legs, lift_off, self._base, self.drawing.has_heel)
        if not chunk.terms and self._base:
            # The start of a further episode is not joined to the end of the last one.
            gap = np.full(len(curves["time"]), np.nan)
            curves |= dict.fromkeys(path_columns(self.legs, self.drawing.has_heel), gap)
        self._waiting.append((chunk.columns, curves))
        recording = self.recording  # another thread ends it when the page is closed
        if recording is not None:
            recording.add(chunk)
        if chunk.terms:
            for name, value in chunk.terms.items():
                self._totals[name] += value
            self._steps.append({"time": float(curves["time"][-1])} | chunk.terms)

    def _reveal(self, until: float) -> None:
        """Show the substeps up to a time of the page [s]."""
        while self._waiting:
            both = self._waiting.pop(0)
            count = int(np.searchsorted(both[1]["time"], until + 1e-9, side="right"))
            if count:
                self._show(*(first(part, count) for part in both))
            if count < len(both[1]["time"]):
                self._waiting.insert(0, (rest(both[0], count), rest(both[1], count)))
                return

    def _show(self, columns: Columns, curves: Columns) -> None:
        """Count substeps among those that are shown."""
        time = columns["time"].tolist()
        for leg, stance in zip(self.legs, self._stances, strict=True):
            series = (columns[f"{leg}crank_angle"], curves[f"{leg}normal"], curves[f"{leg}grf"])
            stance.add(time, *(values.tolist() for values in series))
        self._fresh.append(curves)
        self.shown = float(curves["time"][-1])
        self._now = rest(columns, len(time) - 1)

    # News

    def curves(self) -> Columns:
        """Return the rows of the curves that are drawn and are new since the last call, and keep them."""
        if not self._fresh:
            return {}
        whole = {name: np.concatenate([part[name] for part in self._fresh]) for name in self._fresh[0]}
        self._fresh = []
        rows = thinned(whole, self.legs)
        drawn = {name: values[rows] for name, values in whole.items()}
        self.history.add_curves(drawn)
        return drawn

    def steps(self) -> Columns:
        """Return times and terms of the control steps that are new since the last call, and keep them."""
        steps = self._steps
        self._steps = []
        names = ("time", *self.simulation.terms)
        news = {name: np.array([step[name] for step in steps]) for name in names}
        self.history.add_steps(news)
        return news

    def row(self) -> NDArray[np.float64]:
        """Return the row of the present instant, and keep it."""
        simulation = self.simulation
        (now,) = instants(self._now, self.legs)
        target = simulation.commanded_speed
        numbers = [now.time, now.vx, np.nan if target is None else target, sum(self._totals.values())]
        for leg, stance in zip(now.legs, self._stances, strict=True):
            numbers += [leg.grf, *stance.numbers.values()]
        numbers += self._totals.values()
        row = self.drawing.row(now, numbers)
        row[0] = self.shown
        self.history.add_row(row)
        return row


def first(columns: Columns, count: int) -> Columns:
    """Return the first rows of columns."""
    return {name: values[:count] for name, values in columns.items()}


def rest(columns: Columns, count: int) -> Columns:
    """Return columns without their first rows."""
    return {name: values[count:] for name, values in columns.items()}

"""One tab of the page: its simulation, what it draws, and what it does when it is asked."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hoof_env.errors import ParameterError, check_choice, check_number, parse_pairs
from hoof_env.view import controls, figures, layout
from hoof_env.view.layout import SPEEDS
from hoof_env.view.player import Player
from hoof_env.view.recording import Recording
from hoof_env.view.simulation import Simulation
from hoof_env.view.words import words_of

TICK = 1 / 30  # time between two states that are sent [s]
CURVES_EVERY = 2  # states between two pieces of the curves
LONGEST_TICK = 0.1  # time of which a late tick makes up [s]
MOST_SUBSTEPS = 10_000  # of a control step: during one, no tab is served

Setup = dict[str, Any]
"""Arguments of `Simulation`, by name."""


class Tab:
    """The page of one tab.

    Args:
        doc: Bokeh's document of the tab.
        setup: arguments of the simulation.
        keep: function that keeps another set-up and returns the address of its page.
        out: folder of recordings.

    Attributes:
        player: simulation and clock.
        wire: messages between page and server.
        playing, speed: True while the clock goes on, and its speed over real time.
        is_open: False when the page was closed.

    Raises:
        HoofEnvError: the set-up is refused.
    """

    def __init__(self, doc: Any, setup: Setup, keep: Callable[[Setup], str], out: Path) -> None:
        self._doc = doc
        self._keep = keep
        self._out = out
        with heard() as self._warned:
            simulation = Simulation(**setup)
        self.player = Player(simulation)
        self.player.reset(simulation.reset())
        self.playing = True
        self.speed = 1.0
        self.is_open = True
        self._ticks = 0
        self._last = time.monotonic()
        self.wire = layout.fill(doc, self.player)
        self.wire.on_change("asked", self._on_asked)
        doc.on_session_destroyed(lambda _: self.close())
        doc.add_periodic_callback(self._tick, round(1000 * TICK))

    # Callbacks of Bokeh, which nothing may leave that is raised in them

    def _tick(self) -> None:
        """Send the next state; pause where there is none."""
        now = time.monotonic()
        passed = min(now - self._last, LONGEST_TICK)
        self._last = now
        if not self.playing:
            return
        try:
            self._say_end(self.player.go(self.speed * passed))
            self._send()
        except Exception as error:
            self.playing = False
            self._refuse(error)

    def _on_asked(self, attr: str, old: Any, new: Any) -> None:
        """Do what the page asks; a refusal is told and changes nothing."""
        try:
            request = dict(new)
            request.pop("count", None)  # two requests in a row are never equal
            handler = HANDLERS[check_choice("request", request.pop("name", None), HANDLERS)]
            handler(self, **request)
        except Exception as error:
            self._refuse(error)

    def _said(self, text: str, kind: str) -> None:
        """Tell the end of a recording from its own thread, in the terminal where the page is closed."""
        if self.is_open:
            self._doc.add_next_tick_callback(lambda: self._tell(status=text, kind=kind))
        else:
            print(f"hoof-env view: {text}", flush=True)

    def close(self) -> None:
        """Write an unfinished recording, and let the simulation go."""
        self.is_open = False
        self.playing = False
        self._stop_recording()
        self.player.simulation.env.close()
        self.player.history.clear()

    # News

    def _say_end(self, ended: str) -> None:
        """Say that an episode ended."""
        if ended:
            seed = self.player.simulation.seed
            text = f"The episode ended: {ended}. The next one has seed {seed}."
            self._tell(status=text, kind="end")
            self._stop_recording()

    def _send(self) -> None:
        """Send the row of the present instant, and curves with every other state."""
        self._ticks += 1
        player = self.player
        row = player.row()
        if self._ticks % CURVES_EVERY:
            self.wire.news = layout.packed(row, {}, {})
        else:
            self.wire.news = layout.packed(row, player.curves(), player.steps())
        if player.recording is not None and player.recording.is_full:
            self._stop_recording()

    def _send_anew(self, row: Any = None) -> None:
        """Send all that is shown at the time of a row, by default at present, after a jump in time."""
        player = self.player
        player.curves()
        player.steps()
        # Steps that are simulated already count at present, although their substeps are not shown yet.
        end = math.inf if row is None else float(row[0]) + 1e-6
        row = player.row() if row is None else row
        window = (float(row[0]) - figures.SECONDS, end)
        self.wire.news = layout.packed(row, *player.history.between(*window), is_anew=True)

    def _refuse(self, error: Exception) -> None:
        """Say why something is refused, or what went wrong."""
        self._tell(status=words_of(error), kind="error", playing=self.playing)

    def _tell(self, **message: Any) -> None:
        """Send a message to the page."""
        self.wire.told = {"kind": "note"} | message | {"at": time.monotonic()}

    # Requests

    def show(self) -> None:
        """Send all that is shown, and warnings, as a page asks that has just opened."""
        self._send_anew()
        # Not earlier: a page does not hear what is told before it is there.
        if self._warned and self.playing:
            self._tell(status=" ".join(self._warned), kind="warning")
        self._warned = []

    def play(self, value: bool | None = None) -> None:
        """Play or pause; None for the other of both."""
        self.playing = not self.playing if value is None else bool(value)
        self._last = time.monotonic()
        self._send_anew()
        self._tell(playing=self.playing, span=self.player.history.span)

    def step(self) -> None:
        """Take one control step, and pause."""
        self.playing = False
        self._say_end(self.player.step())
        self._send_anew()
        self._tell(playing=False, span=self.player.history.span)

    def reset(self, seed: Any = None, policy: str | None = None) -> None:
        """Start an episode anew."""
        with heard() as said:
            chunk = self.player.simulation.reset(seed, policy or None)
        self._stop_recording()
        self.player.reset(chunk)
        self._send_anew()
        text = " ".join(said) or f"Seed {self.player.simulation.seed}."
        is_driven = self.player.simulation.hand is not None
        self._tell(status=text, hand=is_driven, playing=self.playing)

    def set_speed(self, value: Any) -> None:
        """Play slower or faster."""
        self.speed = check_number("speed", value, low=SPEEDS[0], high=SPEEDS[1])

    def back(self, value: Any) -> None:
        """Pause and show an earlier time [s]."""
        first, last = self.player.history.span
        row = self.player.history.row_at(min(max(check_number("time", value), first), last))
        self.playing = False
        if row is not None:
            self._send_anew(row)
        self._tell(playing=False, span=(first, last))

    def touch(self, setting: str, value: Any) -> None:
        """Give a setting another value, at once where it can change within an episode."""
        if setting == "target_speed":
            self.player.simulation.command_speed(value)
        elif not self.player.simulation.touch(setting, value):
            here = self.player.simulation
            self._go({"arguments": here.arguments | here.parameters | {setting: value}})

    def drive(self, setting: str, value: Any) -> None:
        """Drive the leg by hand."""
        self.player.simulation.drive(setting, value)
        self._tell(hand=True, status="You drive. The policy drives again when you choose it.")

    def release(self) -> None:
        """Give the leg back to the policy."""
        self.player.simulation.hand = None
        self._tell(hand=False, status="The policy drives.")

    def push(self, value: Any) -> None:
        """Push the trunk [N s]."""
        self.player.simulation.push(value)
        self._tell(status=f"Pushed by {value:g} N s.")

    def condition(self, value: str) -> None:
        """Go to one of the paper's four conditions."""
        arguments = {"episode_seconds": controls.TURNS_ON} | controls.CONDITIONS[value]
        gait = controls.CONDITIONS[value]["gait"]
        self._go({"env_id": controls.PAPER_ID, "arguments": arguments, "policy": gait, "seed": 0})

    def setup(self, env_id: str, arguments: str, preset: str, policy: str, seed: Any) -> None:
        """Go to another environment, preset, policy or seed."""
        pairs = parse_pairs("arguments", arguments.split())
        if preset:
            pairs["preset"] = preset
        seed = seed or 0
        here = self.player.simulation
        if env_id == here.env_id and pairs == here.arguments:
            self.reset(seed, policy)
            return
        self._go({"env_id": env_id, "arguments": pairs, "policy": policy or None, "seed": seed})

    def _go(self, changes: Setup) -> None:
        """Lead the tab to the page of another set-up, after the set-up was tried."""
        here = self.player.simulation
        setup = {
            "env_id": here.env_id,
            "arguments": here.arguments,
            "policy": here.policy,
            "seed": here.seed,
        } | changes
        try_out(setup)
        self._tell(go=self._keep(setup))

    def record(self, suffix: str = ".csv") -> None:
        """Begin a recording, or end it and write its file."""
        if self.player.recording is None:
            self.player.recording = Recording(self.player.simulation, self._out, suffix, self._said)
            self._tell(recording=True, status="Recording. Press again to stop.")
        else:
            self._stop_recording()

    def _stop_recording(self) -> None:
        """End the recording and write its file."""
        recording = self.player.recording
        self.player.recording = None
        if recording is not None:
            self._tell(recording=False, status="Writing ...")
            recording.write()


HANDLERS: dict[str, Callable[..., None]] = {
    "show": Tab.show,
    "play": Tab.play,
    "step": Tab.step,
    "reset": Tab.reset,
    "speed": Tab.set_speed,
    "back": Tab.back,
    "touch": Tab.touch,
    "drive": Tab.drive,
    "release": Tab.release,
    "push": Tab.push,
    "condition": Tab.condition,
    "setup": Tab.setup,
    "record": Tab.record,
}
"""Requests of a page by name."""


@contextmanager
def heard() -> Iterator[list[str]]:
    """Collect what is warned of; yield the list, which is filled at the end."""
    said: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield said
    said += [str(one.message) for one in caught]


def try_out(setup: Setup) -> None:
    """Start an episode of a set-up.

    Raises:
        HoofEnvError: the set-up is refused, or its control steps are too long to be shown.
    """
    with heard():
        simulation = Simulation(**setup)
    env: Any = simulation.env.unwrapped
    substeps = env.engine.substeps * env.dt / env.sim_dt
    if substeps > MOST_SUBSTEPS:
        raise ParameterError(
            f"sim_dt, dt: expected at most {MOST_SUBSTEPS} substeps in a control step, got {substeps:.6g}"
        )
    simulation.reset()
    simulation.env.close()

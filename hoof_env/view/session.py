"""Session of a tab: its simulation, its messages to the page, and the requests of the page."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hoof_env.errors import ParameterError, check_choice, check_number, parse_pairs
from hoof_env.view import controls, figures, layout
from hoof_env.view.layout import SPEEDS
from hoof_env.view.messages import collect_warnings, error_text
from hoof_env.view.player import Player
from hoof_env.view.recording import Recording
from hoof_env.view.simulation import Simulation

CURVES_EVERY = 2  # states between two pieces of the curves
MAX_SUBSTEPS = 10_000  # of a control step: during one, Python does nothing else

Setup = dict[str, Any]
"""Arguments of `Simulation`, by name."""


class Session:
    """Simulation of a tab, and its messages to the page.

    Its methods run in the thread of the tab, one after the other. Their messages wait in `outbox`, because
    only the server's thread may change the document.

    Args:
        setup: arguments of the simulation.
        keep: function that keeps another set-up and returns the address of its page.
        out: folder of recordings.

    Attributes:
        player: simulation and clock.
        playing, speed: True while the clock goes on, and its speed over real time.
        outbox: news and messages that were not sent yet, with the name of their part of the wire.
        is_open: False when the page was closed.

    Raises:
        HoofEnvError: the set-up is refused.
    """

    def __init__(self, setup: Setup, keep: Callable[[Setup], str], out: Path) -> None:
        self._keep = keep
        self._out = out
        with collect_warnings() as self._warned:
            simulation = Simulation(**setup)
        self.player = Player(simulation)
        self.player.reset(simulation.reset())
        self.playing = True
        self.speed = 1.0
        self.outbox: deque[tuple[str, Any]] = deque()
        self.is_open = True
        self._states = 0

    # Jobs (they never raise)

    def go(self, passed: float) -> None:
        """Let real time pass [s], and send the state; pause if the simulation cannot go on."""
        if not self.playing:
            return
        try:
            self._report_end(self.player.go(self.speed * passed))
            self._send()
        except Exception as error:
            self.playing = False
            self.refuse(error)

    def answer(self, requests: Sequence[Mapping[str, Any]]) -> None:
        """Handle requests of the page; a request that is refused changes nothing and sends a message."""
        for request in requests:
            more = dict(request)
            try:
                handler = HANDLERS[check_choice("request", more.pop("name", None), HANDLERS)]
                handler(self, **more)
            except Exception as error:
                self.refuse(error)

    def answer_in_new_tab(self, request: Mapping[str, Any]) -> None:
        """Handle one of the requests `RUN_IN_NEW_TAB` on a new page while this page's simulation is busy."""
        more = {} if request["name"] == "condition" else {"in_new_tab": True}
        self.answer([{**request, **more}])

    def close(self) -> None:
        """Write an unfinished recording, and let the simulation go."""
        self.playing = False
        self._stop_recording()
        self.player.simulation.env.close()
        self.player.history.clear()

    # News

    def tell(self, **message: Any) -> None:
        """Send a message to the page."""
        self.outbox.append(("told", {"kind": "note"} | message))

    def refuse(self, error: Exception) -> None:
        """Send the text of an error."""
        self.tell(status=error_text(error), kind="error", playing=self.playing)

    def report(self, text: str, kind: str) -> None:
        """Report the end of a recording: to the page, or in the terminal if the page is closed."""
        if self.is_open:
            self.tell(status=text, kind=kind)
        else:
            print(f"hoof-env view: {text}", flush=True)

    def _report_end(self, ended: str) -> None:
        """Report the end of an episode and its reason, if it ended."""
        if ended:
            seed = self.player.simulation.seed
            text = f"The episode ended: {ended}. The next one has seed {seed}."
            self.tell(status=text, kind="end")
            self._stop_recording()

    def _send(self) -> None:
        """Send the row of the present instant, and curves with every other state."""
        self._states += 1
        player = self.player
        row = player.row()
        if self._states % CURVES_EVERY:
            news = layout.packed(row, {}, {})
        else:
            news = layout.packed(row, player.curves(), player.steps())
        self.outbox.append(("news", news))
        if player.recording is not None and player.recording.is_full:
            self._stop_recording()

    def _send_anew(self, row: Any = None) -> None:
        """Send all curves up to the time of a row, by default up to now, after a jump in time."""
        player = self.player
        player.curves()
        player.steps()
        # Steps that are simulated already count at present, although their substeps are not shown yet.
        end = math.inf if row is None else float(row[0]) + 1e-6
        row = player.row() if row is None else row
        window = (float(row[0]) - figures.SECONDS, end)
        self.outbox.append(("news", layout.packed(row, *player.history.between(*window), is_anew=True)))

    # Requests

    def show(self) -> None:
        """Send all curves, and warnings, to a page that has just opened."""
        self._send_anew()
        # Only now: messages that are sent before the page is open are lost.
        if self._warned and self.playing:
            self.tell(status=" ".join(self._warned), kind="warning")
        self._warned = []

    def play(self, value: bool | None = None) -> None:
        """Play or pause; None toggles."""
        self.set_playing(value)
        self._send_anew()
        self.tell(span=self.player.history.span)

    def set_playing(self, value: bool | None) -> None:
        """Start or stop the clock; None toggles."""
        self.playing = not self.playing if value is None else bool(value)
        self.tell(playing=self.playing)

    def step(self) -> None:
        """Take one control step, and pause."""
        self.playing = False
        self._report_end(self.player.step())
        self._send_anew()
        self.tell(playing=False, span=self.player.history.span)

    def reset(self, seed: Any = None, policy: str | None = None, in_new_tab: bool = False) -> None:
        """Start an episode anew, on this page or in a new tab."""
        if in_new_tab:
            here = self.player.simulation
            chosen = {"seed": here.seed if seed is None else seed, "policy": policy or here.policy}
            self._go({"arguments": here.arguments | here.parameters} | chosen)
            return
        with collect_warnings() as warned:
            chunk = self.player.simulation.reset(seed, policy or None)
        self._stop_recording()
        self.player.reset(chunk)
        self._send_anew()
        text = " ".join(warned) or f"Seed {self.player.simulation.seed}."
        is_driven = self.player.simulation.hand is not None
        self.tell(status=text, hand=is_driven, playing=self.playing)

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
        self.tell(playing=False, span=(first, last))

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
        self.tell(hand=True, status="You drive. The policy drives again when you choose it.")

    def release(self) -> None:
        """Give the leg back to the policy."""
        self.player.simulation.hand = None
        self.tell(hand=False, status="The policy drives.")

    def push(self, value: Any) -> None:
        """Push the trunk [N s]."""
        self.player.simulation.push(value)
        self.tell(status=f"Pushed by {value:g} N s.")

    def condition(self, value: str) -> None:
        """Go to one of the paper's four conditions."""
        arguments = {"episode_seconds": controls.TURNS_ON} | controls.CONDITIONS[value]
        gait = controls.CONDITIONS[value]["gait"]
        self._go({"env_id": controls.PAPER_ID, "arguments": arguments, "policy": gait, "seed": 0})

    def setup(
        self, env_id: str, arguments: str, preset: str, policy: str, seed: Any, in_new_tab: bool = False
    ) -> None:
        """Go to another environment, preset, policy or seed."""
        pairs = parse_pairs("arguments", arguments.split())
        if preset:
            pairs["preset"] = preset
        seed = seed or 0
        here = self.player.simulation
        if env_id == here.env_id and pairs == here.arguments:
            self.reset(seed, policy, in_new_tab)
            return
        self._go({"env_id": env_id, "arguments": pairs, "policy": policy or None, "seed": seed})

    def _go(self, changes: Setup) -> None:
        """Send the tab to the page of another set-up, once that has been tried."""
        here = self.player.simulation
        setup = {
            "env_id": here.env_id,
            "arguments": here.arguments,
            "policy": here.policy,
            "seed": here.seed,
        } | changes
        try_out(setup)
        self.tell(go=self._keep(setup))

    def record(self, suffix: str = ".csv") -> None:
        """Begin a recording, or end it and write its file."""
        if self.player.recording is None:
            self.player.recording = Recording(self.player.simulation, self._out, suffix, self.report)
            self.tell(recording=True, status="Recording. Press again to stop.")
        else:
            self._stop_recording()

    def _stop_recording(self) -> None:
        """End the recording and write its file."""
        recording = self.player.recording
        self.player.recording = None
        if recording is not None:
            self.tell(recording=False, status="Writing ...")
            recording.write()


HANDLERS: dict[str, Callable[..., None]] = {
    "show": Session.show,
    "play": Session.play,
    "step": Session.step,
    "reset": Session.reset,
    "speed": Session.set_speed,
    "back": Session.back,
    "touch": Session.touch,
    "drive": Session.drive,
    "release": Session.release,
    "push": Session.push,
    "condition": Session.condition,
    "setup": Session.setup,
    "record": Session.record,
}
"""Requests of a page by name."""

RUN_IN_NEW_TAB = ("reset", "setup", "condition")
"""Requests that a new page can handle while this one is busy."""


def try_out(setup: Setup) -> None:
    """Start an episode of a set-up.

    Raises:
        HoofEnvError: the set-up is refused, or its control steps are too long to be shown.
    """
    with collect_warnings():
        simulation = Simulation(**setup)
    env: Any = simulation.env.unwrapped
    substeps = env.engine.substeps * env.dt / env.sim_dt
    if substeps > MAX_SUBSTEPS:
        raise ParameterError(
            f"sim_dt, dt: expected at most {MAX_SUBSTEPS} substeps in a control step, got {substeps:.6g}"
        )
    simulation.reset()
    simulation.env.close()

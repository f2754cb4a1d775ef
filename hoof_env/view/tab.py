"""One tab of the page: its document, and the thread that works for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from hoof_env.view import layout
from hoof_env.view.session import RUN_IN_NEW_TAB, Session, Setup
from hoof_env.view.worker import Worker

TICK = 1 / 30  # time between two states [s]
LOOK = 8  # time after which a tick that came too early looks again [ms]
MAX_TICK_SECONDS = 0.1  # longest time that one tick simulates [s]
PATIENCE = 2.0  # time after which a page says what it waits for [s]

LATE_POLICY = f"The policy has not answered for {PATIENCE:g} s. Pause, or choose another one; the page waits."
LATE = "This takes a while, as when kernels are compiled or a policy is loaded."


class Tab:
    """The page of one tab.

    Its methods run in the server's thread, which serves all tabs and never waits: the tab's own thread does
    slow work, and the next tick sends the results.

    Args:
        doc: Bokeh's document of the tab.
        setup: arguments of the simulation.
        keep: function that keeps another set-up and returns the address of its page.
        out: folder of recordings.

    Attributes:
        session: simulation and its messages to the page.
        wire: messages between page and server.

    Raises:
        HoofEnvError: the set-up is refused.
    """

    def __init__(self, doc: Any, setup: Setup, keep: Callable[[Setup], str], out: Path) -> None:
        self._doc = doc
        self.session = Session(setup, keep, out)
        self.wire = layout.fill(doc, self.session.player)
        self._worker = Worker()
        self._asked: list[dict[str, Any]] = []
        self._late_since: float | None = None
        self._last = time.monotonic()
        self._looks = False
        self.wire.on_change("asked", self._on_asked)
        doc.on_session_destroyed(lambda _: self.close())
        doc.add_periodic_callback(self._tick, round(1000 * TICK))

    @property
    def is_open(self) -> bool:
        """False when the page was closed."""
        return self.session.is_open

    def _tick(self) -> None:
        """Send messages, and let time pass."""
        is_busy = self._worker.is_busy
        if not is_busy and self._late_since is not None:
            took = f"It took {time.monotonic() - self._late_since:.1f} s."
            self.session.outbox.appendleft(("told", {"kind": "note", "status": took}))
            self._late_since = None
        self._send()
        if is_busy:
            self._wait()
            if not self._looks and self._late_since is None:
                self._looks = True
                self._doc.add_timeout_callback(self._look, LOOK)
            return
        now = time.monotonic()
        passed = min(now - self._last, MAX_TICK_SECONDS)
        self._last = now
        self._answer()
        if self.session.playing:
            self._worker.do(partial(self.session.go, passed))

    def _look(self) -> None:
        """Look again after a tick that came too early."""
        self._looks = False
        self._tick()

    def _send(self) -> None:
        """Send the messages of the session."""
        while self.session.outbox:
            part, value = self.session.outbox.popleft()
            if part == "told":
                value = value | {"at": time.monotonic()}  # two messages are never equal
            setattr(self.wire, part, value)

    def _on_asked(self, attr: str, old: Any, new: Any) -> None:
        """Take a request of the page."""
        self._asked.append({name: value for name, value in new.items() if name != "count"})
        if not self._worker.is_busy:
            self._answer()

    def _answer(self) -> None:
        """Let the tab's thread handle the requests."""
        if self._asked:
            self._worker.do(partial(self.session.answer, self._asked))
            self._asked = []

    def _wait(self) -> None:
        """Tell the cause of a long wait, and handle requests that need not wait."""
        session = self.session
        if self._worker.busy_for < PATIENCE:
            return
        if self._late_since is None:
            self._late_since = time.monotonic() - self._worker.busy_for
            session.tell(status=LATE_POLICY if session.player.simulation.is_asking else LATE, kind="warning")
        asked = self._asked
        self._asked = []
        for request in asked:
            name = request.get("name")
            if name == "play":
                session.set_playing(request.get("value"))
            elif name in RUN_IN_NEW_TAB:
                # This thread, too, may be left behind.
                threading.Thread(target=session.answer_in_new_tab, args=(request,), daemon=True).start()
            else:
                self._asked.append(request)

    def close(self) -> None:
        """Close the simulation when the tab's thread is free, or after `PATIENCE` if it is not."""
        self.session.is_open = False
        is_busy = self._worker.is_busy
        self._worker.do(self.session.close)
        self._worker.end()
        if is_busy:
            threading.Timer(PATIENCE, self._leave).start()

    def _leave(self) -> None:
        """Interrupt a policy that does not return, and close the session."""
        if self.session.player.simulation.is_asking:
            self._worker.interrupt(PATIENCE)
            self.session.close()

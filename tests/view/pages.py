"""A tab of the live page without a browser, for the tests of this folder."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
from bokeh.document import Document

from hoof_env.view.tab import Tab

LEG, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"
SETUP = {"env_id": LEG, "arguments": {}, "policy": None, "seed": 0}


class Page:
    """A tab, and what it told."""

    def __init__(self, out, **changes):
        self.kept = []
        keep = lambda setup: self.kept.append(setup) or "?setup=kept"  # noqa: E731
        self.tab = Tab(Document(), SETUP | changes, keep, out)

    def ask(self, name, **more):
        """Send a request; return what the tab told meanwhile."""
        heard = {}
        self.tab.wire.on_change("told", lambda attr, old, new: heard.update(new))
        self.tab._on_asked("asked", None, {"name": name, "count": 1} | more)
        self.wait()
        return heard

    def wait(self):
        """Wait until the thread of the tab is idle; take what it sends."""
        self.tab._worker._jobs.join()
        self.tab._send()

    def tick(self, seconds):
        """Let real time pass."""
        for _ in range(round(seconds / 0.04)):
            self.tab._last = time.monotonic() - 0.04
            self.tab._tick()
            self.wait()

    @property
    def session(self):
        return self.tab.session

    @property
    def player(self):
        return self.tab.session.player

    @property
    def news(self):
        """Return the last message: row, curves and terms by name, and True if they begin anew."""
        player = self.player
        anew, *counts = self.tab.wire.news[:3]
        names = [[*player.history.between(-1, 1e9)[0]], ["time", *player.simulation.terms]]
        lengths = [player.drawing.length]
        for group, count in zip(names, counts, strict=True):
            lengths += [int(count)] * len(group)
        row, *columns, rest = np.split(self.tab.wire.news, 3 + np.cumsum([0, *lengths]))[1:]
        assert len(rest) == 0
        curves = dict(zip(names[0], columns, strict=False))
        steps = dict(zip(names[1], columns[len(curves) :], strict=True))
        return SimpleNamespace(row=row, curves=curves, steps=steps, anew=anew == 1)

    @property
    def row(self):
        return self.news.row


def opened(pages, **arguments):
    """Open a page as Bokeh does; return its document."""
    doc = Document()
    request = SimpleNamespace(arguments=arguments)
    doc._session_context = lambda: SimpleNamespace(request=request)
    pages.open(doc)
    return doc

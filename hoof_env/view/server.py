"""Server of the live page, on this machine: `hoof-env view`."""

from __future__ import annotations

import errno
import logging
import os
import secrets
import socket
import sys
import webbrowser
from collections import OrderedDict
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hoof_env._output import check_folder
from hoof_env.errors import MissingExtraError, ParameterError, count, parse_pairs
from hoof_env.view.words import words_of

MOST_TABS = 8
"""Largest number of tabs, each with a simulation of its own."""

LINGER = 1000
"""Time after which a tab without a browser is let go [ms]."""

KEPT_SETUPS = 64
"""Number of set-ups to which tabs may go back."""

HERE = ("127.0.0.1", "localhost")
"""Addresses that only this machine reaches."""


def check_bokeh() -> None:
    """Raise `MissingExtraError` if Bokeh is not installed."""
    if find_spec("bokeh") is None:
        raise MissingExtraError('the page needs Bokeh: pip install "hoof-env[view]"')


class Pages:
    """Pages of a server: one simulation for each tab.

    Args:
        setup: arguments of `Simulation` of the first page.
        out: folder of recordings.
    """

    def __init__(self, setup: dict[str, Any], out: Path) -> None:
        self._first = setup
        self._out = out
        self._kept: OrderedDict[str, dict[str, Any]] = OrderedDict()
        self._tabs: list[Any] = []

    def keep(self, setup: dict[str, Any]) -> str:
        """Keep a set-up; return the address of its page, which cannot be guessed: a set-up may name files."""
        token = secrets.token_urlsafe(16)
        self._kept[token] = setup
        while len(self._kept) > KEPT_SETUPS:
            self._kept.popitem(last=False)
        return f"?setup={token}"

    def open(self, doc: Any) -> None:
        """Fill the document of a new tab.

        A tab counts from here on, before its browser is connected, until Bokeh lets its session go: the
        server's one thread does nothing else between the count and the new tab.
        """
        from hoof_env.view.layout import template
        from hoof_env.view.tab import Tab

        wait = False
        asked = doc.session_context.request.arguments.get("setup", [b""])[0].decode("ascii", "replace")
        try:
            self._tabs = [tab for tab in self._tabs if tab.is_open]
            if len(self._tabs) >= MOST_TABS:
                # A page that is loaded again is here before the old one has gone.
                wait = True
                raise ParameterError(
                    f"{MOST_TABS} tabs are open, each with a simulation; this one waits until one is closed"
                )
            if asked and asked not in self._kept:
                raise ParameterError("this page is too old; open the first one again")
            self._tabs.append(Tab(doc, self._kept.get(asked, self._first), self.keep, self._out))
        except Exception as error:
            doc.clear()
            doc.title = "hoof-env view"
            doc.template = template("refused.html")
            doc.template_variables.update(reason=words_of(error), wait=wait)


def start(
    setup: dict[str, Any], address: str = HERE[0], port: int = 5006, out: Path = Path()
) -> tuple[Any, str]:
    """Start the server of a set-up.

    Args:
        setup: arguments of `Simulation`.
        address: address of this machine on which the server listens.
        port: port, 0 for any that is free.
        out: folder of recordings.

    Returns:
        Bokeh's server, whose `io_loop` is not running yet, and the URL of the page.

    Raises:
        MissingExtraError: Bokeh is not installed.
        HoofEnvError: the set-up is refused, the port is taken, or the address is not one of this machine.
    """
    check_bokeh()
    from bokeh.application import Application
    from bokeh.application.handlers.function import FunctionHandler
    from bokeh.server.server import Server

    from hoof_env.view.answers import try_out

    count("port", port, low=0, most=65535)
    if ":" in address:  # Bokeh's list of origins cannot name it
        raise ParameterError(f"address: expected an IPv4 address or a name, got {address!r}")
    check_folder(out)
    try_out(setup)
    pages = Pages(setup, out)
    try:
        port = port or free_port(address)
        server = Server(
            {"/": Application(FunctionHandler(pages.open))},
            address=address,
            port=port,
            allow_websocket_origin=[f"{name}:{port}" for name in {address, "localhost"}],
            check_unused_sessions_milliseconds=500,
            unused_session_lifetime_milliseconds=LINGER,
        )
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise ParameterError(f"port: expected a free one, {port} is taken; 0 takes any") from None
        raise ParameterError(f"address: expected one of this machine, got {address!r} ({error})") from None
    server.start()
    return server, f"http://{address}:{server.port}/"


def free_port(address: str) -> int:
    """Return a port that is free now: pages are refused unless their port is known beforehand."""
    with socket.create_server((address, 0)) as taken:
        return int(taken.getsockname()[1])


def view(
    env_id: str,
    arguments: Sequence[str],
    policy: str | None,
    seed: int,
    address: str,
    port: int,
    open_browser: bool,
    out: Path,
) -> None:
    """Serve the page until Ctrl-C, as `hoof-env view` does with the same options.

    Raises:
        HoofEnvError: as in `start`.
    """
    setup = {
        "env_id": env_id,
        "arguments": parse_pairs("--args", arguments),
        "policy": policy,
        "seed": seed,
    }
    server, url = start(setup, address, port, out)
    # A tab that is closed would be told in a line for each message that was under way to it.
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)
    if address not in HERE:
        print(
            f"hoof-env view: warning: all who reach {address} can use this page, load files and write"
            " recordings",
            file=sys.stderr,
            flush=True,
        )
    print(f"{url}  (Ctrl-C stops)", flush=True)
    if open_browser and has_display():
        server.io_loop.add_callback(webbrowser.open, url)
    try:
        server.io_loop.start()
    finally:
        server.stop()


def has_display() -> bool:
    """True if a browser can show a window here."""
    return sys.platform in ("win32", "darwin") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))

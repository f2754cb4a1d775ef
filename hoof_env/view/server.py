"""Server of the live page, on this machine: `hoof-env view`."""

from __future__ import annotations

import errno
import ipaddress
import logging
import os
import secrets
import socket
import sys
import webbrowser
from collections import OrderedDict
from collections.abc import Collection, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hoof_env._input import as_path
from hoof_env._output import check_folder
from hoof_env.errors import MissingExtraError, ParameterError, brief, count, parse_pairs
from hoof_env.view.messages import error_text

MAX_TABS = 8
"""Largest number of tabs, each with a simulation of its own."""

LINGER = 1000
"""Time after which the simulation of a tab without a browser is closed [ms]."""

MAX_SETUPS = 64
"""Largest number of set-ups to which tabs may return."""

HERE = ("127.0.0.1", "localhost")
"""Addresses that only this machine reaches."""

PRIVATE = (".local", ".lan", ".internal", ".home.arpa")
"""Ends of names that the public name service does not give out, so that no other site can own one."""


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
        while len(self._kept) > MAX_SETUPS:
            self._kept.popitem(last=False)
        return f"?setup={token}"

    def open(self, doc: Any) -> None:
        """Fill the document of a new tab.

        A tab counts from here on, before its browser is connected, until Bokeh lets its session go: the
        server's one thread does nothing else between the count and the new tab.
        """
        from hoof_env.view.tab import Tab
        from hoof_env.view.templates import template

        wait = False
        asked = doc.session_context.request.arguments.get("setup", [b""])[0].decode("ascii", "replace")
        try:
            self._tabs = [tab for tab in self._tabs if tab.is_open]
            if len(self._tabs) >= MAX_TABS:
                # A page that is loaded again is here before the old one has gone.
                wait = True
                raise ParameterError(
                    f"{MAX_TABS} tabs are open, each with a simulation; this one waits until one is closed"
                )
            if asked and asked not in self._kept:
                raise ParameterError("this page is too old; open the first one again")
            self._tabs.append(Tab(doc, self._kept.get(asked, self._first), self.keep, self._out))
        except Exception as error:
            doc.clear()
            doc.title = "hoof-env view"
            doc.template = template("refused.html")
            doc.template_variables.update(reason=error_text(error), wait=wait)


def is_own_name(name: str, address: str, hosts: Collection[str] = ()) -> bool:
    """True if a page that is served at an address may be asked for by this name.

    A site on the internet can make its own name lead to this machine, and its scripts would then act as
    the page. Only loopback names are therefore answered at a loopback address. At an address that other
    machines reach a browser may also come by an address in numbers, or by a name of the local network.

    Args:
        name: host of a request, without its port.
        address: address at which the server listens.
        hosts: further names, given by the user.
    """
    name = name.lower().removesuffix(".")
    if name in {address.lower(), *HERE, *(host.lower() for host in hosts)}:
        return True
    try:
        number = ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        is_local = "." not in name or name.endswith(PRIVATE) or name == socket.gethostname().lower()
        return is_local and not is_loopback(address)
    return number.is_loopback or not is_loopback(address)


def is_loopback(address: str) -> bool:
    """True if only this machine reaches an address."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address.lower() == "localhost"


def guarded(address: str, hosts: Collection[str]) -> type[Any]:
    """Return Bokeh's application of Tornado, which answers requests by the server's own names alone, see
    `is_own_name`, and opens sockets for pages of the same name and port alone."""
    from bokeh.server.tornado import BokehTornado
    from tornado.web import RequestHandler

    class Refusal(RequestHandler):
        def prepare(self) -> None:
            self.set_status(403)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(
                "hoof-env view: this page is not served by that name. If the name is this machine's, start"
                " the page with --host NAME.\n"
            )

    class Guarded(BokehTornado):
        def find_handler(self, request: Any, **kwargs: Any) -> Any:
            """Find the handler of a request, a refusal for a foreign host or origin."""
            origin = request.headers.get("Origin") if "Upgrade" in request.headers else None
            is_same = origin is None or origin.partition("://")[2].lower() == request.host.lower()
            if is_same and is_own_name(request.host_name, address, hosts):
                return super().find_handler(request, **kwargs)
            return self.get_handler_delegate(request, Refusal)

    return Guarded


def start(
    setup: dict[str, Any],
    address: str = HERE[0],
    port: int = 5006,
    out: Path | str = Path(),
    hosts: Collection[str] = (),
) -> tuple[Any, str]:
    """Start the server of a set-up.

    Args:
        setup: arguments of `Simulation`.
        address: address of this machine on which the server listens.
        port: port, 0 for any that is free.
        out: folder of recordings.
        hosts: names of this machine by which browsers may come, besides the names of `is_own_name`.

    Returns:
        Bokeh's server, whose `io_loop` is not running yet, and the URL of the page.

    Raises:
        MissingExtraError: Bokeh is not installed.
        HoofEnvError: the set-up is refused, the port is taken, or the address is not one of this machine.
    """
    out = as_path("out", out)
    check_bokeh()
    from bokeh.application import Application
    from bokeh.application.handlers.function import FunctionHandler
    from bokeh.server.server import BaseServer
    from tornado.httpserver import HTTPServer
    from tornado.ioloop import IOLoop
    from tornado.netutil import bind_sockets

    from hoof_env.view.session import try_out

    count("port", port, low=0, most=65535)
    if ":" in address:
        raise ParameterError(f"address: expected an IPv4 address or a name, got {brief(address)}")
    for name in hosts:
        if not (name and name.isprintable()) or any(mark in name for mark in ":/ "):
            raise ParameterError(f"host: expected a host name without scheme or port, got {brief(name)}")
    check_folder(out)
    try_out(setup)
    pages = Pages(setup, out)
    try:
        sockets = bind_sockets(port, address)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise ParameterError(f"port: expected a free one, {port} is taken; 0 takes any") from None
        raise ParameterError(
            f"address: expected one of this machine, got {brief(address)} ({error})"
        ) from None
    url = f"http://{address}:{sockets[0].getsockname()[1]}/"
    application = guarded(address, hosts)(
        {"/": Application(FunctionHandler(pages.open))},
        absolute_url=url,
        # `guarded` compares a socket's origin with the host by which its page came.
        extra_websocket_origins=["*"],
        check_unused_sessions_milliseconds=500,
        unused_session_lifetime_milliseconds=LINGER,
    )
    http = HTTPServer(application)
    http.add_sockets(sockets)
    server = BaseServer(IOLoop.current(), application, http)
    server.start()
    return server, url


def view(
    env_id: str,
    arguments: Sequence[str],
    policy: str | None,
    seed: int,
    address: str,
    port: int,
    open_browser: bool,
    out: Path | str,
    hosts: Sequence[str] = (),
) -> None:
    """Serve the page until Ctrl-C, as `hoof-env view` does with the same options.

    Raises:
        HoofEnvError: as in `start`.
    """
    out = as_path("out", out)
    setup = {
        "env_id": env_id,
        "arguments": parse_pairs("--env-kwargs", arguments),
        "policy": policy,
        "seed": seed,
    }
    server, url = start(setup, address, port, out, hosts)
    # Otherwise each message on its way to a closed tab would cause a line.
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)
    if address not in HERE:
        print(
            f"hoof-env view: warning: everybody who reaches {address} can use this page, load files and write"
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

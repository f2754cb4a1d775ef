"""The server of the live page: ports, addresses, its command, tabs beyond the limit."""

from __future__ import annotations

import asyncio
import socket

import pytest

from hoof_env import cli
from hoof_env.errors import MissingExtraError, ParameterError

pytest.importorskip("bokeh")

from tornado.httpclient import AsyncHTTPClient

from hoof_env.view import server
from hoof_env.view.server import Pages, is_own_name, start
from tests.view.pages import SETUP, opened


def test_a_port_that_is_taken_is_reported():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(ParameterError, match=r"port: expected a free one, \d+ is taken"):
            start(SETUP, port=taken.getsockname()[1])
    with pytest.raises(ParameterError, match="address"):
        start(SETUP, address="203.0.113.7", port=0)
    with pytest.raises(ParameterError, match=r"address: .*IPv4 .*got '::1'"):
        start(SETUP, address="::1", port=0)


@pytest.mark.parametrize(
    "options", [["--env-id", "CartPole-v1"], ["--port", "99999"], ["--policy", "gallop"], ["--seed", "-1"]]
)
def test_the_command_refuses_before_it_serves(options, capsys):
    assert cli.main(["view", "--no-open", *options]) == 2
    assert "hoof-env: error" in capsys.readouterr().err


def test_without_bokeh_the_command_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(server, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'pip install "hoof-env\[view\]"'):
        start(SETUP)


def test_a_page_that_is_refused_takes_no_place_and_an_old_one_is_reported(tmp_path):
    pages = Pages(SETUP, tmp_path)
    assert "too old" in opened(pages, setup=[b"guessed"]).template_variables["reason"]
    kept = pages.keep(SETUP | {"seed": 7}).partition("=")[2]
    doc = opened(pages, setup=[kept.encode()])
    assert doc.template_variables["simulation"].seed == 7
    assert len(pages._tabs) == 1


def answer(port, host, *headers):
    """Status line of this machine's answer to a browser that came by the name `host`."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as wire:
        lines = ("GET / HTTP/1.1", f"Host: {host}", "Connection: close", *headers)
        wire.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return int(wire.recv(64).split()[1])


def test_the_page_is_served_by_its_own_names_alone(tmp_path):
    """A site that makes its own name lead here gets neither page nor socket, whatever Tornado checks."""
    running, url = start(SETUP, port=0, out=tmp_path, hosts=["proxy.example.org"])
    port = int(url.rstrip("/").rpartition(":")[2])
    loop = running.io_loop

    def asked(*request):
        return loop.run_sync(lambda: loop.run_in_executor(None, answer, port, *request))

    upgrade = (
        "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: aG9vZi1lbnYtdmlldy0xMg==",
    )  # fmt: skip
    try:
        own = (f"127.0.0.1:{port}", f"localhost:{port}", "127.8.0.1", "LOCALHOST:80", "proxy.example.org")
        assert [asked(host) for host in own] == [200] * 5
        foreign = ("rebound.example.org", "127.0.0.1.example.org", "192.0.2.7:80", "lab-computer", "[::2]:1")
        assert [asked(host) for host in foreign] == [403] * 5
        here = f"localhost:{port}"
        for origin in ("http://rebound.example.org", "http://localhost:1", "null"):
            assert asked(here, *upgrade, f"Origin: {origin}") == 403
        assert asked("rebound.example.org", *upgrade, "Origin: http://rebound.example.org") == 403
    finally:
        running.stop()


def test_names_of_a_page_that_other_machines_reach():
    numbers_and_local = ("198.51.100.7", "lab-computer", "lab.local", "[2001:db8::1]", "localhost", "0.0.0.0")
    assert all(is_own_name(name, "0.0.0.0") for name in numbers_and_local)
    assert not is_own_name("rebound.example.org", "0.0.0.0")
    assert is_own_name("rebound.example.org", "0.0.0.0", ["Rebound.example.org"])
    assert is_own_name("lab.example.org", "lab.example.org")
    assert is_own_name("localhost.", "127.0.0.1")
    with pytest.raises(ParameterError, match=r"host: expected a host name without .*got 'lab:80'"):
        start(SETUP, hosts=["lab:80"])


def test_no_more_tabs_than_the_limit_however_fast_they_are_opened(tmp_path, monkeypatch):
    """Requests that come in the same instant, before any browser is connected."""
    monkeypatch.setattr(server, "MAX_TABS", 2)
    monkeypatch.setattr(server, "LINGER", 6000)  # longer than a slow machine needs for four pages
    running, url = start(SETUP, port=0, out=tmp_path)
    loop = running.io_loop
    client = AsyncHTTPClient()

    async def load(count):
        answers = [client.fetch(url, request_timeout=300, connect_timeout=300) for _ in range(count)]
        return [(await answer).body.decode() for answer in answers]

    async def at_last():
        # Sessions without a browser are let go after a while.
        for _ in range(100):
            (page,) = await load(1)
            if "Set-up" in page:
                return page
            await asyncio.sleep(0.2)
        return page

    pages = loop.run_sync(lambda: load(4))
    assert sum("Set-up" in page for page in pages) == 2
    assert sum('http-equiv="refresh"' in page and "2 tabs are open" in page for page in pages) == 2
    assert "Set-up" in loop.run_sync(at_last)
    running.stop()

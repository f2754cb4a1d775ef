"""How the live page runs: python -m benchmarks.view --out DIR [--hour]

States that reach the browser, frames that it paints, processor shares of the server and of the simulation
alone, memory of the server over an hour, sizes of pages that stand alone, and pictures. Needs the extras
`view` and `site`, and Chromium.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hoof_env.view.controls import CONDITIONS, PAPER_ID
from hoof_env.view.playback import Playback
from hoof_env.view.simulation import Simulation

LEG, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"
WATCHED = 15.0  # time over which a page is watched [s]
HOUR = 3600.0  # [s]
TABS = 20  # number of tabs that are opened and closed after an hour

SERVE = """
import sys
from pathlib import Path
from hoof_env.view.server import start
server, url = start(dict(env_id=sys.argv[1], arguments={}, policy=None, seed=0), port=0, out=Path("."))
print(url, flush=True)
server.io_loop.start()
"""
COUNTS = (
    "[Number(document.body.dataset.states), Number(document.body.dataset.frames), performance.now() / 1000]"
)

SHOWN = "parseFloat(document.querySelector('#at').textContent)"
MOVE = "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('change')) }"


def processor_time(process: int) -> float:
    """Return the processor time that a process has used [s], from /proc."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def served(env_id: str) -> Iterator[tuple[int, str]]:
    """Serve a page from another process; yield the process's number and the address."""
    command = [sys.executable, "-c", SERVE, env_id]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            yield server.pid, server.stdout.readline().strip()
        finally:
            server.kill()


@contextmanager
def chromium() -> Iterator[Any]:
    """Start Chromium without a display; yield it."""
    from playwright.sync_api import sync_playwright

    path = os.environ.get("CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as players:
        browser = players.chromium.launch(executable_path=path)
        yield browser
        browser.close()


def opened(browser: Any, url: str, width: int = 1280) -> Any:
    """Open a page and return it when it plays."""
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(url)
    page.wait_for_selector("body[data-ready]", timeout=120_000)
    return page


def watch(env_id: str, out: Path, width: int = 1280) -> dict[str, float]:
    """Return states and frames a second of a page, and the share of a core that its server takes."""
    with served(env_id) as (server, url), chromium() as browser:
        page = opened(browser, url, width)
        page.wait_for_timeout(3000)
        before, used = page.evaluate(COUNTS), processor_time(server)
        page.wait_for_timeout(1000 * WATCHED)
        after, spent = page.evaluate(COUNTS), processor_time(server)
        page.screenshot(path=out / f"{env_id.rpartition('/')[2]}-{width}.png")
    seconds = after[2] - before[2]
    return {
        "states a second": (after[0] - before[0]) / seconds,
        "frames a second": (after[1] - before[1]) / seconds,
        "share of a core": (spent - used) / seconds,
    }


def alone(env_id: str) -> float:
    """Return the share of a core that the same simulation takes without a page, records included."""
    simulation = Simulation(env_id)
    simulation.reset()
    steps = 250
    began = time.process_time()
    for _ in range(steps):
        if simulation.step() is None:
            simulation.reset()
    return (time.process_time() - began) / (steps * simulation.dt)


def memory_of(process: int) -> float:
    """Return the memory of a process that is resident [MB], from /proc."""
    pages = Path(f"/proc/{process}/statm").read_text(encoding="utf-8").split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory_over(env_id: str, seconds: float, speed: float = 1.0) -> dict[str, Any]:
    """Return the memory of a server by the minutes that its page has shown, and after each of some tabs that
    were opened and closed [MB].

    Args:
        env_id: id of an environment.
        seconds: simulated time over which the page is watched [s].
        speed: simulated over real time [-].
    """
    with served(env_id) as (server, url), chromium() as browser:
        page = opened(browser, url)
        page.emulate_media(reduced_motion="reduce")  # what the browser paints is not measured here
        page.locator("#speed").evaluate(MOVE, str(speed))
        minutes: dict[str, float] = {}
        shown = 0.0
        while shown < seconds:
            page.wait_for_timeout(60_000)
            shown, states = page.evaluate(SHOWN), page.evaluate(COUNTS)[0]
            minutes[f"{shown / 60:.1f}"] = memory_of(server)
            print(f"{env_id}, {shown / 60:.1f} min, {states} states: {memory_of(server):.1f} MB", flush=True)
        tabs = []
        for _ in range(TABS):
            other = opened(browser, url)
            other.wait_for_timeout(3000)
            other.close()
            page.wait_for_timeout(3000)
            tabs.append(memory_of(server))
            print(f"{env_id}, tab {len(tabs)}: {tabs[-1]:.1f} MB", flush=True)
    return {"states": states, "by minute": minutes, "after each tab": tabs}


def sizes(out: Path) -> dict[str, float]:
    """Write pages that stand alone and return their sizes [MB]: with the library, and without."""
    runs = [
        {"label": label, "env_id": PAPER_ID, "policy": arguments["gait"], "arguments": arguments}
        for label, arguments in CONDITIONS.items()
    ]
    pages = {
        "leg, 4 s": Playback.of_policy(LEG),
        "horse, 2 s": Playback.of_policy(HORSE, seconds=2.0),
        "paper, 4 x 1 s": Playback.play(*runs, seconds=1.0),
    }
    found = {}
    for name, page in pages.items():
        for library in (None, "bokeh.min.js"):
            path = page.write(out / "page.html", library)
            found[f"{name}{', library shared' if library else ''}"] = path.stat().st_size / 1e6
    return found


def main() -> None:
    """Measure, print and write view.json."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of figures and pictures")
    parser.add_argument("--hour", action="store_true", help="watch a page of each id for an hour of its time")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    figures: dict[str, Any] = {"load": os.getloadavg()[0]}
    for env_id in (LEG, HORSE):
        figures[env_id] = {**watch(env_id, given.out), "simulation alone": alone(env_id)}
        print(env_id, figures[env_id], flush=True)
    watch(LEG, given.out, 390)
    figures["sizes"] = sizes(given.out)
    if given.hour:
        figures["memory"] = {LEG: memory_over(LEG, HOUR), HORSE: memory_over(HORSE, HOUR, speed=2.0)}
    (given.out / "view.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()

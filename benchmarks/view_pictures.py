"""Pictures of the live page in six states and on a phone: python -m benchmarks.view_pictures --out DIR

Needs the extras `view` and `render`, playwright and Chromium.
"""

from __future__ import annotations

import argparse
import io
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.view import HORSE, LEG, SERVE
from hoof_env.view.controls import CONDITIONS, PAPER_ID
from hoof_env.view.playback import Playback

WIDE = (1280, 1000)  # of a screen [pixels]
PHONE = (390, 844)  # of a phone [pixels]
QUALITY = 80  # of a WebP
READY = "body[data-ready]"


@contextmanager
def served(env_id: str) -> Iterator[str]:
    """Serve the page of an id by another process; yield its address."""
    with subprocess.Popen([sys.executable, "-c", SERVE, env_id], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        yield server.stdout.readline().strip()
        server.kill()


def after(page: Any, seconds: float) -> None:
    """Wait until the page shows a time of its episode [s]."""
    shown = "([t]) => Number(document.querySelector('[data-number=time]').textContent) >= t"
    page.wait_for_function(shown, arg=[seconds], timeout=120_000)


def move(page: Any, slider: str, value: float) -> None:
    """Move a slider to a value, with the events of a hand."""
    script = "(e, v) => { e.value = v; for (const t of ['input', 'change']) e.dispatchEvent(new Event(t)) }"
    page.locator(f"#{slider}").evaluate(script, str(value))
    page.wait_for_timeout(300)


def touched(page: Any) -> None:
    """Let the paper's run go on softer, half elastic ground."""
    after(page, 0.5)
    page.get_by_role("button", name="run, inelastic").click()
    page.wait_for_url("**/?setup=*")
    page.wait_for_selector(READY)
    after(page, 1.5)
    move(page, "touch-restitution", 0.5)
    move(page, "touch-stiffness", 4.0)  # by its logarithm: 10 kN/m^n
    after(page, 4.0)


def scrubbed(page: Any) -> None:
    """Pause, and go back to a stance."""
    after(page, 4.0)
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play").wait_for()
    move(page, "back", 1.07)


def refused(page: Any) -> None:
    """Ask for a policy that does not exist."""
    after(page, 3.0)
    page.get_by_label("policy").fill("gallop")
    page.get_by_role("button", name="Apply").click()
    page.wait_for_selector("#status[data-kind=error]")


def opened(page: Any) -> None:
    """Open the group of the ground on a phone."""
    after(page, 3.0)
    page.get_by_text("Ground", exact=True).click()


def played(page: Any) -> None:
    """Go to the middle of a page that plays by itself."""
    page.locator("#at").fill("22")


LIVE: tuple[tuple[str, str, tuple[int, int], Callable[[Any], None]], ...] = (
    ("leg", LEG, WIDE, lambda page: after(page, 4.0)),
    ("horse", HORSE, WIDE, lambda page: after(page, 4.0)),
    ("touched", LEG, WIDE, touched),
    ("scrubbed", LEG, WIDE, scrubbed),
    ("refused", LEG, WIDE, refused),
    ("phone", LEG, PHONE, opened),
)
"""Name, id, size of the screen, and what is done before the picture."""


def four_conditions() -> Playback:
    """Return the page of the paper's four conditions."""
    runs = [
        {"label": label, "env_id": PAPER_ID, "policy": given["gait"], "arguments": given}
        for label, given in CONDITIONS.items()
    ]
    return Playback.play(*runs, seconds=1.0)


def take(page: Any, path: Path, is_whole: bool) -> None:
    """Write a picture of a page."""
    from PIL import Image

    page.wait_for_timeout(1500)  # figures take turns
    shot = page.screenshot(full_page=is_whole)
    with Image.open(io.BytesIO(shot)) as image:
        image.convert("RGB").save(path, quality=QUALITY, method=6)


def main() -> None:
    """Write the pictures."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of the pictures")
    parser.add_argument("--only", nargs="*", help="names of pictures")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    wanted = given.only or [*(name for name, *_ in LIVE), "alone"]
    with sync_playwright() as players:
        browser = players.chromium.launch(executable_path=chromium)

        def open_page(size: tuple[int, int], url: str) -> Any:
            page = browser.new_page(viewport={"width": size[0], "height": size[1]})
            page.goto(url)
            page.wait_for_selector(READY, timeout=120_000)
            return page

        for name, env_id, size, act in LIVE:
            if name not in wanted:
                continue
            with served(env_id) as url:
                page = open_page(size, url)
                act(page)
                take(page, given.out / f"{name}.webp", name == "phone")
                page.close()
        if "alone" in wanted:
            alone = four_conditions().write(given.out / "alone.html")
            page = open_page(WIDE, alone.resolve().as_uri())
            played(page)
            take(page, given.out / "alone.webp", False)
            alone.unlink()
        browser.close()


if __name__ == "__main__":
    main()

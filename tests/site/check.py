"""Every page of the built site in a browser, wide and narrow, light and dark: python -m tests.site.check

`make test-site` builds the site and runs this. The browser is the system's Chromium, else Playwright's own.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from itertools import product
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, sync_playwright

SITE = Path(__file__).resolve().parents[2] / "build" / "site"
HEIGHTS = {1280: 800, 390: 844}
WINDOWS = ((1280, "light"), (390, "dark"))
"""Width and scheme of colours; --all takes the other two, too."""

TELL_SECONDS = 20.0
"""Time between two lines about the progress [s]."""

WAIT = 120_000
"""Longest wait for a page [ms]: other work may have the processors."""

RULES = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"], "resultTypes": ["violations"]}
"""Of axe-core: contrast AA, text of images, names of links and buttons, order of headings and others."""

PICTURES = {
    "front": ("docs/index.html", 1280, "light"),
    "environment": ("docs/environments/HorseLeg.html", 1280, "light"),
    "horse": ("docs/environments/Horse.html", 1280, "dark"),
    "api": ("docs/api/engine.html", 1280, "light"),
    "phone": ("docs/environments/HorseLeg.html", 390, "light"),
    "evidence": ("docs/evidence/README.html", 1280, "dark"),
}
"""Pages to take pictures of: file, width, scheme."""

SHEETS = ("index", "start", "environments/README", "environments/HorseLeg", "task", "engine", "horse", "help")
"""Pages of docs on the contact sheets, in rows of four."""

QUESTIONS = (
    "install",
    "slow first start",
    "weight share",
    "cost of transport",
    "which environment",
    "custom reward",
    "open loop",
    "force plate c3d",
    "GPU",
    "trot",
)
"""What a newcomer may search for."""

TALL, SHEET_WIDTH = 1.6, {1280: 460, 390: 220}
"""Part of a page on a sheet, over the height of a window; width of a page there [pixels]."""

TOO_WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
BAD_IMAGES = (
    """[...document.images].filter(i => !i.complete || !i.naturalWidth || !i.alt.trim()).map(i => i.src)"""
)


@contextmanager
def served(site: Path) -> Iterator[str]:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        def handle_error(self, *_: object) -> None:
            """A page that is closed while it loads is no fault."""

    with Server(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def faults_of(browser: Browser, address: str, width: int, scheme: str) -> list[str]:
    """What is wrong with one page in one window."""
    page = browser.new_page(viewport={"width": width, "height": HEIGHTS[width]}, color_scheme=scheme)
    page.set_default_timeout(WAIT)
    faults: list[str] = []
    page.on("console", lambda said: faults.append(f"console: {said.text}") if said.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(f"script: {error}"))
    page.on("response", lambda got: faults.append(f"{got.status}: {got.url}") if got.status >= 400 else None)
    try:
        page.goto(address, wait_until="load")
        if (wide := page.evaluate(TOO_WIDE)) > 0:
            faults.append(f"{wide} px too wide")
        faults += [f"image without text or not loaded: {image}" for image in page.evaluate(BAD_IMAGES)]
        for found in Axe().run(page, options=RULES).response["violations"]:
            at = found["nodes"][0]
            told = (at["any"] or at["all"] or at["none"] or [{"message": found["help"]}])[0]["message"]
            faults.append(f"{found['id']} in {len(found['nodes'])} places: {at['html'][:120]}: {told}")
    finally:
        page.close()
    return faults


def faults_of_use(browser: Browser, root: str) -> list[str]:
    """What is wrong with the way in, search and the buttons that copy code; an error if one is not there."""
    page = browser.new_page()
    page.set_default_timeout(WAIT)
    try:
        page.goto(root)
        page.wait_for_url(f"{root}/docs/index.html")
        page.goto(f"{root}/search.html?q=stance")
        page.wait_for_selector("#search-results ul.search li")
        page.goto(f"{root}/docs/environments/HorseLeg.html")
        blocks, buttons = (page.locator(what).count() for what in ("div.highlight pre", "button.copybtn"))
        return [] if blocks == buttons > 0 else [f"{blocks} blocks of code, {buttons} buttons to copy"]
    finally:
        page.close()


def take_pictures(browser: Browser, root: str, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for name, (file, width, scheme) in PICTURES.items():
        page: Page = browser.new_page(
            viewport={"width": width, "height": HEIGHTS[width]}, color_scheme=scheme
        )
        page.goto(f"{root}/{file}", wait_until="load")
        page.screenshot(path=out / f"{name}.png", animations="disabled")
        page.close()


def answers(browser: Browser, root: str) -> str:
    """Return the first three results of a search for each of `QUESTIONS`, as rows of a table."""
    rows = ["| search for | first | second | third |", "|---|---|---|---|"]
    for question in QUESTIONS:
        page = browser.new_page()
        page.goto(f"{root}/search.html?q={question.replace(' ', '+')}")
        page.wait_for_selector("#search-results ul.search li", timeout=60_000)
        page.wait_for_timeout(2_000)  # results come in one after the other
        found = page.locator("#search-results ul.search > li > a:first-of-type").all_inner_texts()
        rows.append(f"| {' | '.join([question, *found[:3]])} |")
        page.close()
    return "\n".join(rows)


def take_sheets(browser: Browser, root: str, out: Path) -> None:
    """Write a contact sheet for each width and scheme of colours: the first part of each of `SHEETS`."""
    from PIL import Image

    out.mkdir(parents=True, exist_ok=True)
    for width, scheme in product(HEIGHTS, ("light", "dark")):
        shots = []
        for name in SHEETS:
            size = {"width": width, "height": int(TALL * HEIGHTS[width])}
            page = browser.new_page(viewport=size, color_scheme=scheme)
            page.goto(f"{root}/docs/{name}.html", wait_until="load")
            shots.append(Image.open(BytesIO(page.screenshot(animations="disabled"))).convert("RGB"))
            page.close()
        narrow = SHEET_WIDTH[width]
        tall = narrow * shots[0].height // shots[0].width
        sheet = Image.new("RGB", (4 * narrow + 30, 2 * tall + 10), (128, 128, 128))
        for k, shot in enumerate(shots):
            place = (k % 4 * (narrow + 10), k // 4 * (tall + 10))
            sheet.paste(shot.resize((narrow, tall), Image.Resampling.LANCZOS), place)
        sheet.save(out / f"{width}-{scheme}.webp", quality=55, method=6)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--site", type=Path, default=SITE, help="the folder that make docs wrote")
    parser.add_argument("--only", default="", help="pages whose path has this alone")
    parser.add_argument("--pictures", type=Path, help="also write pictures of some pages there")
    parser.add_argument("--sheets", type=Path, help="only write contact sheets of eight pages there")
    parser.add_argument("--search", action="store_true", help="only print what searches find")
    parser.add_argument("--all", action="store_true", help="both widths, light and dark each")
    given = parser.parse_args()
    windows = tuple(product(HEIGHTS, ("light", "dark"))) if given.all else WINDOWS
    started, wrong = time.monotonic(), 0
    files = sorted(file.relative_to(given.site).as_posix() for file in given.site.rglob("*.html"))
    files = [
        file for file in files if given.only in file and file != "index.html"
    ]  # it leads to the front page
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    with served(given.site) as root, sync_playwright() as players:
        browser = players.chromium.launch(executable_path=chromium)
        if given.sheets or given.search:
            if given.sheets:
                take_sheets(browser, root, given.sheets)
            if given.search:
                print(answers(browser, root))
            browser.close()
            return 0
        said = started
        for done, file in enumerate(files):
            if time.monotonic() - said >= TELL_SECONDS:
                said = time.monotonic()
                print(f"{done} of {len(files)} pages, {said - started:.0f} s", file=sys.stderr, flush=True)
            for width, scheme in windows:
                for fault in faults_of(browser, f"{root}/{file}", width, scheme):
                    wrong += 1
                    print(f"{file} at {width} px, {scheme}: {fault}", flush=True)
        for fault in faults_of_use(browser, root):
            wrong += 1
            print(fault)
        if given.pictures:
            take_pictures(browser, root, given.pictures)
        version = browser.version
        browser.close()
    print(
        f"{len(files)} pages in {len(windows)} windows of Chromium {version}: {wrong} faults, "
        f"{time.monotonic() - started:.0f} s"
    )
    return 1 if wrong or not files else 0


if __name__ == "__main__":
    sys.exit(main())

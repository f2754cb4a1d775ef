"""Time from `pip install` to the first moved slider: python -m benchmarks.first_slider --wheel FILE.whl

Installs the wheel with the extra `view` into a new environment, starts `hoof-env view` with an empty store of
kernels, and moves a slider in headless Chromium until the page answers. Needs playwright and Chromium.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.view_pictures import READY

BINARIES = "Scripts" if sys.platform == "win32" else "bin"


def main() -> None:
    """Measure and print each part."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--wheel", type=Path, required=True, help="the wheel")
    wheel = parser.parse_args().wheel.resolve()
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as players:
        place = Path(folder)
        subprocess.run([sys.executable, "-m", "venv", place / "env"], check=True)
        binaries = place / "env" / BINARIES
        began = time.monotonic()

        def tell(what: str) -> None:
            print(f"{time.monotonic() - began:6.1f} s  {what}", flush=True)

        print(f"load average {os.getloadavg()[0]:.1f}")
        subprocess.run([binaries / "python", "-m", "pip", "install", "-q", f"{wheel}[view]"], check=True)
        tell("installed")
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        environment["HOOF_ENV_CACHE_DIR"] = str(place / "kernels")
        command = [str(binaries / "hoof-env"), "view", "--no-open", "--port", "0"]
        with subprocess.Popen(
            command, cwd=place, env=environment, stdout=subprocess.PIPE, text=True
        ) as server:
            assert server.stdout is not None
            url = server.stdout.readline().split()[0]
            tell("kernels compiled, page served")
            browser = players.chromium.launch(executable_path=chromium)
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(url)
            page.wait_for_selector(READY, timeout=300_000)
            tell("page open")
            slider = page.locator("#drive-crank_speed")
            slider.focus()
            page.keyboard.press("ArrowRight")
            page.wait_for_function("document.querySelector('#status').textContent.includes('You drive')")
            tell("slider moved, and answered")
            browser.close()
            server.kill()


if __name__ == "__main__":
    main()

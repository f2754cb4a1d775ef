"""The site builds without a warning, and its links lead somewhere; `make test-site` has a look by browser."""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import gymnasium
import pytest

import hoof_env

ROOT = Path(__file__).resolve().parent.parent
pytest.importorskip("sphinx")


class Links(HTMLParser):
    """Where a page leads, what can be led to in it, and its images without a text."""

    def __init__(self, page):
        super().__init__()
        self.targets, self.ids, self.untold, self.images, self.frames = [], set(), [], [], []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        has = dict(attrs)
        self.targets += [has[name] for name in ("href", "src") if has.get(name)]
        self.ids |= {has["id"]} if "id" in has else set()
        if tag == "iframe":
            self.frames.append(has["src"])
        if tag == "img":
            self.images.append(has["src"])
            self.untold += [] if has.get("alt", "").strip() else [has["src"]]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    options = ["-q", "-W", "--keep-going", "-n", "-c", "docs", "-d", str(out / "trees")]
    command = [sys.executable, "-m", "sphinx", *options, ".", str(out / "html")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return {
        page.relative_to(out / "html"): Links(page) for page in (out / "html").rglob("*.html")
    }, out / "html"


def test_every_link_leads_somewhere(site):
    pages, root = site
    broken = []
    for page, links in pages.items():
        for target in links.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            there = (root / page.parent / unquote(parts.path)).resolve() if parts.path else root / page
            ids = pages[there.relative_to(root)].ids if there.suffix == ".html" and there.is_file() else None
            fragment = unquote(parts.fragment)
            if not there.exists() or (fragment and ids is not None and fragment not in ids):
                broken.append(f"{page}: {target}")
    assert not broken[:10]
    assert len(pages) > 60


def test_every_page_and_every_id_is_there(site):
    pages, root = site
    sources = [page.with_suffix(".html").relative_to(ROOT) for page in (ROOT / "docs").rglob("*.md")]
    assert not set(sources) - set(pages)
    for id in (id for id in gymnasium.registry if id.startswith("hoof_env/")):
        page = pages[Path(f"docs/environments/{id[9:-3]}.html")]
        (frame,) = page.frames  # in place of the film that the repository shows
        playing = root / Path("docs/environments") / frame
        assert playing.is_file()
    films = {page for page, links in pages.items() if any(image.endswith(".gif") for image in links.images)}
    # They show what no page that plays does: two policies in one episode, published forces beside the
    # horse's. Each has a pause (site/static/animation.js).
    with_films = ("index", "hop", "horse", "seeing", "evidence/horse_gaits")
    assert films == {Path("docs", f"{name}.html") for name in with_films}
    for name in ("docs/paper.html", "docs/horse.html"):
        assert len(pages[Path(name)].frames) == 1
    assert not [image for page in pages.values() for image in page.untold]


def test_every_public_name_is_in_the_api(site):
    pages, _ = site
    there = {one for page, links in pages.items() if "api" in page.parts for one in links.ids}
    assert not [name for name in hoof_env.__all__ if name[0] != "_" and f"hoof_env.{name}" not in there]

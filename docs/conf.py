"""The site of these pages, by Sphinx: `make docs`. Its root is the repository, so that a page may link to any
other that is rendered and to any file."""

from __future__ import annotations

import gc
import html
import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx

from hoof_env import __version__

sys.path.insert(0, str(Path(__file__).parent / "site"))
import playbacks

# Pages stay until all are written: the collector would take a sixth of the time to look at them
gc.set_threshold(100_000)

project = "hoof-env"
author = "hoof-env contributors"
copyright = author
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "equations",
]

CHILDREN = {
    "docs/engine": ("/hoof_env/simd/README",),
    "docs/paper": ("paper/reproduction",),
    "docs/agents": ("/agents/policies/README",),
    "docs/environments/README": ("HorseLeg", "HorseLeg*", "*"),
    "docs/api/README": ("environments", "engine", "leg", "task", "lab", "errors"),
    "docs/evidence/README": ("*", "*/README", "/benchmarks/results/**", "/studies/README"),
    "agents/policies/README": ("*/card",),
}
"""Pages below a page, in the side bar. The pages themselves lack them: only Sphinx can read a toctree."""

root_doc = "docs/index"
include_patterns = [
    "docs/**", "CHANGELOG.md", "agents/policies/**.md", "hoof_env/simd/README.md", "benchmarks/results/**.md",
    "studies/README.md",
]  # fmt: skip
exclude_patterns = [".*", "runs", "build", "dist", "**/__pycache__"]

myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_space = False
html_math_renderer = "svg"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "NDArray": "NDArray"}
autodoc_default_options = {"members": True, "show-inheritance": True}
default_role = "py:obj"  # names in docstrings: a link where the API has the name
napoleon_google_docstring, napoleon_numpy_docstring = True, False
napoleon_use_ivar = True
add_module_names = False

nitpicky = True
nitpick_ignore_regex = [
    ("py:obj", ".*"),  # not every name in a docstring is public
    ("py:class", r"hoof_env\.episodes\..*"),
    ("py:class", r"hoof_env\.tasks\.(body\.Body|settings\.ResolvedSettings)"),
    ("py:class", r"hoof_env\.leg\.(mechanism|mjcf|profile)\..*"),
    ("py:class", r"hoof_env\.dynamics\.(engine_calls|layout)\..*"),
    ("py:.*", r"(?!hoof_env\.).*"),  # other people's names; their inventories need a network
]

html_theme = "furo"
html_title = f"hoof-env {version}"
html_static_path = ["site/static"]
html_favicon = "site/static/favicon.svg"
html_css_files = ["style.css"]
html_js_files = ["scroll.js", ("animation.js", {"defer": "defer"}), ("playback.js", {"defer": "defer"})]
html_search_scorer = str(Path(__file__).parent / "site/static/scorer.js")
html_extra_path = ["site/root"]
html_show_sourcelink = False
html_copy_source = False


BASES = r'<p>Bases: <code[^>]*><span class="pre">(?:object|NamedTuple|tuple)</span></code></p>'
"""Bases that say nothing."""


def add_children(app: Sphinx, page: str, text: list[str]) -> None:
    if page in CHILDREN:
        text[0] += "\n".join(("\n```{toctree}", ":hidden:", ":glob:", *CHILDREN[page], "```\n"))


def unlink_folders(app: Sphinx, tree: nodes.document) -> None:
    """A folder is a link where the repository is browsed, and text on the site."""
    here = Path(app.srcdir, app.env.docname).parent
    for link in list(tree.findall(pending_xref)):
        if link["reftype"] == "myst" and (here / link["reftarget"]).is_dir():
            link.replace_self(link.children)


def mend_page(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object) -> None:
    """The captions of Sphinx's side bar are headings without a level, which a screen reader needs. Links from
    sources back to the API miss what it has under another name: none is better."""
    captions = context["furo_navigation_tree"]
    context["furo_navigation_tree"] = captions.replace('role="heading"', 'role="heading" aria-level="2"')
    if page.startswith("_modules/"):
        context["body"] = re.sub(r'<a class="viewcode-back".*?</a>', "", context["body"])
    if page.startswith("docs/api/"):
        context["body"] = re.sub(BASES, "", context["body"])
    if isinstance(tree, nodes.document):
        told = next((text.astext() for text in tree.findall(nodes.paragraph)), "")
        words = html.escape(" ".join(told.split())[:200])
        title = html.escape(re.sub(r"<[^>]*>", "", context["title"]))
        context["metatags"] += (
            f'<meta name="description" content="{words}"><meta property="og:title" content="{title}">'
            f'<meta property="og:description" content="{words}"><meta property="og:type" content="article">'
        )


def skip_fields(app: Sphinx, what: str, name: str, member: Any, skip: bool, options: Any) -> bool | None:
    """Leave out fields of named tuples, which their class describes."""
    return True if str(getattr(member, "__doc__", "")).startswith("Alias for field number") else None


def keep_text(app: Sphinx, what: str, name: str, what_has_it: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text with names between backticks. What else reStructuredText would take for
    markup is text: |x|, a name that ends in _, a letter behind a backtick."""
    lines[:] = [
        re.sub(r"(\w`)(?=s\b)", r"\1\\ ", re.sub(r"\||(?<=\w)_(?!\w)", r"\\\g<0>", line)) for line in lines
    ]


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", add_children)
    app.connect("builder-inited", playbacks.write)
    app.connect("html-page-context", playbacks.show, priority=900)
    app.connect("autodoc-skip-member", skip_fields)
    app.connect("autodoc-process-docstring", keep_text, priority=400)  # before napoleon
    app.connect("html-page-context", mend_page, priority=900)  # after furo
    app.connect("doctree-read", unlink_folders)
    return {"parallel_read_safe": True}

"""Equations of the pages as pictures, made when the site is built: no script, no network.

A page has TeX between dollars, which GitHub renders, too. Here ziamath draws it as SVG in the colour of the
text, so that it is legible in the dark scheme and on paper. Screen readers get the same equation as MathML.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import ziamath
from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number

SIZE = 24
"""Size in which equations are drawn [pixels]; the page scales them to its text."""

ziamath.config.svg2 = False  # no shared symbols: their ids would occur twice in a page
NUMBER = re.compile(r"\\tag\{(?P<number>[^}]*)\}")


def draw(tex: str, block: bool) -> str:
    """Return an equation as SVG and MathML, scaled to the text around it.

    Args:
        tex: the equation.
        block: whether it stands on lines of its own.
    """
    svg = ziamath.Latex(tex, size=SIZE, inline=not block).svg()
    size = ElementTree.fromstring(svg).attrib
    width = float(size["width"]) / SIZE
    height = float(size["height"]) / SIZE
    top = float(size["viewBox"].split()[1]) / SIZE
    place = f'style="width:{width:.3f}em;height:{height:.3f}em;vertical-align:{-(height + top):.3f}em"'
    # A tenth of a pixel is finer than a screen.
    svg = re.sub(r"(?<=[ -])-?\d+\.\d{2,}", lambda found: f"{float(found.group()):.1f}", svg)
    drawn = re.sub(r"<svg ([^>]*?)width=\S+ height=\S+", rf'<svg aria-hidden="true" {place} \1', svg, count=1)
    spoken = convert(tex, display="block" if block else "inline")
    return f'{drawn}<span class="spoken">{spoken}</span>'


def visit_math(self: Any, node: nodes.math) -> None:
    """Write an equation within a line."""
    self.body.append(f'<span class="equation">{draw(node.astext(), block=False)}</span>')
    raise nodes.SkipNode


def visit_math_block(self: Any, node: nodes.math_block) -> None:
    """Write an equation on lines of its own, with its number on the right."""
    tex = node.astext().strip()
    tag = NUMBER.search(tex)
    number = tag["number"] if tag else get_node_equation_number(self, node) if node["number"] else ""
    label = f'<span class="number" id="equation-{number}">({number})</span>' if number else ""
    drawn = draw(NUMBER.sub("", tex), block=True)
    self.body.append(f'<div class="equation" tabindex="0"><span>{drawn}</span>{label}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_html_math_renderer("svg", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True}

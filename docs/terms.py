"""Typesets V_O, N_S and their like on the site's pages: one letter with an index, in italics.

The pages and docstrings say ``V_O``, which reads well as text. Formulas are MathJax's; these terms
stand in every paragraph, in headings and in the menu, and need neither a script nor the network.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx.transforms import SphinxTransform

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: What is typeset, where it stands by itself.
TERM = re.compile(r"(?<![\w.])(V|N|C|t)_(O|N|S|L|k|near|far)(?![\w(])")

#: Whose text stays as it is.
AS_IT_IS = (
    nodes.doctest_block,
    nodes.literal,
    nodes.literal_block,
    nodes.math,
    nodes.math_block,
    nodes.raw,
)


class Terms(SphinxTransform):
    """Puts the index of each term into a subscript."""

    default_priority = 800

    def apply(self, **_arguments: Any) -> None:
        """Replace the terms in the texts of a page."""
        for text in [*self.document.findall(nodes.Text)]:
            if TERM.search(text) and not _is_code(text):
                text.parent.replace(text, typeset(str(text)))


def typeset(text: str) -> list[nodes.Node]:
    """Return the nodes of a text with its terms in italics."""
    parts: list[nodes.Node] = []
    end = 0
    for found in TERM.finditer(text):
        letter, index = found.groups()
        term = nodes.inline(classes=["term"])
        term += [nodes.Text(letter), nodes.subscript(index, index)]
        parts += [nodes.Text(text[end : found.start()]), term]
        end = found.end()
    return [*parts, nodes.Text(text[end:])]


def _is_code(text: nodes.Text) -> bool:
    node = text.parent
    while node is not None:
        if isinstance(node, AS_IT_IS) or "code" in node.get("classes", ()):
            return True
        node = node.parent
    return False


def setup(app: Sphinx) -> dict[str, bool]:
    """Make it a part of every build."""
    app.add_transform(Terms)
    app.add_css_file("site.css")
    return {"parallel_read_safe": True, "parallel_write_safe": True}

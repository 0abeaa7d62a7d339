"""The tokens of JavaScript modules, and of each what the bundle asks of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

#: A token, and what is before it. Whether a mark begins a regular expression, or goes on with a
#: template, those before it tell.
_TOKEN = re.compile(
    r"""(?P<gap>(?:\s+|//[^\n]*|/\*.*?\*/)*)
    (?:(?P<literal>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')
    |(?P<word>\.?\d[\w.]*|[\w$#]+)
    |(?P<mark>=>|\.\.\.|\?\.(?!\d)|\+\+|--|.)
    |\Z)""",
    re.VERBOSE | re.DOTALL,
)
_TEMPLATE = re.compile(r"[`}](?:[^`\\$]|\\.|\$(?!\{))*(?:`|\$\{)", re.DOTALL)
_REGEX = re.compile(r"/(?:[^/\\[\n]|\\.|\[(?:[^]\\\n]|\\.)*\])+/\w*")

#: Words that a value follows, and those that the brackets of a statement's head follow.
_OPERATORS = {
    *("await", "case", "default", "delete", "do", "else", "extends", "in", "instanceof", "new"),
    *("return", "throw", "typeof", "void", "yield"),
}
_HEADS = {"await", "catch", "for", "if", "switch", "while"}

#: What makes a word the name of a property.
DOTS = (".", "?.")


class Token(NamedTuple):
    """A token: ``kind`` is "word" (numbers as well), "mark", "literal" or "template"."""

    kind: str | None
    text: str
    gap: str  # before it: "", " " or "\n"
    depth: int  # how many brackets are open around it; a bracket is not in itself
    inside: bool  # a function
    begins: bool  # whether it is a word that a statement may begin with


def tokens_of(name: str, text: str) -> list[Token]:
    """Return the tokens of a module, between two semicolons, without comments."""
    tokens = [Token("mark", ";", "", 0, False, False)] * 2
    brackets: list[tuple[str, bool, bool, bool, bool]] = []
    whole = inside = False  # whether all in these brackets is in a function; what is here
    head = False  # whether the brackets that were closed last are of an `if` or the like
    at = 0
    while (found := _TOKEN.match(text, at)) and found.lastgroup not in (None, "gap"):
        kind, part, at = found.lastgroup, found[found.lastgroup], found.end()
        gap = "\n" if "\n" in found["gap"] else found["gap"] and " "
        last = tokens[-1]
        word = last.text if last.kind == "word" and tokens[-2].text not in DOTS else ""
        ends_value = last.kind in ("word", "literal") and word not in _OPERATORS
        ends_value |= last.text in ("]", "}", "++", "--") or (last.text == ")" and not head)
        ends_value |= last.text.endswith("`")
        pattern = None
        if part == "`" or (part == "}" and brackets and brackets[-1][0].endswith("${")):
            kind, pattern = "template", _TEMPLATE
        elif part == "/" and not ends_value:
            kind, pattern = "literal", _REGEX
        if pattern:
            found = pattern.match(text, at - 1)
            part, at = (found[0], found.end()) if found else ("'", at)
        is_bracket = kind in ("mark", "template")
        closes = is_bracket and part[0] in ")]}"
        unclear = part == "/" and (last.text == "}" or word == "of")
        if unclear or part in ("'", '"') or (closes and not brackets):
            where = text[max(0, at - 20) : at + 20]
            raise ValueError(
                f"{name} has a {part} in {where!r}: whether it is a division, and where what it "
                "begins ends, is not known; end it, or put the operands in brackets"
            )
        if closes:
            _, whole, inside, head, arrow = brackets.pop()
            inside = whole if arrow else inside
        begins = kind == "word" and part not in ("in", "instanceof")
        begins &= last.text in (";", "}") or (gap == "\n" and ends_value)
        inside = (whole if begins or part in (",", ";") else inside) or part == "=>"
        tokens.append(Token(kind, part, gap, len(brackets), inside, begins))
        if is_bracket and part[-1] in "([{":
            brackets.append((part, whole, inside, word in _HEADS, last.text == "=>"))
            whole = inside = inside or (part == "{" and last.text == ")" and not head)
    return [*tokens[1:], tokens[0]]


def declared(tokens: list[Token]) -> Iterator[str]:
    """Return the names that a declaration binds, with which the tokens begin."""
    first, value = tokens[0], None  # the depth of a value, in which none are bound
    for before, token, after in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if first.text in ("class", "function"):
            if token.text != "*":
                yield token.text
                return
        elif token.depth < first.depth or (token.depth == first.depth and token.text == ";"):
            return
        elif value is not None:
            if token.begins and token.depth == first.depth:
                return
            if token.depth < value or (token.depth == value and token.text == ","):
                value = None
        elif token.text == "=":
            value = token.depth
        elif token.kind == "word" and after.text != ":":
            if before.text not in (first.text, "{", "[", ",", ":", "..."):
                return
            yield token.text

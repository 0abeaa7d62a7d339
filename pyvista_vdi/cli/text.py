"""Text for a terminal, and into files."""

from __future__ import annotations

import os

from pyvista_vdi.model.whole_file import whole_file


def printable(text: object) -> str:
    """Return a text whose every character can be shown: names and files may hold any.

    Control characters would move the cursor, or do worse, and half a surrogate pair, which stands
    for a byte of a file name that is no UTF-8, cannot be written at all.
    """
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(text)
    )


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text as UTF-8; the file appears whole or not at all."""
    with whole_file(path) as stream:
        stream.write(text.encode())

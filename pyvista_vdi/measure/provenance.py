"""What code a figure measured: the commit, and a hash of its kernels and modules, room by room."""

from __future__ import annotations

import ast
import hashlib
import io
import re
import subprocess
import tokenize
from collections.abc import Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError

#: Rooms that every picture passes through.
_EVERY_FIGURE = ("device", "lib", "model")

_KERNEL_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


def provenance(rooms: Iterable[str]) -> dict[str, Any]:
    """Return what code a figure measures, for its file of results.

    ``rooms``: folders below ``pyvista_vdi/`` and below ``opencl/`` whose code decides the figure,
    such as ``"raycasting"``. Those that every picture passes through are added. Returns:
    ``commit``: of the checkout that the package runs from, with ``+`` where files differ from it,
    and ``None`` outside a checkout; ``sources``: SHA-256 by room, see :func:`room_hash`. Raises
    InvalidArgumentError if a room is neither a folder of the package nor of the kernels.
    """
    wanted = sorted({*_EVERY_FIGURE, *rooms})
    return {"commit": _commit(), "sources": {room: room_hash(room) for room in wanted}}


def room_hash(room: str) -> str:
    """Return the first 16 digits of the SHA-256 of a room's kernels and modules.

    Comments, docstrings and white space do not count: they change no figure.

    Raises InvalidArgumentError if there is no such room.
    """
    digest = hashlib.sha256()
    found = [
        (f"{kind}{path.relative_to(folder).as_posix()}", path)
        for kind, folder in _folders(room).items()
        for path in folder.rglob("*")
        if path.suffix in _STRIPPED and "__pycache__" not in path.parts
    ]
    if not found:
        raise InvalidArgumentError(
            f"{room!r} is no folder of pyvista_vdi/ or opencl/: name one, such as 'raycasting'"
        )
    for name, path in sorted(found):
        text = _STRIPPED[path.suffix](path.read_text(encoding="utf-8"))
        digest.update(f"{name}\0{' '.join(text.split())}\0".encode())
    return digest.hexdigest()[:16]


def outdated(measured: Mapping[str, Any]) -> list[str]:
    """Return the rooms whose code is another now than when a figure was measured.

    ``measured``: what :func:`provenance` returned then. A room that is gone counts as changed.
    """
    changed = []
    for room, digest in measured["sources"].items():
        try:
            same = room_hash(room) == digest
        except InvalidArgumentError:
            same = False
        if not same:
            changed.append(room)
    return changed


def _folders(room: str) -> dict[str, Path]:
    package, kernels = (Path(str(files(name))) for name in ("pyvista_vdi", "pyvista_vdi.opencl"))
    return {"": package / room, "opencl/": kernels / room}


def _without_remarks(text: str) -> str:
    """Return Python source without comments and docstrings, the same by every Python."""
    lines = text.splitlines()
    # Comments end their line
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column]
    # Docstrings have lines of their own
    holders = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, holders) and ast.get_docstring(node, clean=False) is not None:
            first = node.body[0]
            lines[first.lineno - 1 : first.end_lineno] = [""] * (
                (first.end_lineno or first.lineno) - first.lineno + 1
            )
    return "\n".join(lines)


#: By suffix, what removes from a source all that changes no figure.
_STRIPPED = {
    ".py": _without_remarks,
    ".cl": lambda text: _KERNEL_COMMENT.sub("", text),
    ".js": lambda text: text,  # strings hold "//"
}


def _commit() -> str | None:
    """Return the commit of the checkout around the package, ``+`` behind it where files differ."""
    folder = Path(str(files("pyvista_vdi")))

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(folder), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")) != folder.parent:
            return None  # an environment inside somebody else's checkout
        changed = git("status", "--porcelain", "--untracked-files=no", "--", ".", "../opencl")
        return git("rev-parse", "--short=9", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return None

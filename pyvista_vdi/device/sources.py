"""Kernel text: package resources, includes expanded once per file, with ``#line`` marks."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from pathlib import Path, PurePosixPath

from pyvista_vdi.device.constants import definitions
from pyvista_vdi.errors import KernelBuildError

_INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]')
_CONDITIONAL = re.compile(r"^\s*#\s*(if|endif)")


def read_resource(path: str) -> str:
    """Return the text of a file of the package ``pyvista_vdi.opencl``: ``"lib/rays.cl"``, say.

    FileNotFoundError if there is no such file, or the path leaves the package.
    """
    parts = PurePosixPath(path).parts
    if not parts or ".." in parts or PurePosixPath(path).is_absolute():
        raise FileNotFoundError(path)
    resource = files("pyvista_vdi.opencl").joinpath(*parts)
    if not resource.is_file():
        raise FileNotFoundError(path)
    return resource.read_text(encoding="utf-8")


def expand(path: str | Path) -> str:
    """Return a kernel file's text with its includes, and the constants that it may use, in place.

    Each file is expanded where it is first included and left out afterwards, so files need no
    include guards. An include inside ``#if`` is refused: it would depend on the first place.

    Parameters
    ----------
    path : str or pathlib.Path
        A string is a path inside ``pyvista_vdi.opencl``; a :class:`~pathlib.Path` is any file on
        disk (tests and users' own kernels), whose includes are taken from ``pyvista_vdi.opencl``.

    Raises
    ------
    KernelBuildError
        If a file is missing or an include stands inside a conditional.
    """
    if isinstance(path, str):
        return _expand_resource(path)
    try:
        return _expand_text(path.name, path.read_text(encoding="utf-8"))
    except OSError as exc:
        raise KernelBuildError(f"the kernel file {str(path)!r} cannot be read: {exc}") from exc


@cache
def _expand_resource(path: str) -> str:
    try:
        text = read_resource(path)
    except FileNotFoundError as exc:
        raise KernelBuildError(f"no kernel file {path!r} in pyvista_vdi.opencl") from exc
    return _expand_text(path, text)


def _expand_text(name: str, text: str) -> str:
    lines: list[str] = []
    seen = {name}
    _append_file(name, text, seen, lines)
    constants = definitions({file.partition("/")[0] for file in seen})
    return "\n".join([*constants, *lines]) + "\n"


def _append_file(name: str, text: str, seen: set[str], out: list[str]) -> None:
    out.append(f'#line 1 "{name}"')
    depth = 0
    for number, line in enumerate(text.splitlines(), start=1):
        conditional, found = _CONDITIONAL.match(line), _INCLUDE.match(line)
        if conditional:
            depth += 1 if conditional[1] == "if" else -1
        if found is None:
            out.append(line)
            continue

        # Replace the directive by the file's text, or by nothing where it stands already
        target = str(PurePosixPath(found.group(1)))
        if depth > 0:
            raise KernelBuildError(
                f'{name}:{number}: #include "{target}" stands inside #if; files are included once '
                "for the whole program, so move the include out of the conditional"
            )
        if target not in seen:
            seen.add(target)
            try:
                included = read_resource(target)
            except FileNotFoundError as exc:
                raise KernelBuildError(
                    f'{name}:{number}: #include "{target}": no such file in pyvista_vdi.opencl '
                    "(paths are relative to that package, not to the including file)"
                ) from exc
            _append_file(target, included, seen, out)
        out.append(f'#line {number + 1} "{name}"')

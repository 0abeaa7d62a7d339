"""How something is timed: rounds in turn, medians and ratios, and whether chance explains them."""

import ast
import hashlib
import io
import re
import statistics
import subprocess
import time
import tokenize
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import lru_cache
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import Any

from pyvista_vdi.device import Profile, Runtime
from pyvista_vdi.errors import InvalidArgumentError

#: A piece of work; its result is not looked at.
Step = Callable[[], object]

#: Seconds of each repetition by the name of a clock; ``device``, of those in which kernels ran.
Times = dict[str, list[float]]

#: Clocks by the names that the times get.
WALL: Mapping[str, Callable[[], float]] = {"clock": time.perf_counter}

#: Chance of a separation by noise up to which times count as different.
CHANCE = 0.01

#: Samples of either up to which the chance is exact; SciPy's takes long beyond.
EXACT = 40


def take_turns(
    work: Mapping[str, Step],
    repeats: int,
    *,
    runtime: Runtime | None = None,
    warm_up: bool = True,
    clocks: Mapping[str, Callable[[], float]] = WALL,
    done: Callable[[], object] = lambda: None,
) -> dict[str, Times]:
    """Time pieces of work, one after the other in turn, and return the times by name.

    ``runtime``: whose kernels are timed by the driver's events, too. ``warm_up``: do each once
    before, so that nothing is compiled or uploaded while it is timed. ``done`` is called after each
    piece.
    """
    if warm_up:
        for step in work.values():
            step()
            done()
    taken: dict[str, Times] = {n: {clock: [] for clock in clocks} for n in work}
    profile = Profile()
    with ExitStack() as stack:
        if runtime is not None:
            stack.enter_context(runtime.queue_scope(profile))
            for times in taken.values():
                times["device"] = []
        for _ in range(repeats):
            for name, step in work.items():
                before = profile.kernel_seconds()
                begin = {clock: tell() for clock, tell in clocks.items()}
                step()
                for clock, tell in clocks.items():
                    taken[name][clock].append(tell() - begin[clock])
                if (kernels := profile.kernel_seconds() - before) > 0:
                    taken[name]["device"].append(kernels)
                done()
    return taken


def median(taken: Mapping[str, Sequence[float]], clock: str = "clock") -> float | None:
    """Return the median by a clock, seconds; ``None`` where it has no times."""
    return statistics.median(taken[clock]) if taken.get(clock) else None


def spread(values: Sequence[float]) -> float:
    """Return half of what lies between the least and the most, over the median."""
    return (max(values) - min(values)) / 2 / statistics.median(values)


def ratios(ours: Sequence[float], theirs: Sequence[float]) -> list[float]:
    """Return each repetition over the other's in the same round."""
    return [a / b for a, b in zip(ours, theirs, strict=True)]


@lru_cache(maxsize=2**16)  # fronts compare the same samples again and again
def rank_sum_chance(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Return the chance, 0 to 1, that samples of one distribution are as separated as these.

    Wilcoxon's rank sum test, two-sided: exact, and by the normal distribution where both have more
    than :data:`EXACT` samples.
    """
    from scipy.stats import mannwhitneyu  # takes a second to load

    method = "exact" if min(len(a), len(b)) <= EXACT else "asymptotic"
    return float(mannwhitneyu(a, b, method=method).pvalue)


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

    See :func:`sources_hash`. Raises InvalidArgumentError if there is no such room.
    """
    package, kernels = (Path(str(files(name))) for name in ("pyvista_vdi", "pyvista_vdi.opencl"))
    found = {
        f"{kind}{path.relative_to(folder).as_posix()}": path.read_text(encoding="utf-8")
        for kind, folder in (("", package / room), ("opencl/", kernels / room))
        for path in folder.rglob("*")
        if path.suffix in _STRIPPED and "__pycache__" not in path.parts
    }
    if not found:
        raise InvalidArgumentError(
            f"{room!r} is no folder of pyvista_vdi/ or opencl/: name one, such as 'raycasting'"
        )
    return sources_hash(found)


def sources_hash(sources: Mapping[str, str]) -> str:
    """Return the first 16 digits of the SHA-256 of sources, texts by their paths in a room.

    Kernels' paths begin with ``opencl/``. Comments, docstrings and white space do not count: they
    change no figure. Nor do files that are neither kernels nor modules.
    """
    digest = hashlib.sha256()
    for name, text in sorted(sources.items()):
        suffix = PurePosixPath(name).suffix
        if suffix in _STRIPPED:
            digest.update(f"{name}\0{_words(suffix, text)}\0".encode())
    return digest.hexdigest()[:16]


@lru_cache(maxsize=2**12)  # most sources are the same in many commits
def _words(suffix: str, text: str) -> str:
    """Return what of a source counts, a space between any two words."""
    return " ".join(_STRIPPED[suffix](text).split())


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

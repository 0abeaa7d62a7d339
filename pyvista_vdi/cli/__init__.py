"""The command ``pyvista-vdi``: parses arguments, runs a verb, and turns errors into one line."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from types import FrameType
from typing import Any

from pyvista_vdi.cli.parser import UsageError, parse
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import VDIError

#: Set to 1, it lets errors through with their traceback.
DEBUG_VARIABLE = "PYVISTA_VDI_DEBUG"

#: Exit status of a command that a signal ended: 128 and SIGINT's number, as shells have it.
_INTERRUPTED = 130

#: Exit status of a mistake in the arguments, as argparse has it.
_MISUSED = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status.

    That is 0 if all went well, 2 for a mistake in the arguments, 130 after Ctrl-C, and 1 for
    anything else that went wrong.
    """
    try:
        options = parse(sys.argv[1:] if arguments is None else list(arguments))
        if options is None:  # --help and --version have said what there is to say
            return 0
        with _no_interrupt_lost():
            return int(options.run(options))
    except UsageError as error:
        return _complain(str(error), _MISUSED)
    except BrokenPipeError:
        # Whoever reads our output has seen enough; what Python would flush at exit goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (VDIError, OSError, MemoryError, KeyboardInterrupt) as error:
        if os.environ.get(DEBUG_VARIABLE) == "1":
            raise
        if isinstance(error, KeyboardInterrupt):
            return _complain("interrupted; nothing was left half done", _INTERRUPTED)
        said = str(error)  # of OSError: a full disk, or an encoder that has ended
        if isinstance(error, MemoryError):
            said = f"not enough memory ({error}): lower --size or --max-supersegments"
        return _complain(said, 1)


@contextlib.contextmanager
def _no_interrupt_lost() -> Iterator[None]:
    """Raise a Ctrl-C again that came where nothing can be raised, so that Python would print it.

    Such places are destructors and the callbacks of weak references, of which every import has one.
    """
    before = sys.unraisablehook

    def unraisable(found: Any) -> None:
        if issubclass(found.exc_type, KeyboardInterrupt):
            sys.setprofile(raise_again)
        else:
            before(found)

    def raise_again(frame: FrameType, event: str, argument: object) -> None:
        """Called by Python when the code that was interrupted next calls or returns."""
        if frame.f_code is not unraisable.__code__:
            sys.setprofile(None)
            raise KeyboardInterrupt

    sys.unraisablehook = unraisable
    try:
        yield
    finally:
        sys.unraisablehook = before


def _complain(message: str, status: int) -> int:
    print(f"pyvista-vdi: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return status

"""The command ``pyvista-vdi``: parses arguments, runs a subcommand, turns errors into one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from pyvista_vdi.cli.parser import UsageError, parse
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import VDIError

#: Set to 1, it lets errors through with their traceback.
DEBUG_VARIABLE = "PYVISTA_VDI_DEBUG"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status.

    That is 0 if all went well, 2 for a mistake in the arguments, 130 after Ctrl-C, and 1 for
    anything else that went wrong.
    """
    try:
        options = parse(sys.argv[1:] if arguments is None else list(arguments))
        # Help and the version have said what there is to say
        return 0 if options is None else int(options.run(options))
    except UsageError as error:
        return _complain(str(error), 2)
    except BrokenPipeError:
        # Whoever reads our output has seen enough; what Python would flush at exit goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (VDIError, OSError, MemoryError, KeyboardInterrupt) as error:
        if os.environ.get(DEBUG_VARIABLE) == "1":
            raise
        if isinstance(error, KeyboardInterrupt):
            return _complain("interrupted; nothing was left half done", 130)
        if isinstance(error, MemoryError):
            message = f"not enough memory ({error}): lower --size or --max-supersegments"
            return _complain(message, 1)
        return _complain(str(error), 1)


def _complain(message: str, status: int) -> int:
    print(f"pyvista-vdi: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return status

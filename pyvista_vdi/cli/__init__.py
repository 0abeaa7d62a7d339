"""The command ``pyvista-vdi``: parses arguments, runs a verb, and turns errors into one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

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
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process by default.

    Returns
    -------
    int
        Exit status: 0 if all went well, 2 for a mistake in the arguments, 130 after Ctrl-C, and
        1 for anything else that went wrong.
    """
    debug = os.environ.get(DEBUG_VARIABLE) == "1"
    try:
        options = parse(sys.argv[1:] if arguments is None else list(arguments))
        if options is None:  # --help and --version have said what there is to say
            return 0
        return int(options.run(options))
    except UsageError as error:
        return _complain(str(error), _MISUSED)
    except VDIError as error:
        if debug:
            raise
        return _complain(str(error), 1)
    except MemoryError as error:
        if debug:
            raise
        return _complain(f"not enough memory ({error}): lower --size or --max-supersegments", 1)
    except KeyboardInterrupt:
        if debug:
            raise
        return _complain("interrupted; nothing was left half done", _INTERRUPTED)
    except BrokenPipeError:
        # Whoever reads our output has seen enough; what Python would flush at exit goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _complain(message: str, status: int) -> int:
    print(f"pyvista-vdi: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return status

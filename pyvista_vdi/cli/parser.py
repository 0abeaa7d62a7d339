"""Parses the command line, and says what was meant where something is wrong."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Sequence
from typing import Any, NoReturn

from pyvista_vdi import registry
from pyvista_vdi._version import __version__
from pyvista_vdi.cli.declare import add
from pyvista_vdi.cli.verbs import VERBS

_DESCRIPTION = "Volumetric Depth Images: generate, render, view and compare them."

#: What the command says without a subcommand.
_LESSON = f"""{_DESCRIPTION} Version {__version__}.

A first session, with a volume that is shipped:

  pyvista-vdi generate --example brain --tf soft -o brain.vdi     make a VDI
  pyvista-vdi view brain.vdi                                      turn it in a window
  pyvista-vdi render brain.vdi -o brain.png --azimuth 20          or a picture from elsewhere
  pyvista-vdi convert brain.vdi -o brain.html                     or a page that turns it
  pyvista-vdi turntable --example brain --tf soft -o brain.gif    or a moving picture

With your own, a file or a folder of DICOM slices:

  pyvista-vdi generate scans/head -o head.vdi --cmap ct-bone

pyvista-vdi --help lists all subcommands, pyvista-vdi generate --help explains one, and
pyvista-vdi devices says on what it runs.
"""

#: So many names are listed where none of them is meant; more are left to ``--help``.
_LISTED = 16

#: Subcommands that went, and what does their work.
_GONE = {
    "benchmark": "the paper's tables are measured by a script of a checkout, benchmarks/paper.py"
}


class UsageError(Exception):
    """A mistake in the arguments; the message says which and what is right."""


class _Parser(argparse.ArgumentParser):
    """An argument parser that raises instead of leaving the process, and says one line."""

    def _parse_optional(self, arg_string: str) -> Any:
        # A value is -1.8e-15, too, and -1,0: argparse's own rule knows numbers like -1.5
        return None if re.match(r"-\.?\d", arg_string) else super()._parse_optional(arg_string)

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


def parse(arguments: list[str]) -> argparse.Namespace | None:
    """Parse the command line; ``None`` if help or the version was asked for.

    Raises UsageError, which suggests what may have been meant.
    """
    added = registry.verbs()
    both: dict[str, Any] = {**VERBS, **added}
    known = {name: (verb.summary, verb.example) for name, verb in both.items()}
    name, *rest = arguments or [""]
    if not name:
        print(_LESSON, end="")
    elif name in ("-h", "--help"):
        listed = "\n".join(f"    {name:<11}{summary}" for name, (summary, _) in known.items())
        print(f"usage: pyvista-vdi [--version] SUBCOMMAND ...\n\n{_DESCRIPTION}\n\n{listed}\n")
        print("Each explains itself: pyvista-vdi generate --help")
    elif name == "--version":
        print(f"pyvista-vdi {__version__}")
    elif name not in known:
        hint = _GONE.get(name) or _suggestion(name, list(known))
        raise UsageError(f"there is no subcommand {name!r}: {hint}")
    else:
        summary, example = known[name]
        parser = _Parser(
            prog=f"pyvista-vdi {name}",
            description=f"{summary[0].upper()}{summary[1:]}.",
            epilog=f"Example:\n  {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        own = VERBS.get(name)
        add(parser, registry.load(added[name].options) if own is None else own.options)
        place = added[name].run if own is None else f"{__package__}.{own.module}:{name}"
        parser.set_defaults(run=_run, place=place)
        return _parsed(parser, rest)
    return None


def _parsed(parser: _Parser, arguments: list[str]) -> argparse.Namespace | None:
    """Parse the arguments of a subcommand; name one that is not known before its value."""
    options = [name for name in parser._option_string_actions if name.startswith("--")]
    names = (text.split("=")[0] for text in arguments[: [*arguments, "--"].index("--")])
    wrong = [text for text in names if text.startswith("--") and text not in options]
    try:
        found, unknown = (None, wrong) if wrong else parser.parse_known_args(arguments)
    except SystemExit:  # after --help
        return None
    if unknown:
        # With the value that was given with it
        argument = next(text for text in arguments if text.startswith(unknown[0]))
        hint = f"; see {parser.prog} --help"
        if argument.startswith("-"):
            hint = f": {_suggestion(argument.split('=')[0], options)}"
        raise UsageError(f"{parser.prog.split()[-1]} takes no argument {argument!r}{hint}")
    return found


def _run(options: argparse.Namespace) -> int:
    """Import the subcommand's module, which brings what it needs, and run it."""
    function = registry.load(options.place)
    if getattr(options, "device", None) is not None:
        from pyvista_vdi.device import get_runtime

        get_runtime(options.device)  # a wrong name is said before minutes of reading
    return int(function(options))


def _suggestion(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    if near:
        return f"did you mean {near[0]!r}?"
    names = list(dict.fromkeys(known))
    return f"known are {', '.join(names)}" if len(names) <= _LISTED else "see --help"

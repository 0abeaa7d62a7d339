"""Parses the command line, and says what was meant where something is wrong."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Sequence
from typing import Any, NoReturn

from pyvista_vdi import registry
from pyvista_vdi._version import __version__
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
    parser, verbs = _make_parser(arguments[0] if arguments else "")
    if not arguments:
        print(_LESSON, end="")
        return None
    if arguments[0] in _GONE:
        raise UsageError(f"there is no subcommand {arguments[0]!r}: {_GONE[arguments[0]]}")
    if not arguments[0].startswith("-") and arguments[0] not in verbs:
        raise UsageError(
            f"there is no subcommand {arguments[0]!r}: {_suggestion(arguments[0], list(verbs))}"
        )
    if arguments[0] in verbs:
        _check_option_names(verbs[arguments[0]], arguments[1:])
    try:
        options, unknown = parser.parse_known_args(arguments)
    except SystemExit:  # after --help and --version
        return None
    if unknown:
        _refuse_argument(verbs[options.verb], unknown[0])
    return options


def _check_option_names(verb: _Parser, arguments: Sequence[str]) -> None:
    """Name an unknown option before argparse takes the value behind it for a file."""
    for argument in arguments[: arguments.index("--") if "--" in arguments else None]:
        name = argument.split("=")[0]
        if name.startswith("--") and name not in _option_names(verb):
            _refuse_argument(verb, argument)


def _option_names(verb: _Parser) -> list[str]:
    return [name for name in verb._option_string_actions if name.startswith("--")]


def _refuse_argument(verb: _Parser, argument: str) -> NoReturn:
    hint = f"; see {verb.prog} --help"
    if argument.startswith("-"):
        hint = f": {_suggestion(argument.split('=')[0], _option_names(verb))}"
    raise UsageError(f"{verb.prog.split()[-1]} takes no argument {argument!r}{hint}")


def run_verb(options: argparse.Namespace) -> int:
    """Import the verb's module, which brings what it needs, and run it."""
    verb = registry.load(options.place)
    if getattr(options, "device", None) is not None:
        from pyvista_vdi.device import get_runtime

        get_runtime(options.device)  # a wrong name is said before minutes of reading
    return int(verb(options))


def _suggestion(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    if near:
        return f"did you mean {near[0]!r}?"
    names = list(dict.fromkeys(known))
    return f"known are {', '.join(names)}" if len(names) <= _LISTED else "see --help"


def _make_parser(asked: str) -> tuple[_Parser, dict[str, _Parser]]:
    """Return the parser and those of all subcommands; only the one that is asked has options."""
    added = registry.verbs()
    known = {name: verb[1:3] for name, verb in VERBS.items()}
    known |= {name: (verb.summary, verb.example) for name, verb in added.items()}
    listed = "\n".join(f"    {name:<11}{summary}" for name, (summary, _) in known.items())
    parser = _Parser(
        prog="pyvista-vdi",
        usage="pyvista-vdi [--version] SUBCOMMAND ...",
        description=f"{_DESCRIPTION}\n\n{listed}",
        epilog="Each explains itself: pyvista-vdi generate --help",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
        add_help=False,
    )
    parser.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)
    version = f"pyvista-vdi {__version__}"
    parser.add_argument("--version", action="version", version=version, help=argparse.SUPPRESS)
    subparsers = parser.add_subparsers(dest="verb", required=True, help=argparse.SUPPRESS)
    verbs: dict[str, _Parser] = {}
    for name, (summary, example) in known.items():
        verbs[name] = subparsers.add_parser(
            name,
            prog=f"pyvista-vdi {name}",
            description=summary[0].upper() + summary[1:] + ".",
            epilog=f"Example:\n  {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        own = VERBS.get(name)
        if name == asked:
            (registry.load(added[name].options) if own is None else own.options)(verbs[name])
        place = added[name].run if own is None else f"{__package__}.{own.module}:{name}"
        verbs[name].set_defaults(run=run_verb, place=place)
    return parser, verbs
